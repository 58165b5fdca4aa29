//! Spikes: rows in which the sensor briefly shows an impossible value.
//!
//! A spike deviates from the median of its neighbours, and from the straight lines through the rows before and after
//! them, by much more than the usual step from row to row. It also deviates by more than the drive explains: by more
//! than the second difference of the drive shortly before, and by more than the output moves with a step of the drive.
//! Turns, kinks, ringing, and jumps that persist are not spikes.

use std::ops::Range;

use crate::record::Record;
use crate::statistics::{quantile, range};

/// Rows on each side of the median with which a row is compared. Spikes of up to three rows deviate from it, rising or
/// falling outputs do not.
const MEDIAN_ROWS: usize = 3;
/// Rows beyond these on each side, for a line that predicts the row. At a kink or a jump, one of the two lines predicts
/// the row. At a spike, neither does.
const LINE_ROWS: usize = 6;
/// Rows on each side whose steps determine the usual step.
const STEP_ROWS: usize = 32;
/// Rows before a spike in which a step of the drive may have caused it.
const DRIVE_ROWS: usize = 64;
/// Quantile of the steps that is the usual step. Steps into and out of spikes are above it.
const STEP_QUANTILE: f64 = 0.7;
/// Smallest deviation of a spike, as a multiple of the usual step and of the resolution. In white noise this is seven
/// standard deviations.
const MIN_STEPS: f64 = 5.0;
/// Smallest ratio of the deviation to the largest second difference of the drive, each relative to its own span. A
/// drive without sudden changes of slope cannot cause a spike.
const MIN_DRIVE_RATIO: f64 = 2.0;
/// Smallest ratio of the deviation to the largest step of the drive, each relative to its own span. A misfit changes
/// less from row to row than the output does.
const MIN_MISFIT_RATIO: f64 = 1.0;
/// Share of the rows at either end of the output's range that does not count for its span.
const OUTER_SHARE: f64 = 0.005;
/// Largest share of rows with spikes. With more, the deviations are a property of the output.
const MAX_SHARE: f64 = 0.1;

/// A row in which the sensor shows an impossible value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spike {
    /// The row, counted from 0.
    pub row: usize,
    /// The deviation from the neighbouring rows, as a multiple of the span of the output without spikes.
    pub spans: f64,
}

/// Finds the spikes of the output of a record, the largest first; none without an input.
pub fn spikes_of(record: &Record) -> Vec<Spike> {
    let Some(y) = record.output().filter(|y| y.len() == record.input().len()) else { return Vec::new() };
    let marked = spiked_rows(record.input(), y, record.segments());
    let (low, high) = range((0..y.len()).filter(|k| !marked[*k]).map(|k| y[k]));
    let off = |row: usize| {
        let mut beside = y[row.saturating_sub(MEDIAN_ROWS)..(row + MEDIAN_ROWS + 1).min(y.len())].to_vec();
        (y[row] - quantile(&mut beside, 0.5)).abs() / (high - low).max(f64::MIN_POSITIVE)
    };
    let mut found: Vec<Spike> = (0..y.len()).filter(|k| marked[*k]).map(|row| Spike { row, spans: off(row) }).collect();
    found.sort_by(|a, b| b.spans.total_cmp(&a.spans));
    found
}

/// Marks the spikes of an output.
pub(crate) fn spiked_rows(input: &[f64], output: &[f64], segments: &[Range<usize>]) -> Vec<bool> {
    spikes(input, output, output, 0.0, segments)
}

/// Marks the spikes of an output that the `residual` of a fit shows.
pub(crate) fn spiked_residual(input: &[f64], output: &[f64], residual: &[f64], segments: &[Range<usize>]) -> Vec<bool> {
    // A spike within the noise of the rest of the record does no harm. If a fit has nearly as many unknowns as rows,
    // its residual is far below the noise.
    let mut steps: Vec<f64> = segments.iter().flat_map(|s| step_sizes(&residual[s.clone()])).collect();
    spikes(input, output, residual, quantile(&mut steps, STEP_QUANTILE), segments)
}

fn step_sizes(signal: &[f64]) -> impl Iterator<Item = f64> {
    signal.windows(2).map(|y| (y[1] - y[0]).abs())
}

/// Marks the spikes of `signal`, an output or its residual, whose usual step is at least `usual`.
fn spikes(input: &[f64], output: &[f64], signal: &[f64], usual: f64, segments: &[Range<usize>]) -> Vec<bool> {
    let mut spiked = vec![false; output.len()];
    let digit = crate::noise::quantisation(output) * 12f64.sqrt();
    let span = |x: &[f64]| {
        let (low, high) = range(x.iter().copied());
        (high - low).max(f64::MIN_POSITIVE)
    };
    // The outermost rows are left out, because a spike itself widens the span of the output.
    let inner = {
        let mut sorted = output.to_vec();
        let mut at = |share: f64| quantile(&mut sorted, share);
        at(1.0 - OUTER_SHARE) - at(OUTER_SHARE)
    };
    let per_input = if inner > 0.0 { inner } else { span(output) } / span(input);
    let (mut beside, mut steps) = (Vec::new(), Vec::new());
    let usual = usual.max(digit);
    for s in segments {
        // At the ends of a segment a row has neighbours on one side only.
        for k in s.start + MEDIAN_ROWS..s.end.saturating_sub(MEDIAN_ROWS).max(s.start + MEDIAN_ROWS) {
            let own = signal[k];
            beside.clear();
            beside.extend_from_slice(&signal[k - MEDIAN_ROWS..=k + MEDIAN_ROWS]);
            let out = (own - quantile(&mut beside, 0.5)).abs();
            if out <= MIN_STEPS * usual {
                continue;
            }
            let before = &input[k.saturating_sub(DRIVE_ROWS).max(s.start)..=k + MEDIAN_ROWS];
            let turned = before.windows(3).fold(0.0, |m: f64, u| m.max((u[2] - 2.0 * u[1] + u[0]).abs()));
            let moved = before.windows(2).fold(0.0, |m: f64, u| m.max((u[1] - u[0]).abs()));
            if out <= per_input * (MIN_DRIVE_RATIO * turned).max(MIN_MISFIT_RATIO * moved) {
                continue;
            }
            let before = s.start.max(k.saturating_sub(MEDIAN_ROWS + LINE_ROWS))..k - MEDIAN_ROWS;
            let after = k + MEDIAN_ROWS + 1..s.end.min(k + MEDIAN_ROWS + LINE_ROWS + 1);
            let off_lines = [before, after].map(|rows| off_line(signal, rows, k));
            let out = off_lines.into_iter().fold(out, f64::min);
            steps.clear();
            steps.extend(step_sizes(&signal[k.saturating_sub(STEP_ROWS).max(s.start)..(k + STEP_ROWS + 1).min(s.end)]));
            spiked[k] = out > MIN_STEPS * quantile(&mut steps, STEP_QUANTILE);
        }
    }
    if spiked.iter().filter(|s| **s).count() as f64 > MAX_SHARE * output.len() as f64 {
        spiked.fill(false);
    }
    spiked
}

/// Distance of row `k` from the least-squares line through `rows`; zero for fewer than three rows.
fn off_line(signal: &[f64], rows: Range<usize>, k: usize) -> f64 {
    let n = rows.len() as f64;
    if rows.len() < 3 {
        return 0.0;
    }
    let middle = (rows.start + rows.end - 1) as f64 / 2.0;
    let mean = signal[rows.clone()].iter().sum::<f64>() / n;
    let (mut rise, mut run) = (0.0, 0.0);
    for i in rows {
        let x = i as f64 - middle;
        rise += x * signal[i];
        run += x * x;
    }
    (signal[k] - mean - rise / run * (k as f64 - middle)).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    /// Returns the rows of an output that are marked as spikes. The drive is the smooth part of the output.
    fn found(rows: usize, drive: impl Fn(f64) -> f64, add: impl Fn(usize) -> f64) -> Vec<usize> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut noise = || 1e-3 * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
        let input: Vec<f64> = (0..rows).map(|k| 100.0 * drive(k as f64)).collect();
        let output: Vec<f64> = (0..rows).map(|k| drive((k as f64 - 4.0).max(0.0)) + noise() + add(k)).collect();
        let marked = spiked_rows(&input, &output, &[Range { start: 0, end: rows }]);
        (0..rows).filter(|k| marked[*k]).collect()
    }

    /// One segment of all rows.
    fn whole(output: &[f64]) -> [Range<usize>; 1] {
        [Range { start: 0, end: output.len() }]
    }

    fn triangle(t: f64) -> f64 {
        let share = (t / 200.0).fract();
        2.0 * share.min(1.0 - share)
    }

    #[test]
    fn spikes_are_found_in_their_rows() {
        let at = |k: usize| k % 20 == 7;
        let found = found(4000, |t| (0.01 * t).sin(), |k| if at(k) { 0.3 } else { 0.0 });
        assert_eq!(found, (0..4000).filter(|k| at(*k)).collect::<Vec<_>>());
    }

    #[test]
    fn turns_jumps_and_ringing_are_not_spikes() {
        assert!(found(4000, triangle, |_| 0.0).is_empty());
        assert!(found(4000, |t| (0.01 * t).sin(), |k| if k > 1500 { 0.3 } else { 0.0 }).is_empty());
        let steps = |t: f64| (t / 100.0).floor() / 40.0;
        assert!(found(4000, steps, |k| 0.02 * (-((k % 100) as f64) / 20.0).exp() * (k as f64).sin()).is_empty());
    }

    /// The spike is three rows wide, and the drive moves the output further than that within a row. The spike is not
    /// visible in the output alone, but it is visible in the residual of a model.
    #[test]
    fn a_residual_shows_a_spike_that_the_drive_hides() {
        let rows = 1400;
        let input: Vec<f64> = (0..rows).map(|k| 50.0 * (1.0 - (0.0314 * k as f64).cos())).collect();
        let at = |k: usize| (650..653).contains(&k);
        let residual: Vec<f64> =
            (0..rows).map(|k| 0.01 * (2.0 * k as f64).sin() + if at(k) { 0.6 } else { 0.0 }).collect();
        let output: Vec<f64> = input.iter().zip(&residual).map(|(u, r)| 0.1 * u + r).collect();
        assert!(!spiked_rows(&input, &output, &whole(&output)).contains(&true));
        let found = spiked_residual(&input, &output, &residual, &whole(&output));
        assert!((0..rows).all(|k| found[k] == at(k)));
    }

    /// The drive moves far from row to row, but without sudden changes of slope. It does not hide the spike.
    #[test]
    fn a_smooth_drive_does_not_hide_a_spike_of_the_residual() {
        let input: Vec<f64> = (0..2000).map(|k| 5.0 * (1.0 - (0.0251 * f64::from(k)).cos())).collect();
        let residual: Vec<f64> =
            (0..2000).map(|k| 0.01 * (2.0 * f64::from(k)).sin() + if k == 700 { 0.6 } else { 0.0 }).collect();
        let output: Vec<f64> = input.iter().zip(&residual).map(|(u, r)| 3.0 * u + r).collect();
        let found = spiked_residual(&input, &output, &residual, &whole(&output));
        assert!((0..2000).all(|k| found[k] == (k == 700)));
    }

    /// The residual of a model without a stop: it has a kink in each period, whose middle row is not a spike.
    #[test]
    fn a_kink_of_a_residual_is_not_a_spike() {
        let rows = 2000;
        let input: Vec<f64> = (0..rows).map(|k| 50.0 * (1.0 - (0.0314 * f64::from(k)).cos())).collect();
        let peak = |k: i32| 0.02 * f64::from((10 - (k % 100 - 50).abs()).max(0));
        let residual: Vec<f64> = (0..rows).map(|k| 1e-4 * (2.0 * f64::from(k)).sin() + peak(k)).collect();
        let output: Vec<f64> = input.iter().zip(&residual).map(|(u, r)| 0.1 * u + r).collect();
        assert!(!spiked_residual(&input, &output, &residual, &whole(&output)).contains(&true));
    }

    #[test]
    fn noise_alone_has_no_spikes() {
        assert!(found(40_000, |_| 0.0, |_| 0.0).is_empty());
    }
}
