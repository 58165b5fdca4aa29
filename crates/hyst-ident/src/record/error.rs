//! Errors of records. Every message states the place, the problem, and what to do.

use std::fmt;

/// The supported formats, for messages.
const FORMATS: &str =
    "text tables such as CSV, also compressed; MATLAB, HDF5, TDMS, LVM, NumPy, Parquet, Arrow, Excel and MCAP files";

/// The place of a row in a file or in a table in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of a file, counted from 1. The header is usually line 1.
    Line(u64),
    /// A row of a record made in memory, counted from 0.
    Row(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Row(row) => write!(f, "row {row}"),
        }
    }
}

/// Why a record could not be read, made or joined.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file could not be opened or read.
    #[error("{file}: cannot be read: {source}")]
    Io {
        /// The file.
        file: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// An MCAP file that is not a log of a run.
    #[error("{file}: {what}; give a log that hystctl run --log wrote")]
    Log {
        /// The file.
        file: String,
        /// What is wrong.
        what: String,
    },
    /// A log without a sample of the requested drive or reference.
    #[error("{file}: the log has no sample of the requested drive or reference: {what}")]
    NothingAsked {
        /// The file.
        file: String,
        /// Why, and what to do.
        what: String,
    },
    /// The file has no header line.
    #[error(
        "{file}, line 1: the file is empty; a record starts with a header line such as \"time_s,voltage_v,displacement_um\""
    )]
    Empty {
        /// The file.
        file: String,
    },
    /// There is a header but no row below it.
    #[error("{file}: the record has a header but no rows; add one row of numbers per sample, from line 2 on")]
    NoRows {
        /// The file.
        file: String,
    },
    /// The format of the file is not supported.
    #[error(
        "{file}: the format is not recognised (supported: {formats}); in Python, \
         pandas.DataFrame(dict(time_s=t, voltage_v=u, displacement_um=y)).to_csv(\"record.csv\", index=False) writes a record",
        formats = FORMATS
    )]
    UnknownFormat {
        /// The file.
        file: String,
    },
    /// A file of a supported format that is damaged or does not hold columns of numbers.
    #[error("{file}: {format}: {what}")]
    Damaged {
        /// The file.
        file: String,
        /// The format, such as `MATLAB 5`.
        format: &'static str,
        /// What is wrong, and what to do.
        what: String,
    },
    /// A text without rows of numbers.
    #[error(
        "{file}: no row of numbers was found; a record has one row per sample, with the same number of columns in each row"
    )]
    NoNumbers {
        /// The file.
        file: String,
    },
    /// Needed columns are missing, ambiguous, or have an unknown unit.
    #[error("{file}: {problems}; {advice}{}", options_hint(options))]
    Columns {
        /// The file and the line of its header.
        file: String,
        /// Every problem.
        problems: String,
        /// What to do.
        advice: String,
        /// The options to type if the columns and units are right; empty if they are not known.
        options: String,
        /// The number of columns of the file.
        columns: usize,
    },
    /// More than half of the values of a column are missing.
    #[error(
        "{file}, column \"{column}\": {missing} of {rows} rows have no value; select another column with --map NAME=COLUMN, or complete the file"
    )]
    MostlyMissing {
        /// The file.
        file: String,
        /// The column.
        column: String,
        /// Rows without a value.
        missing: usize,
        /// Rows of the file.
        rows: usize,
    },
    /// `--map` names a column that the file does not have.
    #[error("{file}: --map {canonical}={column} names a column that is not in the file (columns found: {found}){hint}")]
    MappedColumnMissing {
        /// The file.
        file: String,
        /// The left side of the mapping.
        canonical: String,
        /// The right side of the mapping.
        column: String,
        /// The header's names.
        found: String,
        /// A hint, or empty.
        hint: String,
    },
    /// A row has more or fewer fields than the header.
    #[error(
        "{file}, line {line}: {found} fields, but the header has {expected} columns (the last is \"{column}\"); complete or remove the row{hint}"
    )]
    RaggedRow {
        /// The file.
        file: String,
        /// The line.
        line: u64,
        /// Fields in this row.
        found: usize,
        /// Columns of the header.
        expected: usize,
        /// The header's last column.
        column: String,
        /// A hint, or empty.
        hint: &'static str,
    },
    /// A field is not a number.
    #[error(
        "{file}, {place}, column \"{column}\": \"{text}\" is not a number; \
         write it as 1.25 or 1.25e-3, or leave the cell empty if the value is unknown"
    )]
    NotANumber {
        /// The file.
        file: String,
        /// The row.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The text of the cell, shortened.
        text: String,
    },
    /// A value is NaN or infinite.
    #[error(
        "{file}, {place}, column \"{column}\": the value is {value}, not a finite number; \
         correct it, or remove the row and give the rows before and after it different integers in the column \"segment\""
    )]
    NotFinite {
        /// The file.
        file: String,
        /// The row.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The value.
        value: String,
    },
    /// A temperature below absolute zero.
    #[error(
        "{file}, {place}, column \"{column}\": {value} degC is below absolute zero (-273.15 degC); \
         correct the value or the unit, or remove the column"
    )]
    TooCold {
        /// The file.
        file: String,
        /// The row.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The value.
        value: String,
    },
    /// A segment label is not an integer.
    #[error("{file}, {place}, column \"{column}\": \"{text}\" is not an integer; number the segments 0, 1, 2 …")]
    SegmentNotInteger {
        /// The file.
        file: String,
        /// The row.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The text of the cell, shortened.
        text: String,
    },
    /// A segment label appears again after another label.
    #[error(
        "{file}, {place}, column \"{column}\": segment {label} returns after segment {previous}; \
         the rows of a segment must be contiguous: sort the rows, or give the later rows a new label"
    )]
    SegmentReturns {
        /// The file.
        file: String,
        /// The row.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The label that appears again.
        label: i64,
        /// The label of the row before.
        previous: i64,
    },
    /// Time does not increase.
    #[error(
        "{file}, {place}, column \"{column}\": time must increase from row to row and across segments, but {found} s follows {previous} s; \
         if another run begins there, split the file; if the times have too few decimals, give the sample rate with --rate HZ"
    )]
    TimeNotIncreasing {
        /// The file.
        file: String,
        /// The row.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The time of the row before \[s\].
        previous: String,
        /// The time of this row \[s\].
        found: String,
    },
    /// The rows of a segment are not evenly spaced in time.
    #[error(
        "{file}, {place}, column \"{column}\": uneven time step: expected {expected} s, found {found} s; \
         if the times are rounded, write more decimals; if the actuator rested before this row, give the rows before and after the pause \
         different integers in a column \"segment\"; otherwise resample to even steps"
    )]
    UnevenTime {
        /// The file.
        file: String,
        /// The first row that is not on the grid.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The time of the even grid \[s\].
        expected: String,
        /// The time found \[s\].
        found: String,
    },
    /// Two segments have different sample periods, but one period is needed.
    #[error(
        "{file}: {why} needs one sample period, but segment {label} has {period:.9} s and segment {other_label} {other_period:.9} s; \
         write the segments of each sample period to a separate file"
    )]
    MixedPeriods {
        /// The files.
        file: String,
        /// A segment.
        label: i64,
        /// Its sample period \[s\].
        period: f64,
        /// The first segment.
        other_label: i64,
        /// Its sample period \[s\].
        other_period: f64,
        /// What needs one sample period.
        why: String,
    },
    /// No segment has two rows, so there is no sample period.
    #[error(
        "{file}, {place}, column \"{column}\": no segment has two rows, so there is no sample period; a record needs at least two rows in a segment"
    )]
    TooShort {
        /// The file.
        file: String,
        /// The last row.
        place: Place,
        /// The column's name in the file.
        column: String,
    },
    /// Columns given in memory differ in length.
    #[error(
        "{name}, column \"{column}\": {found} values, but \"time_s\" has {expected}; give every column one value per time"
    )]
    Lengths {
        /// The record.
        name: String,
        /// The column.
        column: String,
        /// Its length.
        found: usize,
        /// The length of the time column.
        expected: usize,
    },
    /// The command needs a column that this record does not have.
    #[error("{file}: the column \"{column}\" is needed here ({why}); add it, or name it with --map {column}=COLUMN")]
    Needed {
        /// The file.
        file: String,
        /// The column.
        column: String,
        /// Why the column is needed.
        why: String,
    },
    /// The records to be joined have different columns.
    #[error(
        "{file}, line 1: {what} is {found}, but {other_file} has {expected}; join only records with the same columns"
    )]
    Unlike {
        /// The file that differs.
        file: String,
        /// The first file.
        other_file: String,
        /// What differs, such as `the output column`.
        what: &'static str,
        /// Its value in the file that differs.
        found: String,
        /// Its value in the first file.
        expected: String,
    },
    /// There is no record to join.
    #[error("no record was given")]
    Nothing,
}

fn options_hint(options: &str) -> String {
    if options.is_empty() { String::new() } else { format!("; if the columns and units are right: {options}") }
}
