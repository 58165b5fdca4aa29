//! Missing values: omitted, interpolated, or left out of a fit.

use std::ops::Range;

use super::rows::{Repaired, channels, is_or_are, keep, rows_word};
use crate::record::assembly::{Columns, Origin};
use crate::record::error::RecordError;

/// Longest run of missing inputs, temperatures or loads that is interpolated linearly \[rows\].
pub(super) const MAX_INTERPOLATED_ROWS: usize = 8;
/// Largest share of rows without a value in a column.
pub(super) const MAX_MISSING_SHARE: f64 = 0.5;

/// Omits rows without a time, and runs of missing inputs, temperatures or loads that are too long to interpolate.
pub(super) fn omit_missing(
    samples: &mut Columns,
    done: &mut Repaired,
    is_reference: bool,
    origin: &Origin<'_>,
) -> Result<(), RecordError> {
    let rows = samples.time.len();
    let has_time: Vec<bool> = samples.time.iter().map(|t| t.is_finite()).collect();
    let count = has_time.iter().filter(|has_time| !**has_time).count();
    let mostly_missing = |file: &str, column: &str, missing: usize| RecordError::MostlyMissing {
        file: file.to_owned(),
        column: column.to_owned(),
        missing,
        rows,
    };
    if count as f64 > MAX_MISSING_SHARE * rows as f64 {
        return Err(mostly_missing(&samples.name, origin.time_column, count));
    }
    if count > 0 {
        keep(samples, done, &has_time);
        done.note(format!("{} without a time {} left out", rows_word(count), is_or_are(count)));
    }
    let output = samples.output.as_ref().map(|(unit, y)| (unit.column(), y));
    if let Some((column, y)) = output {
        let missing: Vec<bool> = y.iter().map(|y| !y.is_finite()).collect();
        let count = missing.iter().filter(|missing| **missing).count();
        if count as f64 > MAX_MISSING_SHARE * rows as f64 {
            return Err(mostly_missing(&samples.name, column, count));
        }
        if let Some(row) = missing.iter().position(|missing| *missing).filter(|_| is_reference) {
            let place = (origin.place)(done.row(row));
            return Err(RecordError::NotFinite {
                file: samples.name.clone(),
                place,
                column: column.to_owned(),
                value: "missing".to_owned(),
            });
        }
        if count > 0 {
            let first = missing.iter().position(|missing| *missing).map_or(0, |row| done.row(row) + 1);
            done.missing = missing;
            done.note(format!(
                "{} without {column} {} not fitted{}",
                rows_word(count),
                is_or_are(count),
                row_hint(count, first)
            ));
        }
    }
    let columns = [
        (samples.input_column.clone(), samples.input.as_ref()),
        ("temperature_degc".to_owned(), samples.temperature.as_ref()),
        ("load_n".to_owned(), samples.load.as_ref()),
    ];
    let mut kept = vec![true; samples.time.len()];
    let mut notes = Vec::new();
    for (column, values) in columns.into_iter().filter_map(|(column, values)| Some((column, values?))) {
        let missing = values.iter().filter(|value| !value.is_finite()).count();
        if missing as f64 > MAX_MISSING_SHARE * rows as f64 {
            return Err(mostly_missing(&samples.name, &column, missing));
        }
        let mut left_out = 0;
        for run in runs(values) {
            // A run at an end has a value on one side only and cannot be interpolated.
            let inner = run.start > 0 && run.end < values.len();
            if run.len() > MAX_INTERPOLATED_ROWS || !inner {
                left_out += run.len();
                kept[run].fill(false);
            }
        }
        let interpolated = missing - left_out;
        if interpolated > 0 {
            notes.push(format!("{} without {column}: interpolated", rows_word(interpolated)));
        }
        if left_out > 0 {
            notes.push(format!("{} without {column} {} left out", rows_word(left_out), is_or_are(left_out)));
        }
    }
    if kept.contains(&false) {
        keep(samples, done, &kept);
    }
    notes.into_iter().for_each(|note| done.note(note));
    Ok(())
}

/// Returns the number of the only row, or of the first of several rows.
fn row_hint(count: usize, row: usize) -> String {
    if count == 1 { format!(" (row {row})") } else { format!(" (the first is row {row})") }
}

/// Returns the runs of missing values.
fn runs(values: &[f64]) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut start = None;
    for (row, value) in values.iter().enumerate() {
        match (value.is_finite(), start) {
            (false, None) => start = Some(row),
            (true, Some(first)) => {
                runs.push(first..row);
                start = None;
            }
            _ => {}
        }
    }
    runs.extend(start.map(|first| first..values.len()));
    runs
}

/// Replaces missing values by linear interpolation; at an end by the nearest value.
pub(super) fn interpolate_missing(samples: &mut Columns) {
    if channels(samples).all(|values| values.iter().all(|value| value.is_finite())) {
        return;
    }
    let time = samples.time.clone();
    for values in channels(samples) {
        for run in runs(values) {
            let before = run.start.checked_sub(1).map(|row| (time[row], values[row]));
            let after = (run.end < values.len()).then(|| (time[run.end], values[run.end]));
            for row in run {
                values[row] = match (before, after) {
                    (Some((t0, v0)), Some((t1, v1))) if t1 > t0 => v0 + (v1 - v0) * (time[row] - t0) / (t1 - t0),
                    (Some((_, v)), _) | (None, Some((_, v))) => v,
                    (None, None) => 0.0,
                };
            }
        }
    }
}
