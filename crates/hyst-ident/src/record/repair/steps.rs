//! The steps of the times: even, uneven, interrupted, or irregular.

use std::ops::Range;

use crate::record::assembly::{Columns, split};
use crate::record::grid::{self, Fault, Period, Printed};

/// Shortest time step of an interruption, as a multiple of the usual step.
pub(super) const MIN_GAP: f64 = 1.5;
/// Largest share of steps outside 0.5 to 1.5 of the usual step. With more, the times are not resampled.
const MAX_IRREGULAR_SHARE: f64 = 0.02;
/// Largest share of long steps that count as interruptions. With more, the clock itself is uneven.
pub(super) const MAX_GAP_SHARE: f64 = 0.05;

/// The kind of time column.
pub(super) enum Times {
    /// Even steps in each segment.
    Even(Vec<Period>),
    /// Increasing times in these segments, with uneven steps.
    Uneven(Vec<Range<usize>>),
    /// Other times, which later checks refuse.
    Unsorted,
}

impl Times {
    pub(super) fn of(samples: &Columns, printed: Printed) -> Self {
        let time = samples.time.as_slice();
        if time.len() < 2 || time.windows(2).any(|t| t[1] <= t[0]) {
            return Self::Unsorted;
        }
        let segments = match &samples.segment {
            None => std::iter::once(0..time.len()).collect(),
            Some(labels) => match split(labels) {
                Ok((_, segments)) => segments,
                Err(_) => return Self::Unsorted,
            },
        };
        match grid::fit(time, &segments, printed) {
            Ok(periods) => Self::Even(periods),
            Err(Fault::Uneven { .. }) => Self::Uneven(segments),
            Err(Fault::TooShort) => Self::Unsorted,
        }
    }
}

/// Returns the median step of increasing times \[s\].
pub(super) fn usual_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|t| t[1] - t[0]).collect();
    let middle = (steps.len() - 1) / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Splits a segment at its interruptions and appends their lengths \[s\] to `gaps`.
pub(super) fn split_at_gaps(time: &[f64], rows: Range<usize>, gaps: &mut Vec<f64>) -> Vec<Range<usize>> {
    if rows.len() < 3 {
        return vec![rows];
    }
    let usual = usual_step(&time[rows.clone()]);
    let is_gap = |row: &usize| time[*row] - time[*row - 1] > MIN_GAP * usual;
    let starts: Vec<usize> = (rows.start + 1..rows.end).filter(is_gap).collect();
    if starts.len() as f64 > (MAX_GAP_SHARE * rows.len() as f64).max(1.0) {
        return vec![rows];
    }
    gaps.extend(starts.iter().map(|row| time[*row] - time[*row - 1]));
    let ends = starts.iter().copied().chain([rows.end]);
    std::iter::once(rows.start).chain(starts.iter().copied()).zip(ends).map(|(start, end)| start..end).collect()
}

/// Returns whether too many steps are far from the usual step.
pub(super) fn is_irregular(time: &[f64]) -> bool {
    if time.len() < 3 {
        return false;
    }
    let usual = usual_step(time);
    let off = time.windows(2).filter(|t| !(0.5 * usual..=MIN_GAP * usual).contains(&(t[1] - t[0]))).count();
    off as f64 > (MAX_IRREGULAR_SHARE * time.len() as f64).max(1.0)
}
