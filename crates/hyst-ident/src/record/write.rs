//! Writing records as CSV.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Write;

use csv::ByteRecord;

use super::checked::{Record, Text};
use super::grid::{self, Printed};
use super::unit::OutputUnit;

/// Why a record could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// Writing failed.
    #[error("the record cannot be written: {0}")]
    Io(#[from] std::io::Error),
    /// An extra column has another length than the record.
    #[error("column \"{column}\" has {found} values, but the record has {expected} rows; give one value per row")]
    Lengths {
        /// The column.
        column: String,
        /// Its length.
        found: usize,
        /// The number of rows of the record.
        expected: usize,
    },
    /// A value to write is NaN or infinite, which the record format does not allow.
    #[error("column \"{column}\", row {row}: {value} is not a finite number; nothing is written; correct the value")]
    NotFinite {
        /// The column.
        column: String,
        /// The row, counted from 0.
        row: usize,
        /// The value.
        value: f64,
    },
    /// The record was joined from several files, whose times may overlap.
    #[error("{name}: a record joined from several files cannot be written to one file; write each record separately")]
    Joined {
        /// The files.
        name: String,
    },
}

/// A column to write after the columns of a record. It replaces a column with the same name.
#[derive(Clone, Copy, Debug)]
pub struct Extra<'a> {
    name: &'a str,
    cells: Cells<'a>,
}

#[derive(Clone, Copy, Debug)]
enum Cells<'a> {
    Numbers(&'a [f64], Option<usize>),
    Flags(&'a [bool]),
}

impl<'a> Extra<'a> {
    /// Makes a column of numbers, written with enough digits to read the same values again.
    pub fn numbers(name: &'a str, values: &'a [f64]) -> Self {
        Self { name, cells: Cells::Numbers(values, None) }
    }

    /// Makes a column of numbers, rounded to `decimals` digits after the point.
    pub fn rounded(name: &'a str, values: &'a [f64], decimals: usize) -> Self {
        Self { name, cells: Cells::Numbers(values, Some(decimals)) }
    }

    /// Makes a column of flags, written as 1 and 0.
    pub fn flags(name: &'a str, values: &'a [bool]) -> Self {
        Self { name, cells: Cells::Flags(values) }
    }

    fn check(&self, rows: usize) -> Result<(), WriteError> {
        let found = match self.cells {
            Cells::Numbers(values, _) => values.len(),
            Cells::Flags(values) => values.len(),
        };
        let column = || self.name.to_owned();
        if found != rows {
            return Err(WriteError::Lengths { column: column(), found, expected: rows });
        }
        if let Cells::Numbers(values, _) = self.cells
            && let Some(row) = values.iter().position(|value| !value.is_finite())
        {
            return Err(WriteError::NotFinite { column: column(), row, value: values[row] });
        }
        Ok(())
    }

    fn print(&self, row: usize, cell: &mut String) {
        cell.clear();
        // Writing to a String does not fail.
        let _ = match self.cells {
            Cells::Numbers(values, None) => write!(cell, "{}", values[row]),
            Cells::Numbers(values, Some(decimals)) => write!(cell, "{:.decimals$}", values[row]),
            Cells::Flags(values) => write!(cell, "{}", u8::from(values[row])),
        };
    }
}

impl Record {
    /// Writes the columns with a role in the record format.
    ///
    /// Times are in seconds, with enough decimals to be even to the last printed digit. Other values have enough digits
    /// to read the same values again. A missing output is an empty cell.
    ///
    /// # Errors
    /// If writing to `out` fails, or the record was joined.
    pub fn write_csv(&self, mut out: impl Write) -> Result<(), WriteError> {
        if self.sources.len() != 1 {
            return Err(WriteError::Joined { name: self.name() });
        }
        let columns: Vec<(&str, &[f64])> = [
            (self.input_column.as_str(), self.input.as_deref()),
            (self.output_unit().map_or("", |unit| unit.column()), self.output()),
            ("temperature_degc", self.temperature()),
            ("load_n", self.load()),
        ]
        .into_iter()
        .filter_map(|(name, values)| values.map(|values| (name, values)))
        .collect();

        let mut text = String::from(if self.labelled { "segment,time_s" } else { "time_s" });
        columns.iter().for_each(|(name, _)| text.extend([",", name]));
        text.push('\n');
        let decimals = self.time_decimals();
        for (rows, label) in self.segments.iter().zip(&self.labels) {
            for row in rows.clone() {
                // Writing to a String does not fail.
                if self.labelled {
                    let _ = write!(text, "{label},");
                }
                let _ = write!(text, "{:.decimals$}", self.time[row]);
                for (name, values) in &columns {
                    text.push(',');
                    if !(self.is_missing(row) && OutputUnit::of_column(name).is_some()) {
                        let _ = write!(text, "{}", values[row]);
                    }
                }
                text.push('\n');
            }
            out.write_all(text.as_bytes())?;
            text.clear();
        }
        out.flush()?;
        Ok(())
    }

    /// Writes all columns of the file unchanged, including those without a role, and `extra` after them.
    ///
    /// A record made in memory is written as by [`write_csv`](Self::write_csv).
    ///
    /// # Errors
    /// If writing to `out` fails, an extra column has another length than the record or a value that is not finite, or
    /// the record was joined.
    pub fn write_with(&self, out: impl Write, extra: &[Extra<'_>]) -> Result<(), WriteError> {
        extra.iter().try_for_each(|column| column.check(self.rows()))?;
        // The text is copied only if it has the rows of the record and a header.
        let whole = |text: &&[u8]| rows_of(text).byte_records().count() == self.rows() + 1;
        let text = match self.text.as_ref().map(Text::as_bytes).filter(whole) {
            Some(text) => Cow::Borrowed(text),
            None => {
                let mut text = Vec::new();
                self.write_csv(&mut text)?;
                Cow::Owned(text)
            }
        };
        let refused = |error: csv::Error| WriteError::Io(error.into());
        let mut reader = rows_of(&text);
        let mut writer = csv::Writer::from_writer(out);
        let mut fields = ByteRecord::new();
        let mut kept: Vec<bool> = Vec::new();
        let mut cell = String::new();
        let mut row = None;
        while reader.read_byte_record(&mut fields).map_err(refused)? {
            if row.is_none() {
                let replaced = |field: &[u8]| extra.iter().any(|column| column.name.as_bytes() == field.trim_ascii());
                kept = fields.iter().map(|field| !replaced(field)).collect();
            }
            for (field, _) in fields.iter().zip(&kept).filter(|(_, kept)| **kept) {
                writer.write_field(field).map_err(refused)?;
            }
            for column in extra {
                match row {
                    None => column.name.clone_into(&mut cell),
                    Some(row) => column.print(row, &mut cell),
                }
                writer.write_field(&cell).map_err(refused)?;
            }
            writer.write_record(None::<&[u8]>).map_err(refused)?;
            row = Some(row.map_or(0, |row| row + 1));
        }
        writer.flush()?;
        Ok(())
    }

    /// Returns whether the output of a row is missing, so that its value is interpolated.
    pub(super) fn is_missing(&self, row: usize) -> bool {
        self.missing.get(row).copied().unwrap_or(false)
    }

    /// Returns the fewest decimals with which the printed times give the periods of this record again.
    ///
    /// If the period has many decimals, a thousandth of a period is resolved at least.
    fn time_decimals(&self) -> usize {
        const MAX_DECIMALS: usize = 17;
        let periods = self.sample_periods();
        let fine = |h: f64| (3.0 - h.log10()).ceil().clamp(3.0, MAX_DECIMALS as f64) as usize;
        let starts = self.segments.iter().map(|rows| decimals_of(self.time[rows.start]));
        let steps = periods.iter().map(|h| decimals_of(*h).min(fine(*h)));
        let least = starts.chain(steps).max().unwrap_or(0).clamp(3, MAX_DECIMALS);
        let mut near = None;
        for decimals in least..=MAX_DECIMALS {
            let Some(found) = self.periods_printed_with(decimals) else { continue };
            if found == periods {
                return decimals;
            }
            // A period with many decimals is reproduced to 1e-12 only.
            if near.is_none() && found.iter().zip(&periods).all(|(found, h)| (found - h).abs() <= 1e-12 * h) {
                near = Some(decimals);
            }
        }
        near.unwrap_or(MAX_DECIMALS)
    }

    /// Returns the period of each segment that reading the times with `decimals` would give.
    fn periods_printed_with(&self, decimals: usize) -> Option<Vec<f64>> {
        let mut printed = Printed::default();
        let mut text = String::new();
        let mut reprint = |t: &f64| {
            text.clear();
            // Writing to a String does not fail.
            let _ = write!(text, "{t:.decimals$}");
            printed.take(text.as_bytes());
            text.parse().unwrap_or(*t)
        };
        let times: Vec<f64> = self.time.iter().map(&mut reprint).collect();
        let found = grid::fit(&times, &self.segments, printed).ok()?;
        Some(found.iter().map(|period| period.value).collect())
    }
}

/// Returns the number of decimals of the shortest text that parses to `t`.
fn decimals_of(t: f64) -> usize {
    t.to_string().split_once('.').map_or(0, |(_, decimals)| decimals.len())
}

/// Returns a reader of all rows, including the header, that accepts rows of any length.
fn rows_of(text: &[u8]) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text)
}
