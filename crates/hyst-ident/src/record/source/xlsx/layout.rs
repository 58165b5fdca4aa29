//! The place of the table in a sheet, and the names and units of its columns.

use std::collections::{BTreeMap, BTreeSet};

use super::cells::{Item, Sheet, Value};
use super::fault::Fault;
use super::rate;
use crate::record::heading::Unit;
use crate::record::source::{Axis, Head};

/// Number of rows above the numbers that are searched for names.
const ROWS_ABOVE: usize = 6;
/// Steps per second to which dates are rounded: spreadsheets show milliseconds, and a date resolves microseconds.
const STEPS_PER_SECOND: [f64; 4] = [1e3, 1e4, 1e5, 1e6];
/// Largest error of a date \[s\]. A present date in days with 16 digits has an error of 0.5 µs.
const DATE_ERROR_S: f64 = 1e-6;
const SECONDS_PER_DAY: f64 = 86_400.0;

type Row = BTreeMap<u32, Item>;

/// A column of a sheet.
pub(super) struct Column {
    pub(super) head: Head,
    pub(super) values: Vec<f64>,
    /// Number of cells with text, which are read as empty.
    pub(super) texts: usize,
}

/// The table of a sheet.
#[derive(Debug, PartialEq)]
pub(super) struct Layout {
    /// The first row of numbers.
    first: u32,
    /// Columns that hold numbers.
    columns: BTreeSet<u32>,
    /// The row with the names.
    names: Option<u32>,
    /// The row with the units.
    units: Option<u32>,
}

/// Returns whether at least half of the filled cells of a row are numbers.
fn is_like_row(row: &Row) -> bool {
    let numbers = row.values().filter(|item| item.is_number()).count();
    let filled = row.values().filter(|item| **item != Item::Missing).count();
    numbers > 0 && 2 * numbers >= filled
}

impl Layout {
    /// Finds the table of a sheet; `None` if it has no row of numbers.
    pub(super) fn find(sheet: &Sheet) -> Option<Self> {
        let rows: Vec<(&u32, &Row)> =
            sheet.top.iter().filter(|(_, row)| row.values().any(|item| *item != Item::Missing)).collect();
        let alike: Vec<&Row> = rows.iter().map(|(_, row)| *row).filter(|row| is_like_row(row)).collect();
        // Columns that have a number in most rows must have one in the first row too.
        let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
        for (column, _) in alike.iter().flat_map(|row| row.iter()).filter(|(_, item)| item.is_number()) {
            *counts.entry(*column).or_default() += 1;
        }
        counts.retain(|_, count| 2 * *count >= alike.len());
        let is_row = |row: &Row| {
            let usual = || counts.keys().filter_map(|column| row.get(column));
            let numbers = usual().filter(|item| item.is_number()).count();
            is_like_row(row)
                && numbers > 0
                && 2 * numbers >= counts.len()
                && !usual().any(|item| matches!(item, Item::Text(_)))
        };
        // One title may look like a row. Two such rows in sequence are rows.
        let begins = |k: &usize| {
            is_row(rows[*k].1) && (alike.len() < 3 || rows.get(*k + 1).is_none_or(|(_, next)| is_row(next)))
        };
        let first = (0..rows.len()).find(begins)?;
        let mut layout = Self { first: *rows[first].0, columns: BTreeSet::new(), names: None, units: None };
        let columns = sheet.columns.keys().copied().filter(|column| layout.is_column(sheet, *column));
        layout.columns = columns.collect();
        layout.find_names(&rows[..first]);
        Some(layout)
    }

    /// Returns whether a column has at least two numbers and not mostly text. A single number is a setting.
    fn is_column(&self, sheet: &Sheet, column: u32) -> bool {
        let count = |values: &[Value]| values.iter().filter(|(row, _)| *row >= self.first).count();
        let cells = &sheet.columns[&column];
        let numbers = count(&cells.numbers).max(count(&cells.dates));
        numbers >= 2 && self.texts(sheet, column) <= numbers
    }

    /// Returns the number of cells with text in a column, without those above the table.
    fn texts(&self, sheet: &Sheet, column: u32) -> usize {
        let above =
            sheet.top.range(..self.first).filter(|(_, row)| matches!(row.get(&column), Some(Item::Text(_)))).count();
        sheet.columns[&column].texts - above
    }

    /// Returns whether a row has a title for at least half of the columns.
    fn has_titles(&self, row: &Row) -> bool {
        let named = self.columns.iter().filter(|column| matches!(row.get(column), Some(Item::Text(_)))).count();
        named > 0 && 2 * named >= self.columns.len()
    }

    /// Finds the rows with names and units above the first row.
    fn find_names(&mut self, above: &[(&u32, &Row)]) {
        let mut titled = above.iter().rev().take(ROWS_ABOVE).filter(|(_, row)| self.has_titles(row));
        let (last, before) = (titled.next().copied(), titled.next().copied());
        drop(titled);
        let Some((at, row)) = last else { return };
        match before.filter(|_| self.is_units(row)) {
            Some((names, _)) => (self.names, self.units) = (Some(*names), Some(*at)),
            None => self.names = Some(*at),
        }
    }

    /// Returns whether the titles of a row are units.
    fn is_units(&self, row: &Row) -> bool {
        let titles = || self.columns.iter().map(|column| title(row, *column).unwrap_or_default());
        let known = titles().filter(|title| unit_in(title).is_some()).count();
        let none = titles().filter(|title| is_dimensionless(title)).count();
        // One unknown unit such as "counts/s" is allowed if at least two units are known.
        known > 0 && known + none + usize::from(known > 1) >= self.columns.len()
    }

    /// Returns the columns with aligned rows. `free` is the number of values that they may still have.
    pub(super) fn columns(&self, mut sheet: Sheet, free: &mut usize) -> Result<Vec<Column>, Fault> {
        let rows = self.rows(&sheet);
        let count = rows.last().map_or(0, |(_, at)| *at + 1);
        let numbers = count.checked_mul(self.columns.len()).and_then(|numbers| free.checked_sub(numbers));
        *free = numbers.ok_or_else(Fault::too_large)?;
        let above: Vec<&Row> = sheet.top.range(..self.first).map(|(_, row)| row).collect();
        let axis = rate::stated(&above).map_or(Axis::Unknown, |step| Axis::Even { start: 0.0, step });
        let heads: Vec<(u32, Head, usize)> =
            self.columns.iter().map(|column| self.head(&sheet, *column, axis)).collect();
        let column = |(column, mut head, texts): (u32, Head, usize)| {
            let cells = sheet.columns.remove(&column).unwrap_or_default();
            let mut values = vec![f64::NAN; count];
            let mut set = |row: u32, value: f64| {
                if let Ok(at) = rows.binary_search_by_key(&row, |(row, _)| *row) {
                    values[rows[at].1] = value;
                }
            };
            if cells.dates.len() > cells.numbers.len() {
                // Dates are converted to seconds.
                head.unit = Some("s".to_owned());
                let first = cells.dates.iter().filter(|(row, _)| *row >= self.first).min_by_key(|(row, _)| *row);
                let midnight = first.map_or(0.0, |(_, days)| days.floor());
                let rounded = round(cells.dates.iter().map(|(_, days)| (days - midnight) * SECONDS_PER_DAY));
                cells.dates.iter().zip(rounded).for_each(|((row, _), seconds)| set(*row, seconds));
            } else {
                cells.numbers.iter().for_each(|(row, number)| set(*row, *number));
            }
            Column { head, values, texts }
        };
        Ok(heads.into_iter().map(column).collect())
    }

    /// Returns the rows with a number in any of the columns, each with its number in the table.
    fn rows(&self, sheet: &Sheet) -> Vec<(u32, usize)> {
        let cells = || self.columns.iter().filter_map(|column| sheet.columns.get(column));
        let all = || {
            cells()
                .flat_map(|cells| cells.numbers.iter().chain(&cells.dates))
                .map(|(row, _)| *row)
                .filter(|row| *row >= self.first)
        };
        let mut filled = vec![false; all().max().map_or(0, |last| last as usize + 1)];
        all().for_each(|row| filled[row as usize] = true);
        let filled = filled.iter().enumerate().filter(|(_, filled)| **filled);
        filled.enumerate().map(|(at, (row, _))| (row as u32, at)).collect()
    }

    /// Returns number and head of a column, and its number of cells with text.
    fn head(&self, sheet: &Sheet, column: u32, axis: Axis) -> (u32, Head, usize) {
        let in_row = |row: Option<u32>| title(sheet.top.get(&row?)?, column);
        let name = in_row(self.names).map_or_else(|| (column + 1).to_string(), str::to_owned);
        let unit = in_row(self.units).and_then(unit_in).map(str::to_owned);
        (column, Head { unit, axis, ..Head::new(name) }, self.texts(sheet, column))
    }
}

fn title(row: &Row, column: u32) -> Option<&str> {
    match row.get(&column)? {
        Item::Text(text) => Some(text),
        _ => None,
    }
}

/// Rounds dates \[s\] to the coarsest step that agrees with all of them.
fn round(dates: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let to = |steps: f64| dates.clone().map(move |date| (date * steps).round() / steps);
    let is_near =
        |steps: &f64| to(*steps).zip(dates.clone()).all(|(rounded, date)| (rounded - date).abs() <= DATE_ERROR_S);
    let steps = STEPS_PER_SECOND.into_iter().find(is_near).unwrap_or(1e6);
    to(steps).collect()
}

/// Returns the unit in a cell of a row of units, without brackets.
fn unit_in(title: &str) -> Option<&str> {
    let inner = title.trim_matches(['(', ')', '[', ']', '{', '}', ' ']);
    Unit::parse(inner).map(|_| inner)
}

fn is_dimensionless(title: &str) -> bool {
    let inner = title.trim_matches(['(', ')', '[', ']']);
    ["", "-", "1", "%", "n/a", "a.u.", "counts"].contains(&inner.to_lowercase().as_str())
}
