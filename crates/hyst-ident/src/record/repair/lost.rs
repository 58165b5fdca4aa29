//! Rows that are missing in the time grid.

use std::ops::Range;

use super::missing::{MAX_INTERPOLATED_ROWS, MAX_MISSING_SHARE};
use super::rows::{Repaired, channels, rows_word};
use super::steps::{MAX_GAP_SHARE, usual_step};
use crate::record::assembly::Columns;

/// Largest deviation of a step around lost rows from a multiple of the usual step \[periods\].
const MAX_OFF_GRID: f64 = 0.3;
/// Largest deviation of any step from a multiple of the usual step on a clear grid \[periods\].
const MAX_OFF_CLEAR_GRID: f64 = 0.1;

/// Inserts lost rows without values if only a few in sequence are lost. Returns whether there were any.
pub(super) fn insert_lost(samples: &mut Columns, done: &mut Repaired, segments: &[Range<usize>]) -> bool {
    let rows = samples.time.len();
    // The number of rows to insert before each row.
    let mut lost = vec![0; rows];
    // On a clear grid every step is a multiple of the usual one. Then many rows may be lost.
    let mut is_clear = true;
    for rows in segments.iter().filter(|rows| rows.len() > 2) {
        let usual = usual_step(&samples.time[rows.clone()]);
        for (row, lost) in lost.iter_mut().enumerate().take(rows.end).skip(rows.start + 1) {
            let steps = (samples.time[row] - samples.time[row - 1]) / usual;
            let whole = steps.round();
            is_clear &= whole >= 1.0 && (steps - whole).abs() < MAX_OFF_CLEAR_GRID;
            if whole >= 2.0 && whole <= MAX_INTERPOLATED_ROWS as f64 + 1.0 && (steps - whole).abs() < MAX_OFF_GRID {
                *lost = whole as usize - 1;
            }
        }
    }
    let gaps = lost.iter().filter(|lost| **lost > 0).count();
    let count: usize = lost.iter().sum();
    let share = if is_clear { MAX_MISSING_SHARE } else { MAX_GAP_SHARE };
    if count == 0 || gaps as f64 > (share * rows as f64).max(1.0) {
        return false;
    }
    let times: Vec<f64> = (0..rows)
        .flat_map(|row| {
            let (end, n) = (samples.time[row], lost[row]);
            let start = if n > 0 { samples.time[row - 1] } else { end };
            (1..=n).map(move |k| start + (end - start) * k as f64 / (n + 1) as f64).chain([end])
        })
        .collect();
    fn insert<T: Copy>(values: &mut Vec<T>, lost: &[usize], with: impl Fn(usize, T) -> T) {
        let repeated = |(row, value): (usize, &T)| {
            std::iter::repeat_n(with(row, *value), lost[row]).chain([*value]).collect::<Vec<T>>()
        };
        *values = values.iter().enumerate().flat_map(repeated).collect();
    }
    samples.time = times;
    if samples.output.is_some() && done.missing.is_empty() {
        done.missing = vec![false; rows];
    }
    insert(&mut done.missing, &lost, |_, _| true);
    channels(samples).for_each(|values| insert(values, &lost, |_, _| f64::NAN));
    samples.segment.iter_mut().for_each(|labels| insert(labels, &lost, |_, label| label));
    let mut own = done.rows.take().unwrap_or_else(|| (0..rows).collect());
    insert(&mut own, &lost, |_, row| row);
    done.rows = Some(own);
    done.note(format!(
        "{} missing in the time grid: inserted with an interpolated input; the output is not fitted",
        rows_word(count)
    ));
    true
}
