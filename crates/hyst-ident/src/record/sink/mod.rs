//! Writing of records in formats of other programs.

mod column;
mod mat;
mod npy;
mod tdms;

use std::borrow::Cow;
use std::io::Write;

use super::{OutputUnit, Record, WriteError};
use column::Column;

/// A file format for writing records.
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

    /// Returns the file name extension without the point.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Npy => "npy",
            Self::Mat => "mat",
            Self::Tdms => "tdms",
        }
    }

    /// Returns the format of files with this extension.
    pub fn of_ending(ending: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.ending().eq_ignore_ascii_case(ending))
    }
}

impl Record {
    /// Writes the columns with a role in a format.
    ///
    /// A missing output is NaN (in CSV an empty cell). Values are exact, except for times in CSV, which have enough
    /// decimals to be even.
    ///
    /// # Errors
    /// If writing to `out` fails, or the record was joined.
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
