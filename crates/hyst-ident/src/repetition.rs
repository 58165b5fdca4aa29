//! Records that repeat one loop.
//!
//! Whatever answers such a drive, late, bent or ringing, gives one closed loop again, and a hysteresis of the right shape gives the same
//! one. Only a second frequency or amplitude tells them apart.

use crate::Samples;

/// A turn counts from this share of the drive's range on.
const TURN: f64 = 0.05;
/// Turns lie this near to each other, as a share of the range, and are this regular, as a share of the period.
const SAME: f64 = 0.03;
/// Share of the turns that has to be so.
const NEARLY_ALL: f64 = 0.95;
/// Turns that make a repetition.
const LEAST: usize = 6;

/// Frequency \[Hz\] of the one loop that a record repeats; `None` if its drive does more than that.
pub(crate) fn only_loop(samples: &Samples) -> Option<f64> {
    let (low, high) = samples.input_range();
    let range = high - low;
    let (mut tops, mut bottoms, mut periods) = (Vec::new(), Vec::new(), Vec::new());
    for (i, segment) in samples.segments.iter().enumerate() {
        let turns = turns(&samples.input[segment.clone()], TURN * range);
        // From rest and to rest is not the loop's.
        let inner = turns.get(1..turns.len().saturating_sub(1)).unwrap_or_default();
        for (row, top) in inner {
            let u = samples.input[segment.start + row];
            if *top { tops.push(u) } else { bottoms.push(u) }
        }
        periods.extend(inner.windows(3).map(|w| (w[2].0 - w[0].0) as f64 * samples.period_of(i) / samples.period));
    }
    let count = periods.len();
    if count < LEAST {
        return None;
    }
    let (top, bottom, period) = (median(&tops)?, median(&bottoms)?, median(&periods)?);
    let near = |values: &[f64], middle: f64, tolerance: f64| {
        let same = values.iter().filter(|x| (*x - middle).abs() <= tolerance).count();
        same as f64 >= NEARLY_ALL * values.len() as f64
    };
    // A turn is found to within a few rows where the drive is noisy.
    let regular = near(&periods, period, SAME * period + 4.0);
    (regular && near(&tops, top, SAME * range) && near(&bottoms, bottom, SAME * range))
        .then(|| 1.0 / (period * samples.period))
}

/// Rows at which a drive turns by at least `least`, and whether from a top.
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
    fn other_amplitudes_frequencies_and_holds_are_more_than_a_loop() {
        let wave = |t: f64| 1.0 - (std::f64::consts::TAU * 7.0 * t).cos();
        assert_eq!(only_loop(&samples(|t| wave(t) * (1.0 - 0.1 * t))), None);
        assert_eq!(only_loop(&samples(|t| wave(if t < 2.5 { t } else { 2.0 * t }))), None);
        assert_eq!(only_loop(&samples(|t| (3.0 * t).floor())), None);
    }
}
