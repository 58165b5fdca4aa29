//! Records whose drive repeats a single loop.
//!
//! Delay, asymmetry or resonance answer such a drive with one closed loop, and a hysteresis of suitable shape gives the
//! same loop. Only a second frequency or amplitude distinguishes them.

use crate::Samples;

/// Smallest change of the drive between two turns, as a share of its range.
const MIN_TURN: f64 = 0.05;
/// Tolerance of equal turns, as a share of the range, and of equal periods, as a share of the period.
const TOLERANCE: f64 = 0.03;
/// Smallest share of turns and periods within the tolerance.
const MIN_EQUAL_SHARE: f64 = 0.95;
/// Fewest periods of a repeated loop.
const MIN_PERIODS: usize = 6;

/// Returns the frequency \[Hz\] of the loop that a record repeats; `None` if the drive does more than repeat one loop.
pub(crate) fn only_loop(samples: &Samples) -> Option<f64> {
    let (low, high) = samples.input_range();
    let range = high - low;
    let (mut tops, mut bottoms, mut periods) = (Vec::new(), Vec::new(), Vec::new());
    for (i, segment) in samples.segments.iter().enumerate() {
        let turns = turns(&samples.input[segment.clone()], MIN_TURN * range);
        // The first and last turn belong to the way from rest and to rest.
        let inner = turns.get(1..turns.len().saturating_sub(1)).unwrap_or_default();
        for (row, top) in inner {
            let u = samples.input[segment.start + row];
            if *top { tops.push(u) } else { bottoms.push(u) }
        }
        periods.extend(inner.windows(3).map(|w| (w[2].0 - w[0].0) as f64 * samples.period_of(i) / samples.period));
    }
    let count = periods.len();
    if count < MIN_PERIODS {
        return None;
    }
    let (top, bottom, period) = (median(&tops)?, median(&bottoms)?, median(&periods)?);
    let near = |values: &[f64], middle: f64, tolerance: f64| {
        let same = values.iter().filter(|x| (*x - middle).abs() <= tolerance).count();
        same as f64 >= MIN_EQUAL_SHARE * values.len() as f64
    };
    // With a noisy drive the place of a turn has an error of a few rows.
    let regular = near(&periods, period, TOLERANCE * period + 4.0);
    (regular && near(&tops, top, TOLERANCE * range) && near(&bottoms, bottom, TOLERANCE * range))
        .then(|| 1.0 / (period * samples.period))
}

/// Returns the rows at which a drive turns by at least `least`; true for a maximum, false for a minimum.
pub(crate) fn turns(u: &[f64], least: f64) -> Vec<(usize, bool)> {
    let mut turns = Vec::new();
    let (mut top, mut bottom) = (0, 0);
    let mut rising = None;
    for k in 0..u.len() {
        if u[k] > u[top] {
            top = k;
        }
        if u[k] < u[bottom] {
            bottom = k;
        }
        if rising != Some(false) && u[top] - u[k] >= least {
            turns.push((top, true));
            (rising, bottom) = (Some(false), k);
        } else if rising != Some(true) && u[k] - u[bottom] >= least {
            turns.push((bottom, false));
            (rising, top) = (Some(true), k);
        }
    }
    turns
}

fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(drive: impl Fn(f64) -> f64) -> Samples {
        let input: Vec<f64> = (0..5000).map(|k| drive(f64::from(k) * 1e-3)).collect();
        let record = crate::record::Record::from_samples(crate::record::Columns {
            time: (0..5000).map(|k| f64::from(k) * 1e-3).collect(),
            input: Some(input),
            ..Default::default()
        });
        Samples::from_record(&record.unwrap())
    }

    #[test]
    fn one_tone_and_one_triangle_repeat_a_loop() {
        let wave = |t: f64| 50.0 * (1.0 - (std::f64::consts::TAU * 7.0 * t).cos());
        let found = only_loop(&samples(wave)).unwrap();
        assert!((found - 7.0).abs() < 0.05, "{found}");
        let noisy = |t: f64| wave(t) + 0.3 * (1e5 * t).sin();
        assert!(only_loop(&samples(noisy)).is_some());
        assert!(only_loop(&samples(|t| 100.0 * ((4.0 * t).fract() - 0.5).abs())).is_some());
    }

    #[test]
    fn other_amplitudes_frequencies_and_holds_are_not_a_single_loop() {
        let wave = |t: f64| 1.0 - (std::f64::consts::TAU * 7.0 * t).cos();
        assert_eq!(only_loop(&samples(|t| wave(t) * (1.0 - 0.1 * t))), None);
        assert_eq!(only_loop(&samples(|t| wave(if t < 2.5 { t } else { 2.0 * t }))), None);
        assert_eq!(only_loop(&samples(|t| (3.0 * t).floor())), None);
    }
}
