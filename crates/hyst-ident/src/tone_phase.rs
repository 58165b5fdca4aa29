//! The phase of a tone in a record with a clock of its own.
//!
//! A model holds a tone on the clock of the record that it was fitted to. Mains do not keep that phase until another record is made, and a clock that
//! is started anew does not know it. The phase with which a record begins is an initial condition, as the memory of the hysteresis is: where the first rows
//! show the tone with another phase, it is taken from them, and all later rows are predicted with it.

use std::f64::consts::TAU;
use std::ops::Range;

use hyst_core::InterferenceParams;
use nalgebra::{Matrix3, Vector3};

use crate::Samples;

/// Share of a file's rows that its beginning is.
const BEGINNING: usize = 10;
/// Periods of the tone that a beginning has, where the file is long enough, and at least.
const USUAL_PERIODS: f64 = 20.0;
const LEAST_PERIODS: f64 = 4.0;
/// Amplitude that the first rows show over that of the model, for which they show its tone.
const SAME_TONE: Range<f64> = 0.5..2.0;
/// Phase \[rad\] by which they have to contradict the model: what a smaller one leaves is less than a third of the tone.
const CONTRADICTS: f64 = 0.3;

/// Angle \[rad\] by which the tone of each file is ahead of that of a model; zero where the model's clock goes on, or where the first rows do not show it.
/// `residual` is what the model with the tone leaves; rows that are `settling` do not count.
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
        let wanted = (rows.len() / BEGINNING).max((USUAL_PERIODS * period).ceil() as usize);
        let begins = segment.clone().find(|k| !settling[*k])?;
        let beginning = begins..segment.end.min(begins + wanted);
        if (beginning.len() as f64) < LEAST_PERIODS * period {
            return None;
        }
        let (amplitude, phase) = shown(samples, tone, residual, beginning)?;
        let ahead = (phase - tone.phase + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
        (SAME_TONE.contains(&(amplitude / tone.amplitude)) && ahead.abs() > CONTRADICTS).then_some(ahead)
    };
    files.iter().map(|rows| of_file(rows).unwrap_or(0.0)).collect()
}

/// Amplitude and phase \[rad\] of the fundamental over some rows of what the model without its tone leaves, beside a constant; under a Hann window, so that
/// what is slow does not count.
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

/// What a tone adds more where it is ahead by these angles, per row.
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
    fn the_first_rows_say_with_which_phase_a_record_begins() {
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
            let expected = if size < 0.5 || f64::abs(turned) < CONTRADICTS { 0.0 } else { turned };
            assert!((found[0] - expected).abs() < 0.02, "{turned} {size}: {found:?}");
            let change = change(&samples, &tone, &found, &files);
            let left = residual.iter().zip(&change).zip(&samples.time).map(|((r, c), t)| r - c - slow(*t));
            let most = left.fold(0.0, |most: f64, r| most.max(r.abs()));
            assert!(expected == 0.0 || most < 0.25 * tone.amplitude, "{turned} {size}: {most}");
        }
    }
}
