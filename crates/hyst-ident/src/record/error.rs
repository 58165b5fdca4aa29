//! What can be wrong with a record. Every message says where, and what to do.

use std::fmt;

/// A row of a record, as its reader would look for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of a file; the first line is 1, so that the header usually is line 1.
    Line(u64),
    /// A row of a record that was made in memory; the first is 0.
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
        /// What the operating system said.
        source: std::io::Error,
    },
    /// An MCAP file that is no log of a run.
    #[error("{file}: {what}; records are read from logs that hystctl run --log writes, and from CSV files")]
    Log {
        /// The file.
        file: String,
        /// What is not as it should be.
        what: String,
    },
    /// A log without a row of the drive or reference that was asked for.
    #[error("{file}: the log has nothing of what was to be played: {what}")]
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
    #[error("{file}: the record has a header but no rows; rows of numbers have to follow it from line 2 on")]
    NoRows {
        /// The file.
        file: String,
    },
    /// The bytes are of no format that is read.
    #[error(
        "{file}: the format is not recognised (read are {formats}); in Python, pandas.DataFrame(dict(time_s=t, voltage_v=u, displacement_um=y)).to_csv(\"record.csv\", index=False) writes a record", formats = super::source::FORMATS
    )]
    UnknownFormat {
        /// The file.
        file: String,
    },
    /// A file of a known format that is damaged, or holds something else than columns.
    #[error("{file}: {format}: {what}")]
    Damaged {
        /// The file.
        file: String,
        /// The format, as `MATLAB 5`.
        format: &'static str,
        /// What is wrong, and what to do.
        what: String,
    },
    /// A text without rows of numbers.
    #[error(
        "{file}: no row of numbers was found; a record has a row for each sample, with the same number of columns in each"
    )]
    NoNumbers {
        /// The file.
        file: String,
    },
    /// Columns that are needed are missing, of unknown unit, or several.
    #[error("{file}: {problems}; {advice}{}", if_right(options))]
    Columns {
        /// The file and the line of its header.
        file: String,
        /// Every problem.
        problems: String,
        /// What to do.
        advice: String,
        /// The options to type if columns and units are right; empty where none are known.
        options: String,
        /// How many columns the file has.
        columns: usize,
    },
    /// A column has hardly any values.
    #[error(
        "{file}, column \"{column}\": {missing} of {rows} rows have no value; choose another column with --map, or repair the file"
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
        /// A further remark, or nothing.
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
        /// A further remark, or nothing.
        hint: &'static str,
    },
    /// A field is not a number.
    #[error(
        "{file}, {place}, column \"{column}\": \"{text}\" is not a number; write it as 1.25 or 1.25e-3, or leave the cell empty if the value is unknown"
    )]
    NotANumber {
        /// The file.
        file: String,
        /// The row.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// What stands there, shortened.
        text: String,
    },
    /// A value is NaN or infinite.
    #[error(
        "{file}, {place}, column \"{column}\": the value is {value}, not a finite number; repair the value, or give the rows before and after it different integers in \"segment\" and remove it"
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
    /// A temperature that no thing has.
    #[error(
        "{file}, {place}, column \"{column}\": {value} degC is below absolute zero, -273.15 degC; repair the sensor's value, or leave the column out"
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
        /// What stands there, shortened.
        text: String,
    },
    /// A segment label comes back after another one.
    #[error(
        "{file}, {place}, column \"{column}\": segment {label} returns after segment {previous}; the rows of a segment have to follow one another: sort them or give the later part a new label"
    )]
    SegmentReturns {
        /// The file.
        file: String,
        /// The row.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The label that comes back.
        label: i64,
        /// The label just before.
        previous: i64,
    },
    /// Time stands still or goes back.
    #[error(
        "{file}, {place}, column \"{column}\": time has to increase from row to row and across segments, but {found} s follows {previous} s; if another run begins there, split the file; if the times have too few decimals, give the sample rate with --rate"
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
        "{file}, {place}, column \"{column}\": uneven time: expected {expected} s, found {found} s; resample to even steps (or print more decimals, if it is only rounding), or, where the device rested in between, give the two parts different integers in a column \"segment\""
    )]
    UnevenTime {
        /// The file.
        file: String,
        /// The first row off the grid.
        place: Place,
        /// The column's name in the file.
        column: String,
        /// The time that the even grid has there \[s\].
        expected: String,
        /// The time found \[s\].
        found: String,
    },
    /// Two segments are sampled at different rates, where one rate is needed.
    #[error(
        "{file}: {why} needs one sample period, but segment {label} has {period:.9} s and segment {other_label} {other_period:.9} s; use the segments of one of them, in a file of their own"
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
        /// Who needs one.
        why: String,
    },
    /// No segment has two rows, so that there is no sample period.
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
        "{name}, column \"{column}\": {found} values, but \"time_s\" has {expected}; every column needs one value per time: find out which rows lack one"
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
        /// What for.
        why: String,
    },
    /// Records to be joined do not fit each other.
    #[error("{file}, line 1: {what} is {found}, but {other_file} has {expected}; join only records of the same kind")]
    Unlike {
        /// The file that differs.
        file: String,
        /// The first file.
        other_file: String,
        /// What differs, as `the output column`.
        what: &'static str,
        /// In the file that differs.
        found: String,
        /// In the first file.
        expected: String,
    },
    /// Nothing was given to join.
    #[error("no record was given")]
    Nothing,
}

fn if_right(options: &str) -> String {
    if options.is_empty() { String::new() } else { format!("; if the columns and units are right: {options}") }
}
