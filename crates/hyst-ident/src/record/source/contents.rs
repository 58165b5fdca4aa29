//! The columns of a file, without roles: the interface of every format.

use crate::record::error::{Place, RecordError};
use crate::record::grid::Printed;

/// The times of the rows of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Axis {
    /// The file does not state them.
    Unknown,
    /// The column with the times.
    #[cfg_attr(
        not(any(feature = "lvm", feature = "tdms", feature = "mcap-messages")),
        allow(dead_code, reason = "texts do not have it")
    )]
    Column(usize),
    /// Even times \[s\].
    Even { start: f64, step: f64 },
}

/// A column, without its values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Head {
    /// The name for `--map`: a heading, a path such as `/group/name` or `matrix[2]`, or a number if the file has no
    /// names.
    pub(crate) name: String,
    /// The unit, if the file states it outside the heading.
    pub(crate) unit: Option<String>,
    /// The number of rows, if it is known before reading.
    pub(crate) rows: Option<usize>,
    /// The times of the rows.
    pub(crate) axis: Axis,
    /// The place in the file, such as `data[2]`, if it differs from the name. `--map` accepts it too.
    pub(crate) path: Option<String>,
}

impl Head {
    pub(crate) fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), unit: None, rows: None, axis: Axis::Unknown, path: None }
    }
}

/// Columns to read, by number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted<'a> {
    pub(crate) columns: &'a [usize],
    /// The index of the time in `columns`.
    pub(crate) time: Option<usize>,
    /// The index of the segment in `columns`.
    pub(crate) segment: Option<usize>,
}

impl<'a> Wanted<'a> {
    /// Requests columns without stating which is the time or the segment.
    pub(crate) fn all(columns: &'a [usize]) -> Self {
        Self { columns, time: None, segment: None }
    }
}

/// The values of a column; NaN if a cell has no number.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    pub(crate) numbers: Vec<f64>,
    pub(crate) printed: Printed,
}

/// The columns of a file.
pub(crate) trait Contents {
    /// Returns the format in words, such as `table of text, ';' between columns`.
    fn format(&self) -> String;

    /// Returns the columns.
    fn heads(&self) -> &[Head];

    /// Reads the requested columns, in the order of the request.
    ///
    /// Only the printed resolution of the first column, the time, is valid.
    ///
    /// # Errors
    /// If a cell is not a number, or the file ends early.
    fn values(&self, wanted: Wanted<'_>) -> Result<Vec<Values>, RecordError>;

    /// Returns the number of rows of the file that are averaged into one.
    fn rows_per_row(&self) -> usize {
        1
    }

    /// Returns notes that are known after the values were read.
    fn late_notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Returns the columns of text: name and an example of a cell.
    fn texts(&self) -> &[(String, String)] {
        &[]
    }

    /// Returns the place of a row.
    fn place(&self, row: usize) -> Place {
        Place::Row(row)
    }

    /// Returns the place of the column names.
    fn header(&self) -> Option<Place> {
        None
    }

    /// Returns the text if the file is in the record format, so that its rows can be copied unchanged.
    fn plain_text(&self) -> Option<&str> {
        None
    }

    /// Returns one sentence per change that was made while reading.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// Returns whether the end of the file is missing.
    fn cut_off(&self) -> bool {
        false
    }
}
