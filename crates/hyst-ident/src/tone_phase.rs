//! Phase of a tone in a record with its own clock.
//!
//! A model stores a tone relative to the clock of the record that it was fitted to. The mains do not keep this phase
//! until the next record, and a restarted clock does not know it. The phase at the start of a record is an initial
//! condition, like the memory of the hysteresis. If the first rows show the tone with another phase, the phase is
//! estimated from them, and all later rows are predicted with it.

use std::f64::consts::TAU;
use std::ops::Range;

use hyst_core::InterferenceParams;
use nalgebra::{Matrix3, Vector3};

use crate::Samples;

/// The start of a file is this fraction (divisor) of its rows.
const BEGINNING_DIVISOR: usize = 10;
/// Number of periods of the tone in the start of a file, if the file is long enough, and the minimum.
const USUAL_PERIODS: f64 = 20.0;
const MIN_PERIODS: f64 = 4.0;
/// Ratio of the amplitude in the first rows to that of the model, within which they show the model's tone.
const AMPLITUDE_RATIO: Range<f64> = 0.5..2.0;
/// Minimum phase difference \[rad\] that is corrected; a smaller one leaves less than a third of the tone.
const MIN_PHASE_DIFFERENCE: f64 = 0.3;

/// Returns the phase lead \[rad\] of the tone in each file relative to the model's; zero if the model's clock continues
/// or the first rows do not show the tone. `residual` is that of the model with its tone; `settling` rows do not count.
pub(crate) fn ahead(
    samples: &Samples,
    tone: &InterferenceParams,
    residual: &[f64],
    settling: &[bool],
    files: &[Range<usize>],
) -> Vec<f64> {
    let of_file = |rows: &Range<usize>| -> Option<f64> {
        let first = samples.segments.iter().position(|s| s.start == rows.start)?;
        let segment = samples.segments[first].clone();
        let period = 1.0 / (tone.hz * samples.period_of(first));
        let wanted = (rows.len() / BEGINNING_DIVISOR).max((USUAL_PERIODS * period).ceil() as usize);
        let begins = segment.clone().find(|k| !settling[*k])?;
        let beginning = begins..segment.end.min(begins + wanted);
        if (beginning.len() as f64) < MIN_PERIODS * period {
            return None;
        }
        let (amplitude, phase) = shown(samples, tone, residual, beginning)?;
        let ahead = (phase - tone.phase + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
        (AMPLITUDE_RATIO.contains(&(amplitude / tone.amplitude)) && ahead.abs() > MIN_PHASE_DIFFERENCE).then_some(ahead)
    };
    files.iter().map(|rows| of_file(rows).unwrap_or(0.0)).collect()
}

/// Estimates amplitude and phase \[rad\] of the fundamental over some rows, from the residual of the model without its
/// tone, next to a constant. A Hann window suppresses slow parts.
fn shown(samples: &Samples, tone: &InterferenceParams, residual: &[f64], rows: Range<usize>) -> Option<(f64, f64)> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let length = rows.len() as f64;
    for (i, k) in rows.enumerate() {
        let window = (0.5 * TAU * (i as f64 + 0.5) / length).sin().powi(2);
        let angle = TAU * (tone.hz * samples.time[k]).fract();
        let column = Vector3::new(1.0, angle.sin(), angle.cos());
        normal += window * column * column.transpose();
        right += window * (residual[k] + tone.at(samples.time[k])) * column;
    }
    let found = normal.cholesky()?.solve(&right);
    // A sin(ωt + φ) = A cos φ sin ωt + A sin φ cos ωt
    Some((found[1].hypot(found[2]), found[2].atan2(found[1])))
}

/// Returns the change of the tone by these phase leads, per row.
pub(crate) fn change(samples: &Samples, tone: &InterferenceParams, ahead: &[f64], files: &[Range<usize>]) -> Vec<f64> {
    let mut change = vec![0.0; samples.len()];
    for (rows, ahead) in files.iter().zip(ahead).filter(|(_, ahead)| **ahead != 0.0) {
        for k in rows.clone() {
            let angle = TAU * (tone.hz * samples.time[k]).fract();
            change[k] = tone.at_angle(angle + ahead) - tone.at_angle(angle);
        }
    }
    change
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_of_a_tone_is_estimated_from_the_first_rows() {
        let tone = InterferenceParams {
            hz: 50.0,
            amplitude: 0.4,
            phase: 2.9,
            harmonics: [0.05, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0],
        };
        let samples = Samples::of_columns(1e-3, vec![0.0; 4000], vec![0.0; 4000]);
        let (files, settling) = (samples.segments.clone(), vec![false; 4000]);
        let slow = |t: f64| 0.5 + 0.3 * (3.0 * t).sin();
        for (turned, size) in [(0.0, 1.0), (1.1, 1.0), (-2.6, 1.2), (0.1, 1.0), (1.1, 0.3), (1.1, 0.0)] {
            let residual: Vec<f64> = samples
                .time
                .iter()
                .map(|t| slow(*t) + size * tone.at_angle(TAU * 50.0 * t + turned) - tone.at(*t))
                .collect();
            let found = ahead(&samples, &tone, &residual, &settling, &files);
            let expected = if size < 0.5 || f64::abs(turned) < MIN_PHASE_DIFFERENCE { 0.0 } else { turned };
            assert!((found[0] - expected).abs() < 0.02, "{turned} {size}: {found:?}");
            let change = change(&samples, &tone, &found, &files);
            let left = residual.iter().zip(&change).zip(&samples.time).map(|((r, c), t)| r - c - slow(*t));
            let most = left.fold(0.0, |most: f64, r| most.max(r.abs()));
            assert!(expected == 0.0 || most < 0.25 * tone.amplitude, "{turned} {size}: {most}");
        }
    }
}
