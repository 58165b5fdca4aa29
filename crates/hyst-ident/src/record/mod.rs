//! Records: measured time series of an actuator (input, output, temperature, load).
//!
//! The record format is a CSV file with one header line. Column names end in their unit: `segment` (integer, optional;
//! the actuator rests and its state resets between segments), `time_s|time_ms|time_us`, the input `voltage_v` (or
//! another quantity, such as `force_in_n`), one output (`displacement_um|_nm|_mm` or `force_n`), and optionally
//! `temperature_degc` and `load_n`. Further columns are copied unchanged. Time increases across segments. Within a
//! segment the time steps are equal to the last printed digit. Each segment may have its own sample period.
//!
//! Other file formats are read in three steps: `source` finds the columns of a file, `roles` assigns a role to each
//! column, and `repair` produces evenly spaced rows. [`Record::notes`] lists every change.
//!
//! Reading checks these rules. A [`Record`] has finite values, increasing time, at least one row and columns of equal
//! length.

mod columns;
mod error;
mod grid;
mod heading;
mod join;
mod log;
mod read;
mod repair;
mod roles;
mod sink;
mod source;
mod survey;
#[cfg(test)]
mod tests;
mod unit;
mod write;

use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

pub use columns::{ColumnMap, MapError, Need, is_input_column};
pub use error::{Place, RecordError};
pub use log::{EVENTS, LogEvent, LogRecords, LogSample, Losses, RunLog, TOPIC, is_log};
pub use read::Reading;
pub use sink::FileKind;
pub use survey::{Channel, MAX_CHANNELS, Survey};
pub use unit::{OutputUnit, Quantity};
pub use write::{Extra, WriteError};

use grid::{Fault, Printed};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// The file that rows come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// The path of the file as given by the user, or the name of a record made in memory.
    pub name: String,
    /// SHA-256 of the file's bytes in lower-case hexadecimal digits; `None` for a record made in memory.
    pub sha256: Option<String>,
}

/// A column of a table in memory, for [`Record::from_table`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableColumn {
    /// The heading, with or without a unit: `Voltage [mV]`.
    pub name: String,
    /// The unit, if the heading does not state it.
    pub unit: Option<String>,
    /// The values; NaN where a value is missing.
    pub values: Vec<f64>,
}

/// Columns in memory for [`Record::from_samples`]. All have the length of `time`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// The name of the record in messages and in the models that are fitted to it.
    pub name: String,
    /// The segment label of each row; `None` makes one segment of all rows.
    pub segment: Option<Vec<i64>>,
    /// Time \[s\].
    pub time: Vec<f64>,
    /// The column name of the input, with its unit; empty means `voltage_v`.
    pub input_column: String,
    /// The input, in the unit of its column.
    pub input: Option<Vec<f64>>,
    /// The output and its unit.
    pub output: Option<(OutputUnit, Vec<f64>)>,
    /// Temperature \[°C\].
    pub temperature: Option<Vec<f64>>,
    /// External load \[N\].
    pub load: Option<Vec<f64>>,
}

/// A checked record of one or more files; see the [module](self).
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    sources: Vec<Source>,
    labelled: bool,
    labels: Vec<i64>,
    segments: Vec<Range<usize>>,
    file_of_segment: Vec<usize>,
    /// The sample period of each segment.
    periods: Vec<grid::Period>,
    time: Vec<f64>,
    input_column: String,
    input: Option<Vec<f64>>,
    output: Option<(OutputUnit, Vec<f64>)>,
    temperature: Option<Vec<f64>>,
    load: Option<Vec<f64>>,
    lost: Losses,
    /// True for rows whose output is missing; empty if no output is missing.
    missing: Vec<bool>,
    /// Whether the values were resampled to even times.
    #[serde(default)]
    resampled: bool,
    /// The changes that were made while reading the file.
    notes: Vec<String>,
    /// The text of the file, from which its columns are written again unchanged.
    #[serde(skip)]
    text: Option<Text>,
}

/// The bytes of a text file, and the start of the text after a byte-order mark.
#[derive(Clone, Debug)]
struct Text {
    bytes: Arc<Vec<u8>>,
    start: usize,
}

impl Text {
    fn as_bytes(&self) -> &[u8] {
        self.bytes.get(self.start..).unwrap_or_default()
    }
}

/// Absolute zero \[°C\]. Lower temperatures are refused.
pub const ABSOLUTE_ZERO: f64 = -273.15;

impl Record {
    /// Makes a record from columns in memory.
    ///
    /// # Errors
    /// If columns differ in length, a value is not finite, time is uneven or does not increase, or a segment label
    /// appears again after another label. Messages name the row.
    pub fn from_samples(samples: Columns) -> Result<Self, RecordError> {
        let rows = samples.time.len();
        let (input, output) = (samples.input.as_deref(), samples.output.as_ref());
        let input_column = if samples.input_column.is_empty() { "voltage_v" } else { &samples.input_column };
        let columns = [
            ("time_s", Some(samples.time.as_slice())),
            (input_column, input),
            (output.map_or("", |(unit, _)| unit.column()), output.map(|(_, y)| y.as_slice())),
            ("temperature_degc", samples.temperature.as_deref()),
            ("load_n", samples.load.as_deref()),
        ];
        let lengths = columns.iter().map(|(column, values)| (*column, values.map(<[f64]>::len)));
        let labels = std::iter::once(("segment", samples.segment.as_ref().map(Vec::len)));
        for (column, found) in lengths.chain(labels) {
            if let Some(found) = found.filter(|found| *found != rows) {
                let (name, column) = (samples.name, column.to_owned());
                return Err(RecordError::Lengths { name, column, found, expected: rows });
            }
        }
        for (column, values) in columns {
            if let Some(row) = values.and_then(|values| values.iter().position(|v| !v.is_finite())) {
                return Err(RecordError::NotFinite {
                    file: samples.name.clone(),
                    place: Place::Row(row),
                    column: column.to_owned(),
                    value: values.map_or(f64::NAN, |values| values[row]).to_string(),
                });
            }
        }
        let coldest =
            |values: &Vec<f64>| values.iter().position(|degc| *degc < ABSOLUTE_ZERO).map(|row| (row, values[row]));
        if let Some((row, degc)) = samples.temperature.as_ref().and_then(coldest) {
            return Err(RecordError::TooCold {
                file: samples.name,
                place: Place::Row(row),
                column: "temperature_degc".into(),
                value: degc.to_string(),
            });
        }
        let origin = Origin { time_column: "time_s", segment_column: "segment", place: &Place::Row };
        Self::assemble(samples, Printed::EXACT, None, &origin)
    }

    /// Returns a copy with another input of the same length.
    pub(crate) fn driven_by(&self, input: Vec<f64>) -> Self {
        Self { input: Some(input), ..self.clone() }
    }

    /// Makes a record from finite columns of equal length. `periods` are the sample periods of the segments, if known.
    fn assemble(
        samples: Columns,
        printed: Printed,
        periods: Option<Vec<grid::Period>>,
        origin: &Origin<'_>,
    ) -> Result<Self, RecordError> {
        let Columns { name, segment, mut time, mut input_column, input, output, temperature, load } = samples;
        if time.is_empty() {
            return Err(RecordError::NoRows { file: name });
        }
        let (labels, segments) = match &segment {
            Some(labels) => split(labels).map_err(|row| RecordError::SegmentReturns {
                file: name.clone(),
                place: (origin.place)(row),
                column: origin.segment_column.to_owned(),
                label: labels[row],
                previous: labels[row - 1],
            })?,
            None => (vec![0], std::iter::once(0..time.len()).collect()),
        };
        let decimals = usize::try_from(printed.decimals).unwrap_or(0).min(12);
        let seconds = |t: f64| format!("{t:.decimals$}");
        let place = origin.place;
        let (file, column) = (|| name.clone(), || origin.time_column.to_owned());
        if let Some(row) = (1..time.len()).find(|row| time[*row] <= time[row - 1]) {
            return Err(RecordError::TimeNotIncreasing {
                file: file(),
                place: place(row),
                column: column(),
                previous: seconds(time[row - 1]),
                found: seconds(time[row]),
            });
        }
        let periods = periods.map_or_else(|| grid::fit(&time, &segments, printed), Ok);
        let periods = periods.map_err(|fault| match fault {
            Fault::Uneven { row, expected } => RecordError::UnevenTime {
                file: file(),
                place: place(row),
                column: column(),
                expected: seconds(expected),
                found: seconds(time[row]),
            },
            Fault::TooShort => RecordError::TooShort { file: file(), place: place(time.len() - 1), column: column() },
        })?;
        for (rows, period) in segments.iter().zip(&periods) {
            let start = time[rows.start];
            for (k, t) in time[rows.clone()].iter_mut().enumerate() {
                *t = start + k as f64 * period.value;
            }
        }
        if input_column.is_empty() {
            input_column.push_str("voltage_v");
        }
        Ok(Self {
            sources: vec![Source { name, sha256: None }],
            labelled: segment.is_some(),
            file_of_segment: vec![0; segments.len()],
            labels,
            segments,
            periods,
            time,
            input_column,
            input,
            output,
            temperature,
            load,
            lost: Losses::default(),
            missing: Vec::new(),
            resampled: false,
            notes: Vec::new(),
            text: None,
        })
    }

    /// Makes a record from a table in memory.
    ///
    /// The columns are processed like those of a file: roles and units come from the headings or from `how`, missing
    /// values and uneven times are repaired.
    ///
    /// # Errors
    /// Those of [`read`](Self::read); messages name the row.
    pub fn from_table(
        name: &str,
        columns: Vec<TableColumn>,
        how: impl Into<Reading>,
        need: Need,
    ) -> Result<Self, RecordError> {
        let rows = columns.first().map_or(0, |column| column.values.len());
        if let Some(odd) = columns.iter().find(|column| column.values.len() != rows) {
            let (name, column) = (name.to_owned(), odd.name.clone());
            return Err(RecordError::Lengths { name, column, found: odd.values.len(), expected: rows });
        }
        let mut table = source::Table::new("table in memory");
        for TableColumn { name, unit, values } in columns {
            table.push(source::Head { unit, ..source::Head::new(name) }, values);
        }
        read::of_contents(name, &table, &how.into(), need)
    }

    /// Sets the SHA-256 of the file that holds the record.
    ///
    /// Models that are fitted to the record store this checksum.
    pub fn kept_as(self, file: &[u8]) -> Self {
        self.kept_with(sum_of(file))
    }

    fn kept_with(mut self, sum: String) -> Self {
        if let [source] = self.sources.as_mut_slice() {
            source.sha256 = Some(sum);
        }
        self
    }

    /// Sets the SHA-256 of the file at `path`, which is read in blocks.
    fn kept_in(self, path: &Path) -> Result<Self, RecordError> {
        let io = |source| RecordError::Io { file: path.display().to_string(), source };
        let mut sum = Sha256::new();
        std::io::copy(&mut std::fs::File::open(path).map_err(io)?, &mut sum).map_err(io)?;
        Ok(self.kept_with(format!("{:x}", sum.finalize())))
    }

    /// Returns the files that the rows come from, in order.
    ///
    /// There is one file, unless records were [joined](Self::join).
    pub fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Returns whether the times were uneven and the values were resampled to even times.
    ///
    /// A note states the size of the jitter.
    pub fn resampled(&self) -> bool {
        self.resampled
    }

    /// Returns what is missing from the logs that the record was read from.
    pub fn lost(&self) -> Losses {
        self.lost
    }

    /// Returns the changes made while reading, one sentence each.
    ///
    /// Examples are converted units, omitted rows and resampled times.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Returns true for rows whose output is missing in the file; empty if no output is missing.
    ///
    /// The output of these rows is interpolated. It is not a measurement.
    pub fn missing(&self) -> &[bool] {
        &self.missing
    }

    /// Returns the names of all sources, joined with " + " for messages.
    pub fn name(&self) -> String {
        self.sources.iter().map(|source| source.name.as_str()).collect::<Vec<_>>().join(" + ")
    }

    /// Returns the number of rows of all segments; at least two.
    pub fn rows(&self) -> usize {
        self.time.len()
    }

    /// Returns the rows of each segment, in order and contiguous.
    ///
    /// The actuator is at rest at the start of each segment.
    pub fn segments(&self) -> &[Range<usize>] {
        &self.segments
    }

    /// Returns the label of each segment in its file; 0 if the file has no column `segment`.
    pub fn labels(&self) -> &[i64] {
        &self.labels
    }

    /// Returns for each segment the index of its file in [`sources`](Self::sources).
    pub fn file_of_segment(&self) -> &[usize] {
        &self.file_of_segment
    }

    /// Returns the rows of each file, in the order of [`sources`](Self::sources).
    pub fn rows_of_files(&self) -> Vec<Range<usize>> {
        let mut files: Vec<Range<usize>> = Vec::with_capacity(self.sources.len());
        for (rows, file) in self.segments.iter().zip(&self.file_of_segment) {
            match files.get_mut(*file) {
                Some(known) => known.end = rows.end,
                None => files.push(rows.clone()),
            }
        }
        files
    }

    /// Returns the shortest sample period of any segment \[s\], as accurate as the printed digits allow.
    pub fn sample_period(&self) -> f64 {
        self.periods.iter().map(|period| period.value).fold(f64::INFINITY, f64::min)
    }

    /// Returns the sample period of each segment \[s\].
    pub fn sample_periods(&self) -> Vec<f64> {
        self.periods.iter().map(|period| period.value).collect()
    }

    /// Returns the sample period \[s\] that all segments share.
    ///
    /// `why` is the subject of "needs one sample period" in the error.
    ///
    /// # Errors
    /// If two segments have different sample periods.
    pub fn need_one_sample_period(&self, why: &str) -> Result<f64, RecordError> {
        let first = self.periods[0].value;
        match self.periods.iter().position(|period| period.value != first) {
            None => Ok(first),
            Some(other) => Err(RecordError::MixedPeriods {
                file: self.name(),
                label: self.labels[other],
                period: self.periods[other].value,
                other_label: self.labels[0],
                other_period: first,
                why: why.to_owned(),
            }),
        }
    }

    /// Returns the time \[s\].
    ///
    /// In each segment the first value is as printed and the following values are on an even grid, without rounding
    /// jitter. In a joined record each file keeps its own time origin.
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// Returns the column name of the input with its unit, such as `voltage_v` or `force_in_n`.
    pub fn input_column(&self) -> &str {
        &self.input_column
    }

    /// Returns the input in the unit of [`input_column`](Self::input_column).
    ///
    /// It is empty if the record was read as a reference.
    pub fn input(&self) -> &[f64] {
        self.input.as_deref().unwrap_or_default()
    }

    /// Returns the measured output (or the reference) in [`output_unit`](Self::output_unit).
    pub fn output(&self) -> Option<&[f64]> {
        self.output.as_ref().map(|(_, values)| values.as_slice())
    }

    /// Returns the unit of the output, if the record has an output.
    pub fn output_unit(&self) -> Option<OutputUnit> {
        self.output.as_ref().map(|(unit, _)| *unit)
    }

    /// Returns the temperature \[°C\], if it was measured.
    pub fn temperature(&self) -> Option<&[f64]> {
        self.temperature.as_deref()
    }

    /// Returns the external load \[N\], if it was measured.
    pub fn load(&self) -> Option<&[f64]> {
        self.load.as_deref()
    }

    /// Returns the temperature \[°C\] or an error if it is missing. `why` completes "is needed here (…)".
    ///
    /// # Errors
    /// If the record has no temperature.
    pub fn need_temperature(&self, why: &str) -> Result<&[f64], RecordError> {
        self.temperature().ok_or_else(|| self.column_needed("temperature_degc", why))
    }

    /// Returns the load \[N\] or an error if it is missing. `why` completes "is needed here (…)".
    ///
    /// # Errors
    /// If the record has no load.
    pub fn need_load(&self, why: &str) -> Result<&[f64], RecordError> {
        self.load().ok_or_else(|| self.column_needed("load_n", why))
    }

    /// Returns the output in `unit` or an error if it is missing. `why` completes "is needed here (…)".
    ///
    /// # Errors
    /// If the record has no output, or the output has another unit.
    pub fn need_output(&self, unit: OutputUnit, why: &str) -> Result<&[f64], RecordError> {
        match &self.output {
            Some((found, values)) if *found == unit => Ok(values),
            _ => Err(self.column_needed(unit.column(), why)),
        }
    }

    fn column_needed(&self, column: &str, why: &str) -> RecordError {
        RecordError::Needed { file: self.name(), column: column.to_owned(), why: why.to_owned() }
    }
}

/// The names of columns and the places of rows in messages.
struct Origin<'a> {
    time_column: &'a str,
    segment_column: &'a str,
    place: &'a dyn Fn(usize) -> Place,
}

/// Splits rows by their labels. The error is the row at which an earlier label appears again.
fn split(labels: &[i64]) -> Result<(Vec<i64>, Vec<Range<usize>>), usize> {
    let mut seen = HashSet::new();
    let (mut of_segment, mut segments) = (Vec::new(), Vec::new());
    let mut row = 0;
    for run in labels.chunk_by(|a, b| a == b) {
        if !seen.insert(run[0]) {
            return Err(row);
        }
        of_segment.push(run[0]);
        segments.push(row..row + run.len());
        row += run.len();
    }
    Ok((of_segment, segments))
}

/// Returns the SHA-256 of the bytes of a file, in hexadecimal digits.
fn sum_of(file: &[u8]) -> String {
    format!("{:x}", Sha256::digest(file))
}
