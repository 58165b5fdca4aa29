//! Rows with the time of the row before.

use super::rows::{Repaired, channels, keep, rows_word};
use crate::record::assembly::Columns;

/// Largest share of differing rows with equal times that are joined. A larger share means that the times are printed
/// too coarsely.
const MAX_JOINED_SHARE: f64 = 0.02;

/// Joins rows with the same time. Their values are averaged.
pub(super) fn join_repeated(samples: &mut Columns, done: &mut Repaired) {
    let rows = samples.time.len();
    if samples.time.windows(2).all(|t| t[0] != t[1]) {
        return;
    }
    let label = |row: usize| samples.segment.as_ref().map(|labels| labels[row]);
    let repeats = |row: usize| row > 0 && samples.time[row] == samples.time[row - 1] && label(row) == label(row - 1);
    let repeated: Vec<bool> = (0..rows).map(repeats).collect();
    let count = repeated.iter().filter(|repeated| **repeated).count();
    // Times that are printed too coarsely repeat in many rows. These rows are different samples.
    let values: Vec<Vec<f64>> = channels(samples).map(|values| values.clone()).collect();
    let differs = |row: usize| values.iter().any(|v| v[row].to_bits() != v[row - 1].to_bits());
    let differing = (1..rows).filter(|row| repeated[*row] && differs(*row)).count();
    if count == 0 || differing as f64 > MAX_JOINED_SHARE * rows as f64 {
        return;
    }
    for values in channels(samples) {
        let mut first = 0;
        for row in 1..rows {
            if !repeated[row] {
                first = row;
            } else if values[row].is_finite() && values[row] != values[first] {
                let so_far = (row - first) as f64;
                values[first] = if values[first].is_finite() {
                    (values[first] * so_far + values[row]) / (so_far + 1.0)
                } else {
                    values[row]
                };
            }
        }
    }
    let kept: Vec<bool> = repeated.iter().map(|repeated| !repeated).collect();
    let at = (0..rows).find(|row| repeated[*row]).map_or(0, |row| done.row(row) + 1);
    let how = match differing {
        0 => "with the same values".to_owned(),
        more => format!("{more} with other values, which are averaged"),
    };
    keep(samples, done, &kept);
    done.note(format!("{} with the time of the row before ({how}; the first is row {at}): joined", rows_word(count)));
}
