//! The rows of a record in repair: which are kept, and their places in the file.

use std::ops::Range;

use crate::record::assembly::Columns;
use crate::record::error::Place;
use crate::record::grid::Period;

/// The result of the repair.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Repaired {
    /// True for rows whose output is missing. It is interpolated and has no weight in a fit.
    pub(crate) missing: Vec<bool>,
    /// The row in the file for each row, if rows were omitted or inserted.
    pub(super) rows: Option<Vec<usize>>,
    /// Whether the rows differ from those of the file.
    pub(crate) changed: bool,
    /// Whether the values were resampled to even times.
    pub(crate) resampled: bool,
    /// The period of each segment, if the times are even.
    pub(crate) periods: Option<Vec<Period>>,
    /// One sentence per repair.
    pub(crate) notes: Vec<String>,
}

impl Repaired {
    /// Returns the row in the file.
    pub(crate) fn row(&self, row: usize) -> usize {
        self.rows.as_ref().map_or(row, |rows| rows[row])
    }

    pub(super) fn note(&mut self, note: String) {
        self.changed = true;
        self.notes.push(note);
    }
}

/// Returns the columns of values: input, output, temperature, load.
pub(super) fn channels(samples: &mut Columns) -> impl Iterator<Item = &mut Vec<f64>> {
    let Columns { input, output, temperature, load, .. } = samples;
    [input.as_mut(), output.as_mut().map(|(_, y)| y), temperature.as_mut(), load.as_mut()].into_iter().flatten()
}

/// Removes all rows that are not in `kept`.
pub(super) fn keep(samples: &mut Columns, done: &mut Repaired, kept: &[bool]) {
    let mut flags = kept.iter();
    let mut is_kept = || flags.next().copied().unwrap_or(true);
    let old = done.rows.take().unwrap_or_else(|| (0..samples.time.len()).collect());
    done.rows = Some(old.into_iter().filter(|_| is_kept()).collect());
    fn filter<T: Copy>(values: &mut Vec<T>, kept: &[bool]) {
        let mut flags = kept.iter();
        values.retain(|_| flags.next().copied().unwrap_or(true));
    }
    filter(&mut samples.time, kept);
    samples.segment.iter_mut().for_each(|labels| filter(labels, kept));
    channels(samples).for_each(|values| filter(values, kept));
    if !done.missing.is_empty() {
        filter(&mut done.missing, kept);
    }
}

/// Sets the segment labels to 0, 1, 2 …
pub(super) fn relabel(samples: &mut Columns, segments: &[Range<usize>]) {
    samples.segment =
        Some((0..).zip(segments).flat_map(|(label, rows)| std::iter::repeat_n(label, rows.len())).collect());
}

/// Returns a function from a repaired row to its place in the file.
pub(crate) fn place_of<'a>(done: &'a Repaired, place: &'a dyn Fn(usize) -> Place) -> impl Fn(usize) -> Place + 'a {
    move |row| place(done.row(row))
}

/// Returns a number of rows in words.
pub(super) fn rows_word(count: usize) -> String {
    if count == 1 { "1 row".to_owned() } else { format!("{count} rows") }
}

pub(super) fn is_or_are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}
