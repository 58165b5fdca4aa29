//! Writing records in the formats that other programs load.

mod mat;
mod npy;
mod tdms;

use std::borrow::Cow;
use std::io::Write;

use super::{OutputUnit, Record, WriteError};

/// A format that a record is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// The record format.
    Csv,
    /// NumPy: a structured array with a field per column.
    Npy,
    /// MATLAB 5: a column vector per column.
    Mat,
    /// LabVIEW TDMS: a channel per column, with its unit and times.
    Tdms,
}

impl FileKind {
    /// Every format.
    pub const ALL: [Self; 4] = [Self::Csv, Self::Npy, Self::Mat, Self::Tdms];

    /// The ending of its files, without the point.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Npy => "npy",
            Self::Mat => "mat",
            Self::Tdms => "tdms",
        }
    }

    /// The format of files with this ending.
    pub fn of_ending(ending: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.ending().eq_ignore_ascii_case(ending))
    }
}

/// A column of a record.
struct Column<'a> {
    name: &'a str,
    /// The unit as people write it; empty for the segment.
    unit: &'static str,
    values: Cow<'a, [f64]>,
}

impl Record {
    /// Writes the columns that play a role in a format; a missing output is NaN. Values keep all their bits, but in CSV times are printed with the decimals that
    /// keep them even.
    ///
    /// # Errors
    /// When `out` refuses, or the record was joined.
    pub fn write_as(&self, kind: FileKind, mut out: impl Write) -> Result<(), WriteError> {
        if self.sources().len() != 1 {
            return Err(WriteError::Joined { name: self.name() });
        }
        match kind {
            FileKind::Csv => return self.write_csv(out),
            FileKind::Npy => npy::write(&self.role_columns(), &mut out)?,
            FileKind::Mat => mat::write(&self.role_columns(), &mut out)?,
            FileKind::Tdms => {
                let even = (self.segments.len() == 1).then(|| self.sample_period());
                tdms::write(&self.role_columns(), even, &mut out)?;
            }
        }
        out.flush()?;
        Ok(())
    }

    fn role_columns(&self) -> Vec<Column<'_>> {
        let mut columns = Vec::new();
        if self.labelled {
            let rows = self.segments.iter().zip(&self.labels);
            let values: Vec<f64> =
                rows.flat_map(|(rows, label)| std::iter::repeat_n(*label as f64, rows.len())).collect();
            columns.push(Column { name: "segment", unit: "", values: values.into() });
        }
        let input = if self.input_column == "voltage_v" { "V" } else { "" };
        let output = self.output.as_ref().map(|(unit, values)| (unit.column(), unit.symbol(), values));
        let plain = [
            Some(("time_s", "s", &self.time)),
            self.input.as_ref().map(|values| (self.input_column.as_str(), input, values)),
            output,
            self.temperature.as_ref().map(|values| ("temperature_degc", "°C", values)),
            self.load.as_ref().map(|values| ("load_n", "N", values)),
        ];
        for (name, unit, values) in plain.into_iter().flatten() {
            let mut values: Cow<'_, [f64]> = Cow::Borrowed(values);
            if OutputUnit::of_column(name).is_some() && self.missing.contains(&true) {
                let of = |(row, value): (usize, &f64)| if self.is_missing(row) { f64::NAN } else { *value };
                values = values.iter().enumerate().map(of).collect();
            }
            columns.push(Column { name, unit, values });
        }
        columns
    }
}
