//! Whether a tone is the sensor's own, however little of what is left it explains.
//!
//! A coarse base's misfit may be far larger than a tone, but it comes and goes with the drive and has power where the motion has. A tone that is
//! there all the time, stands out of what is left beside it and is no small part of what moves at its frequency is none of that.

use std::ops::Range;

use super::spectrum::{explained, strongest};
use super::trial::Trial;
use crate::criteria::MINOR_SHARE;
use crate::nested::Problem;
use crate::samples::Samples;

/// Frequencies to each side that a tone is held against, and how far they are apart, in lines of the longest segment.
const NEIGHBOURS: usize = 8;
const APART: f64 = 2.0;
/// How far it stands above them (power).
const OVER_NEIGHBOURS: f64 = 20.0;
/// Parts of the record, in how many of them it is there, in how many of them so little moves at its frequency, and between which shares of its
/// height over the whole record it is there.
const PARTS: usize = 8;
const MOST_PARTS: usize = 7;
const QUIET_PARTS: usize = 4;
const THERE: Range<f64> = 0.5..1.5;
/// Harmonics of the drive's strongest line that a misfit may ring at.
const HARMONICS: f64 = 20.0;

/// Whether the tone that a trial holds is one that neither the drive nor a misfit makes.
pub(super) fn stands_alone(problem: &Problem<'_>, with: &Trial) -> bool {
    let fit = &with.fit;
    let Some(tone) = fit.hypothesis.effects.interference else { return false };
    let (Ok(motion), Ok(left)) = (problem.motion(&fit.hypothesis, &fit.solution), problem.residual(fit)) else {
        return false;
    };
    let samples = problem.samples;
    let wave: Vec<f64> = samples.time.iter().map(|t| tone.at(*t)).collect();
    let power: f64 = wave.iter().map(|w| w * w).sum();
    is_there_throughout(&left, &wave)
        && stands_out(samples, &left, tone.hz, power)
        && is_there_at_rest(samples, &motion, &wave, tone.hz)
        && !is_harmonic(samples, &motion, tone.hz)
}

/// Whether nearly every part of the record shows the tone as the whole does.
fn is_there_throughout(left: &[f64], wave: &[f64]) -> bool {
    let part = wave.len().div_ceil(PARTS).max(1);
    let shown = left.chunks(part).zip(wave.chunks(part)).filter(|(left, wave)| {
        let own: f64 = wave.iter().map(|w| w * w).sum();
        let shared: f64 = left.iter().zip(*wave).map(|(r, w)| r * w).sum();
        THERE.contains(&(1.0 + shared / own.max(f64::MIN_POSITIVE)))
    });
    shown.count() >= MOST_PARTS
}

/// Whether a tone of this power stands far above what is left beside it.
fn stands_out(samples: &Samples, left: &[f64], hz: f64, power: f64) -> bool {
    let apart = APART / samples.longest_segment();
    let mut beside: Vec<f64> = (1..=NEIGHBOURS)
        .flat_map(|k| [-1.0, 1.0].map(|side| hz + side * apart * k as f64))
        .filter(|hz| *hz > 0.0 && *hz < 0.5 / samples.period)
        .map(|hz| explained(samples, &samples.segments, left, hz))
        .collect();
    beside.sort_by(f64::total_cmp);
    beside.get(beside.len() / 2).is_some_and(|middle| power > OVER_NEIGHBOURS * middle)
}

/// Whether in enough parts of the record next to nothing moves at the tone's frequency, or hardly beside it.
fn is_there_at_rest(samples: &Samples, motion: &[f64], wave: &[f64], hz: f64) -> bool {
    let line = 1.0 / samples.longest_segment();
    let part = wave.len().div_ceil(PARTS).max(1);
    let quiet = wave.chunks(part).enumerate().filter(|(i, wave)| {
        let rows = i * part..i * part + wave.len();
        // Segment by segment, whose phases need not agree.
        let pieces: Vec<Range<usize>> = samples
            .segments
            .iter()
            .map(|s| s.start.max(rows.start)..s.end.min(rows.end))
            .filter(|piece| !piece.is_empty())
            .collect();
        let of = |hz: f64| pieces.iter().map(|s| explained(samples, std::slice::from_ref(s), motion, hz)).sum();
        let moved = [hz - line, hz, hz + line].map(of).into_iter().fold(0.0, f64::max);
        wave.iter().map(|w| w * w).sum::<f64>() > MINOR_SHARE * moved
    });
    quiet.count() >= QUIET_PARTS
}

/// Whether it is a harmonic of the line that the motion has most of.
fn is_harmonic(samples: &Samples, motion: &[f64], hz: f64) -> bool {
    let line = 1.0 / samples.longest_segment();
    let Some(first) = strongest(samples, motion).filter(|first| *first > line) else { return false };
    let order = (hz / first).round();
    (1.0..=HARMONICS).contains(&order) && (hz - order * first).abs() < 1.5 * line && first > 4.0 * line
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of a millisecond.
    fn samples(rows: usize) -> Samples {
        Samples::of_columns(1e-3, vec![0.0; rows], vec![0.0; rows])
    }

    fn sine(samples: &Samples, hz: f64) -> Vec<f64> {
        samples.time.iter().map(|t| (std::f64::consts::TAU * hz * t).sin()).collect()
    }

    #[test]
    fn what_comes_and_goes_is_not_there_throughout() {
        let s = samples(16_000);
        let wave = sine(&s, 50.0);
        assert!(is_there_throughout(&vec![0.0; s.len()], &wave));
        // A line that only a third of the record shows is taken for a third of its height all the time.
        let whole: Vec<f64> = wave.iter().map(|w| w / 3.0).collect();
        let left: Vec<f64> =
            wave.iter().enumerate().map(|(k, w)| if k < 5_333 { 2.0 * w / 3.0 } else { -w / 3.0 }).collect();
        assert!(!is_there_throughout(&left, &whole));
    }

    #[test]
    fn a_line_of_a_crowd_does_not_stand_out() {
        let s = samples(16_000);
        let power = 8_000.0;
        assert!(stands_out(&s, &vec![0.0; s.len()], 50.0, power));
        // A sweep leaves as much beside it.
        let sweep: Vec<f64> = s.time.iter().map(|t| (std::f64::consts::TAU * (40.0 + 0.6 * t) * t).sin()).collect();
        let beside = explained(&s, &s.segments, &sweep, 50.0);
        assert!(!stands_out(&s, &sweep, 50.0, 3.0 * beside));
    }

    #[test]
    fn harmonics_are_those_of_the_strongest_line() {
        let s = samples(16_000);
        let motion = sine(&s, 7.0);
        assert!(is_harmonic(&s, &motion, 14.0) && is_harmonic(&s, &motion, 35.02));
        assert!(!is_harmonic(&s, &motion, 47.0));
    }

    #[test]
    fn a_line_that_moves_all_the_time_is_no_tone_however_its_phase_goes() {
        let mut s = samples(16_000);
        s.segments = vec![0..9_000, 9_000..16_000];
        let wave: Vec<f64> = sine(&s, 50.0).iter().map(|w| 0.1 * w).collect();
        let mut motion = sine(&s, 50.0);
        motion[9_000..].iter_mut().for_each(|y| *y = -*y);
        assert!(!is_there_at_rest(&s, &motion, &wave, 50.0));
        motion[..9_000].fill(0.0);
        assert!(is_there_at_rest(&s, &motion, &wave, 50.0));
    }
}
