//! What a file holds, before anybody says what its columns are for.
//!
//! A format is told apart by its content, never by its name. Each format is one file here that implements [`Contents`].

#[cfg(feature = "arrow")]
mod arrow;
#[cfg(feature = "arrow")]
mod columnar;
#[cfg(any(feature = "mat", feature = "hdf5"))]
mod elements;
#[cfg(feature = "mcap-messages")]
mod foreign_mcap;
#[cfg(any(feature = "mat", feature = "hdf5"))]
mod gather;
#[cfg(feature = "hdf5")]
mod hdf5;
#[cfg(feature = "lvm")]
mod lvm;
#[cfg(any(feature = "mat", feature = "hdf5"))]
mod mat;
#[cfg(feature = "npy")]
mod npy;
mod numbers;
#[cfg(feature = "parquet")]
mod parquet;
mod table;
#[cfg(feature = "tdms")]
mod tdms;
mod text;
#[cfg(feature = "xlsx")]
mod xlsx;

pub(crate) use table::Table;
pub(crate) use text::LargeText;

use std::borrow::Cow;
use std::io::Read;

use super::error::{Place, RecordError};
use super::grid::Printed;

/// Formats that are read, as messages list them.
pub(crate) const FORMATS: &str =
    "tables of text as CSV, also compressed; MATLAB, HDF5, TDMS, LVM, NumPy, Parquet, Arrow, Excel and MCAP files";

/// The note of a log without its end.
pub(crate) const CUT_OFF: &str = "the log was cut off: its end is missing";

/// What the other columns of a file, or the file itself, say of the times of a column's rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Axis {
    /// Nothing.
    Unknown,
    /// They are in this column.
    Column(usize),
    /// They are even \[s\].
    Even { start: f64, step: f64 },
}

/// A column, without its values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Head {
    /// As `--map` names it: a heading, a path as `/group/name` or `matrix[2]`, or a number where a file has no names.
    pub(crate) name: String,
    /// The unit that the file states elsewhere than in the heading.
    pub(crate) unit: Option<String>,
    /// Number of rows, where it is known before reading.
    pub(crate) rows: Option<usize>,
    /// Times of its rows.
    pub(crate) axis: Axis,
    /// Where it is in the file, if its name does not say it, as `data[2]`; `--map` takes that too.
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
    /// Which of them is the time.
    pub(crate) time: Option<usize>,
    /// Which of them is the segment.
    pub(crate) segment: Option<usize>,
}

impl<'a> Wanted<'a> {
    /// These columns, whatever they are.
    pub(crate) fn all(columns: &'a [usize]) -> Self {
        Self { columns, time: None, segment: None }
    }
}

/// The values of a column; NaN stands for a cell without a number.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    pub(crate) numbers: Vec<f64>,
    pub(crate) printed: Printed,
}

/// A file's columns.
pub(crate) trait Contents {
    /// The format in words, as `CSV, ';' between columns`.
    fn format(&self) -> String;

    /// The columns.
    fn heads(&self) -> &[Head];

    /// Values of the columns with these numbers, in their order. Only the first one, the time, says how finely it is printed.
    ///
    /// # Errors
    /// When a cell of them is no number, or the file ends early.
    fn values(&self, wanted: Wanted<'_>) -> Result<Vec<Values>, RecordError>;

    /// Rows of the file that are averaged into one.
    fn rows_per_row(&self) -> usize {
        1
    }

    /// What reading the values has shown.
    fn late_notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Columns of text, by name, with a cell of each.
    fn texts(&self) -> &[(String, String)] {
        &[]
    }

    /// Where a reader finds a row.
    fn place(&self, row: usize) -> Place {
        Place::Row(row)
    }

    /// Where a reader finds the columns' names.
    fn header(&self) -> Option<Place> {
        None
    }

    /// The text of a table that is written as the record format is, so that its rows can be carried through as they stand.
    fn plain_text(&self) -> Option<&str> {
        None
    }

    /// What was done to read the file that its owner may want to know.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// Whether the end of the file is missing.
    fn cut_off(&self) -> bool {
        false
    }
}

/// A format of bytes: how its files are told apart, and how they are read as a whole.
#[cfg(feature = "binary")]
struct Binary {
    is: fn(&[u8]) -> bool,
    read: fn(&str, &[u8]) -> Result<Table, RecordError>,
}

/// The formats that are built in. Text comes after them: it is what nothing else is.
#[cfg(feature = "binary")]
const BINARY: &[Binary] = &[
    #[cfg(feature = "hdf5")]
    Binary { is: hdf5::is, read: hdf5::read },
    #[cfg(feature = "mat")]
    Binary { is: mat::is, read: mat::read },
    #[cfg(feature = "tdms")]
    Binary { is: tdms::is, read: tdms::read },
    #[cfg(feature = "lvm")]
    Binary { is: lvm::is, read: lvm::read },
    #[cfg(feature = "npy")]
    Binary { is: npy::is, read: npy::read },
    #[cfg(feature = "parquet")]
    Binary { is: parquet::is, read: parquet::read },
    #[cfg(feature = "arrow")]
    Binary { is: arrow::is, read: arrow::read },
    #[cfg(feature = "xlsx")]
    Binary { is: xlsx::is, read: xlsx::read },
    // Logs of runs are read elsewhere.
    #[cfg(feature = "mcap-messages")]
    Binary { is: foreign_mcap::is, read: foreign_mcap::read },
];

/// Opens the contents of a file; `name` stands for it in messages.
///
/// # Errors
/// When the format is none that is read, or the file is damaged.
pub(crate) fn open<'a>(name: &str, bytes: &'a [u8]) -> Result<Box<dyn Contents + 'a>, RecordError> {
    #[cfg(feature = "binary")]
    if let Some(binary) = BINARY.iter().find(|binary| (binary.is)(bytes)) {
        return Ok(Box::new((binary.read)(name, bytes)?));
    }
    Ok(Box::new(text::Text::open(name, bytes)?))
}

/// Bytes that a compressed file may hold whatever its size.
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// How many times its size a compressed file may hold beyond that: numbers as text take a third to a tenth.
const MAX_EXPANSION: u64 = 200;

/// The bytes inside a file compressed by gzip or Zstandard; others as they are.
///
/// # Errors
/// When the file is damaged, or expands to far more than any table does.
pub(crate) fn unpack<'a>(name: &str, bytes: &'a [u8]) -> Result<Cow<'a, [u8]>, RecordError> {
    let damaged = |format, what: String| RecordError::Damaged { file: name.to_owned(), format, what };
    let (format, reader): (_, Box<dyn Read + 'a>) = if bytes.starts_with(b"\x1f\x8b") {
        ("gzip", Box::new(flate2::read::MultiGzDecoder::new(bytes)))
    } else if bytes.starts_with(b"\x28\xb5\x2f\xfd") {
        let decoder = zstd::stream::read::Decoder::new(bytes);
        ("Zstandard", Box::new(decoder.map_err(|error| damaged("Zstandard", error.to_string()))?))
    } else {
        return Ok(Cow::Borrowed(bytes));
    };
    let limit = ALWAYS_UNPACKED.max(MAX_EXPANSION.saturating_mul(bytes.len() as u64));
    let mut unpacked = Vec::new();
    let read = reader.take(limit + 1).read_to_end(&mut unpacked);
    read.map_err(|error| {
        damaged(format, format!("cannot be unpacked ({error}); the file may be cut off: copy it again"))
    })?;
    if unpacked.len() as u64 > limit {
        return Err(damaged(
            format,
            format!(
                "expands to more than {MAX_EXPANSION} times its size, as measured values do not; unpack it yourself if you trust it, and read the file inside"
            ),
        ));
    }
    Ok(Cow::Owned(unpacked))
}
