//! A table in memory, which most formats are read into.

use super::{Contents, Head, Values, Wanted};
use crate::record::error::RecordError;
use crate::record::grid::Printed;

/// The columns of a file that is read as a whole.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    /// The format in words, such as `MATLAB 5`.
    pub(crate) format: String,
    /// The columns.
    pub(crate) heads: Vec<Head>,
    /// The values of the columns; NaN if a cell has no number.
    pub(crate) values: Vec<Vec<f64>>,
    /// One sentence per change that was made while reading.
    pub(crate) notes: Vec<String>,
    /// Whether the end of the file is missing.
    pub(crate) cut_off: bool,
}

impl Table {
    /// Makes an empty table.
    pub(crate) fn new(format: impl Into<String>) -> Self {
        Self { format: format.into(), ..Self::default() }
    }

    /// Adds a column and returns its number.
    pub(crate) fn push(&mut self, head: Head, values: Vec<f64>) -> usize {
        self.heads.push(Head { rows: Some(values.len()), ..head });
        self.values.push(values);
        self.heads.len() - 1
    }
}

impl Contents for Table {
    fn format(&self) -> String {
        self.format.clone()
    }

    fn heads(&self) -> &[Head] {
        &self.heads
    }

    fn values(&self, wanted: Wanted<'_>) -> Result<Vec<Values>, RecordError> {
        let of = |at: &usize| {
            let numbers = self.values[*at].clone();
            // Numbers of 32 bits have seven digits.
            let single =
                numbers.iter().all(|value| f64::from(*value as f32).to_bits() == value.to_bits() || value.is_nan());
            let printed = if single { Printed { digits: 7, ..Printed::EXACT } } else { Printed::EXACT };
            Values { numbers, printed }
        };
        Ok(wanted.columns.iter().map(of).collect())
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn cut_off(&self) -> bool {
        self.cut_off
    }
}
