//! Tests whether a tone belongs to the sensor, even if it explains little of the residual.
//!
//! The misfit of a coarse base may be far larger than a tone, but it varies with the drive and has power where the
//! motion has power. A sensor tone is present throughout the record, exceeds the residual at neighbouring frequencies,
//! and is not small compared with the motion at its frequency.

use std::ops::Range;

use super::spectrum::{explained, strongest};
use super::trial::Trial;
use crate::criteria::MINOR_SHARE;
use crate::nested::Problem;
use crate::samples::Samples;

/// Number of neighbouring frequencies on each side, and their spacing in lines of the longest segment.
const NEIGHBOURS: usize = 8;
const LINE_SPACING: f64 = 2.0;
/// Minimum power of the tone relative to its neighbours.
const MIN_POWER_RATIO: f64 = 20.0;
/// Number of parts of the record; minimum number of parts that show the tone; minimum number with little motion at its
/// frequency; and range of the tone's height in a part, relative to the whole record.
const PARTS: usize = 8;
const MIN_PARTS_WITH_TONE: usize = 7;
const MIN_QUIET_PARTS: usize = 4;
const HEIGHT_RATIO: Range<f64> = 0.5..1.5;
/// Highest order of a harmonic of the drive's strongest line at which a misfit may occur.
const MAX_HARMONIC: f64 = 20.0;

/// Returns whether the trial's tone is caused neither by the drive nor by a misfit.
pub(super) fn is_sensor_tone(problem: &Problem<'_>, with: &Trial) -> bool {
    let fit = &with.fit;
    let Some(tone) = fit.hypothesis.effects.interference else { return false };
    let (Ok(motion), Ok(residual)) = (problem.motion(&fit.hypothesis, &fit.solution), problem.residual(fit)) else {
        return false;
    };
    let samples = problem.samples;
    let wave: Vec<f64> = samples.time.iter().map(|t| tone.at(*t)).collect();
    let power: f64 = wave.iter().map(|w| w * w).sum();
    is_present_throughout(&residual, &wave)
        && is_prominent(samples, &residual, tone.hz, power)
        && is_present_at_rest(samples, &motion, &wave, tone.hz)
        && !is_harmonic(samples, &motion, tone.hz)
}

/// Returns whether nearly every part of the record shows the tone with its overall height.
fn is_present_throughout(residual: &[f64], wave: &[f64]) -> bool {
    let part = wave.len().div_ceil(PARTS).max(1);
    let shown = residual.chunks(part).zip(wave.chunks(part)).filter(|(residual, wave)| {
        let own: f64 = wave.iter().map(|w| w * w).sum();
        let shared: f64 = residual.iter().zip(*wave).map(|(r, w)| r * w).sum();
        HEIGHT_RATIO.contains(&(1.0 + shared / own.max(f64::MIN_POSITIVE)))
    });
    shown.count() >= MIN_PARTS_WITH_TONE
}

/// Returns the amplitude from which on a tone exceeds the residual at neighbouring frequencies, and the motion at its
/// own frequency, by as much as a tone of the sensor has to.
pub(super) fn least_amplitude(samples: &Samples, motion: &[f64], residual: &[f64], hz: f64) -> f64 {
    // A tone of amplitude a has the power a²/2 in each row.
    let of = |power: f64, rows: usize| (2.0 * power / rows.max(1) as f64).sqrt();
    let part = motion.len().div_ceil(PARTS).max(1);
    let mut quiet: Vec<f64> = (0..motion.len())
        .step_by(part)
        .map(|from| from..(from + part).min(motion.len()))
        .map(|rows| of(MINOR_SHARE * moved_in(samples, motion, &rows, hz), rows.len()))
        .collect();
    quiet.sort_by(f64::total_cmp);
    let beside_motion = quiet.get(MIN_QUIET_PARTS - 1).or(quiet.last()).copied().unwrap_or(0.0);
    let beside_residual = neighbouring_power(samples, residual, hz).unwrap_or(0.0);
    beside_motion.max(of(MIN_POWER_RATIO * beside_residual, residual.len()))
}

/// Returns whether a tone of this power far exceeds the residual at neighbouring frequencies.
fn is_prominent(samples: &Samples, residual: &[f64], hz: f64, power: f64) -> bool {
    neighbouring_power(samples, residual, hz).is_some_and(|middle| power > MIN_POWER_RATIO * middle)
}

/// Returns the median power of the residual at neighbouring frequencies.
fn neighbouring_power(samples: &Samples, residual: &[f64], hz: f64) -> Option<f64> {
    let spacing = LINE_SPACING / samples.longest_segment();
    let mut neighbours: Vec<f64> = (1..=NEIGHBOURS)
        .flat_map(|k| [-1.0, 1.0].map(|side| hz + side * spacing * k as f64))
        .filter(|hz| *hz > 0.0 && *hz < 0.5 / samples.period)
        .map(|hz| explained(samples, &samples.segments, residual, hz))
        .collect();
    neighbours.sort_by(f64::total_cmp);
    neighbours.get(neighbours.len() / 2).copied()
}

/// Returns whether enough parts of the record have little motion at the tone's frequency and next to it.
fn is_present_at_rest(samples: &Samples, motion: &[f64], wave: &[f64], hz: f64) -> bool {
    let part = wave.len().div_ceil(PARTS).max(1);
    let quiet = wave.chunks(part).enumerate().filter(|(i, wave)| {
        let moved = moved_in(samples, motion, &(i * part..i * part + wave.len()), hz);
        wave.iter().map(|w| w * w).sum::<f64>() > MINOR_SHARE * moved
    });
    quiet.count() >= MIN_QUIET_PARTS
}

/// Returns the power of the motion in these rows at a frequency and next to it.
fn moved_in(samples: &Samples, motion: &[f64], rows: &Range<usize>, hz: f64) -> f64 {
    let line = 1.0 / samples.longest_segment();
    // Per segment, because the phases of the motion need not agree.
    let pieces: Vec<Range<usize>> = samples
        .segments
        .iter()
        .map(|s| s.start.max(rows.start)..s.end.min(rows.end))
        .filter(|piece| !piece.is_empty())
        .collect();
    let of = |hz: f64| pieces.iter().map(|s| explained(samples, std::slice::from_ref(s), motion, hz)).sum();
    [hz - line, hz, hz + line].map(of).into_iter().fold(0.0, f64::max)
}

/// Returns whether the frequency is a harmonic of the strongest line of the motion.
fn is_harmonic(samples: &Samples, motion: &[f64], hz: f64) -> bool {
    let line = 1.0 / samples.longest_segment();
    let Some(first) = strongest(samples, motion).filter(|first| *first > line) else { return false };
    let order = (hz / first).round();
    (1.0..=MAX_HARMONIC).contains(&order) && (hz - order * first).abs() < 1.5 * line && first > 4.0 * line
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows with a period of 1 ms.
    fn samples(rows: usize) -> Samples {
        Samples::of_columns(1e-3, vec![0.0; rows], vec![0.0; rows])
    }

    fn sine(samples: &Samples, hz: f64) -> Vec<f64> {
        samples.time.iter().map(|t| (std::f64::consts::TAU * hz * t).sin()).collect()
    }

    #[test]
    fn a_tone_in_a_third_of_the_record_is_not_present_throughout() {
        let s = samples(16_000);
        let wave = sine(&s, 50.0);
        assert!(is_present_throughout(&vec![0.0; s.len()], &wave));
        // A line in only a third of the record is fitted with a third of its height over the whole record.
        let whole: Vec<f64> = wave.iter().map(|w| w / 3.0).collect();
        let residual: Vec<f64> =
            wave.iter().enumerate().map(|(k, w)| if k < 5_333 { 2.0 * w / 3.0 } else { -w / 3.0 }).collect();
        assert!(!is_present_throughout(&residual, &whole));
    }

    #[test]
    fn a_line_among_similar_ones_is_not_prominent() {
        let s = samples(16_000);
        let power = 8_000.0;
        assert!(is_prominent(&s, &vec![0.0; s.len()], 50.0, power));
        // A sweep has as much power at the neighbouring frequencies.
        let sweep: Vec<f64> = s.time.iter().map(|t| (std::f64::consts::TAU * (40.0 + 0.6 * t) * t).sin()).collect();
        let neighbours = explained(&s, &s.segments, &sweep, 50.0);
        assert!(!is_prominent(&s, &sweep, 50.0, 3.0 * neighbours));
    }

    #[test]
    fn a_tone_at_the_least_amplitude_is_prominent_and_present_at_rest() {
        let s = samples(16_000);
        let motion: Vec<f64> =
            s.time.iter().map(|t| (0.3 * t).sin() * (std::f64::consts::TAU * 50.0 * t).sin()).collect();
        let residual: Vec<f64> = (0..16_000_u64).map(|k| (k * k % 101) as f64 / 101.0 - 0.5).collect();
        let least = least_amplitude(&s, &motion, &residual, 50.0);
        let holds = |amplitude: f64| {
            let wave: Vec<f64> = sine(&s, 50.0).iter().map(|w| amplitude * w).collect();
            let power = wave.iter().map(|w| w * w).sum();
            is_prominent(&s, &residual, 50.0, power) && is_present_at_rest(&s, &motion, &wave, 50.0)
        };
        assert!(holds(1.01 * least) && !holds(0.99 * least), "{least}");
    }

    #[test]
    fn harmonics_are_those_of_the_strongest_line() {
        let s = samples(16_000);
        let motion = sine(&s, 7.0);
        assert!(is_harmonic(&s, &motion, 14.0) && is_harmonic(&s, &motion, 35.02));
        assert!(!is_harmonic(&s, &motion, 47.0));
    }

    #[test]
    fn a_line_of_the_motion_is_no_tone_of_the_sensor() {
        let mut s = samples(16_000);
        s.segments = vec![0..9_000, 9_000..16_000];
        let wave: Vec<f64> = sine(&s, 50.0).iter().map(|w| 0.1 * w).collect();
        let mut motion = sine(&s, 50.0);
        motion[9_000..].iter_mut().for_each(|y| *y = -*y);
        assert!(!is_present_at_rest(&s, &motion, &wave, 50.0));
        motion[..9_000].fill(0.0);
        assert!(is_present_at_rest(&s, &motion, &wave, 50.0));
    }
}
