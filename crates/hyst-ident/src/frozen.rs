//! Rows in which the sensor is frozen: it repeats one value to the last digit, for example in a dropout (0 or a
//! full-scale code for some rows) or after a stopped data stream (the last value is repeated).
//!
//! An actuator at rest also repeats values, if the sensor noise is below its resolution. A run of equal values is
//! therefore frozen only with a jump before or after it that the drive does not explain. If the last digits change in
//! all other rows, a long run is frozen without a jump.

use std::ops::Range;

use crate::clipping::last_digits_move;
use crate::record::Record;
use crate::statistics::{quantile, range};

/// Fewest rows with one value. Shorter runs are spikes.
const MIN_ROWS: usize = 4;
/// Fewest rows of a run without a jump.
const MIN_ROWS_ALONE: usize = 10;
/// Quantile of the steps from row to row that is the usual step.
const STEP_QUANTILE: f64 = 0.99;
/// Smallest jump, as a multiple of the usual step and of the resolution of the sensor.
const MIN_STEPS: f64 = 5.0;
/// Smallest ratio of a jump to the largest step of the drive before it, each relative to its own span.
const MIN_DRIVE_RATIO: f64 = 2.0;
/// Rows before a jump in which a step of the drive may have caused it.
const DRIVE_ROWS: usize = 64;
/// Largest share of frozen rows. With more, the output itself has constant stretches.
const MAX_SHARE: f64 = 0.3;

/// A run of rows with one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frozen {
    /// The value \[output unit\].
    pub at: f64,
    /// The first row, counted from 0.
    pub first: usize,
    /// The number of rows.
    pub rows: usize,
}

/// Finds the frozen runs of the output of a record; none without an input.
pub fn frozen_of(record: &Record) -> Vec<Frozen> {
    let Some(y) = record.output().filter(|y| y.len() == record.input().len()) else { return Vec::new() };
    frozen(record.input(), y, record.segments())
}

/// Marks the rows in which an output is frozen.
pub(crate) fn frozen_rows(input: &[f64], output: &[f64], segments: &[Range<usize>]) -> Vec<bool> {
    let mut marked = vec![false; output.len()];
    for run in frozen(input, output, segments) {
        marked[run.first..run.first + run.rows].fill(true);
    }
    marked
}

fn frozen(input: &[f64], output: &[f64], segments: &[Range<usize>]) -> Vec<Frozen> {
    let runs: Vec<(Range<usize>, &Range<usize>)> =
        segments.iter().flat_map(|s| runs_in(output, s).map(move |run| (run, s))).collect();
    if runs.is_empty() {
        return Vec::new();
    }
    let mut steps: Vec<f64> =
        segments.iter().flat_map(|s| output[s.clone()].windows(2)).map(|y| (y[1] - y[0]).abs()).collect();
    let digit = crate::noise::quantisation(output) * 12f64.sqrt();
    let min_jump = MIN_STEPS * quantile(&mut steps, STEP_QUANTILE).max(digit);
    // The larger jump at the ends of a run.
    let jump = |run: &Range<usize>, s: &Range<usize>| {
        let before = if run.start > s.start { (output[run.start] - output[run.start - 1]).abs() } else { 0.0 };
        let after = if run.end < s.end { (output[run.end] - output[run.end - 1]).abs() } else { 0.0 };
        before.max(after)
    };
    let runs: Vec<(Range<usize>, &Range<usize>, f64)> =
        runs.into_iter().map(|(run, s)| (run.clone(), s, jump(&run, s))).collect();
    let mut repeats = vec![false; output.len()];
    runs.iter().for_each(|(run, _, _)| repeats[run.clone()].fill(true));
    let noisy = last_digits_move(output, segments, &repeats);
    // The span is computed without the runs with a jump, because a dropout enlarges it.
    let mut moves = vec![true; output.len()];
    runs.iter().filter(|(_, _, jump)| *jump > min_jump).for_each(|(run, _, _)| moves[run.clone()].fill(false));
    let span = |(low, high): (f64, f64)| (high - low).max(f64::MIN_POSITIVE);
    let per_input = MIN_DRIVE_RATIO * span(range((0..output.len()).filter(|row| moves[*row]).map(|row| output[row])))
        / span(range(input.iter().copied()));
    let explained = |run: &Range<usize>, s: &Range<usize>, jump: f64| {
        let near = run.start.saturating_sub(DRIVE_ROWS).max(s.start)..(run.end + 1).min(s.end);
        let driven = input[near].windows(2).fold(0.0, |most: f64, u| most.max((u[1] - u[0]).abs()));
        jump <= per_input * driven
    };
    // Runs at an end of the output range may be clipping, which is another fault.
    let (low, high) = range(output.iter().copied());
    let is_inside = |run: &Range<usize>| output[run.start] > low && output[run.start] < high;
    let alone = |run: &Range<usize>| noisy && run.len() >= MIN_ROWS_ALONE && is_inside(run);
    let found: Vec<Frozen> = runs
        .into_iter()
        .filter(|(run, s, jump)| alone(run) || *jump > min_jump && !explained(run, s, *jump))
        .map(|(run, _, _)| Frozen { at: output[run.start], first: run.start, rows: run.len() })
        .collect();
    let rows: usize = found.iter().map(|run| run.rows).sum();
    if rows as f64 > MAX_SHARE * output.len() as f64 { Vec::new() } else { found }
}

/// Returns the runs of at least [`MIN_ROWS`] equal values in a segment.
fn runs_in<'a>(output: &'a [f64], s: &Range<usize>) -> impl Iterator<Item = Range<usize>> + 'a {
    let mut end = s.start;
    output[s.clone()].chunk_by(|a, b| a == b).filter_map(move |run| {
        end += run.len();
        (run.len() >= MIN_ROWS).then(|| end - run.len()..end)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(k: usize) -> f64 {
        50.0 - 50.0 * (0.01 * k as f64).cos()
    }

    /// Returns the frozen runs of an output with noise that `change` has modified.
    fn found(drive: impl Fn(usize) -> f64, change: impl Fn(&mut [f64])) -> Vec<Frozen> {
        let input: Vec<f64> = (0..3000).map(drive).collect();
        let mut output: Vec<f64> =
            input.iter().enumerate().map(|(k, u)| 0.1 * u + 1e-3 * (1e4 * (k as f64).sqrt()).sin()).collect();
        change(&mut output);
        frozen(&input, &output, &[Range { start: 0, end: 3000 }])
    }

    #[test]
    fn a_dropout_and_a_stopped_stream_are_found() {
        let zeros = found(drive, |y| y[700..710].fill(0.0));
        assert_eq!(zeros, [Frozen { at: 0.0, first: 700, rows: 10 }]);
        let stopped = found(drive, |y| {
            let last = y[1399];
            y[1400..1480].fill(last);
        });
        // The run includes the row before, whose value is repeated.
        assert_eq!((stopped.len(), stopped[0].first, stopped[0].rows), (1, 1399, 81));
    }

    #[test]
    fn rests_steps_and_coarse_digits_are_not_frozen() {
        assert_eq!(found(drive, |_| {}), []);
        assert_eq!(found(drive, |y| y.iter_mut().for_each(|y| *y = (20.0 * *y).round() / 20.0)), []);
        // A staircase drive and an output without noise.
        assert_eq!(
            found(|k| 10.0 * (k / 300) as f64, |y| y.iter_mut().for_each(|y| *y = (10.0 * *y).round() / 10.0)),
            []
        );
        // A play operator is constant after each turn.
        assert_eq!(
            found(drive, |y| {
                let mut p = 0.0;
                for (k, y) in y.iter_mut().enumerate() {
                    p = hyst_core::play(p, drive(k), 20.0);
                    *y = p;
                }
            }),
            []
        );
    }

    #[test]
    fn a_clipped_peak_is_not_frozen() {
        assert_eq!(found(drive, |y| y.iter_mut().for_each(|y| *y = y.min(8.0))), []);
    }
}
