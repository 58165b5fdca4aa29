//! A checked record: its columns, segments and files.

use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::error::RecordError;
use super::grid::Period;
use super::losses::Losses;
use super::unit::OutputUnit;

/// The file that rows come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// The path of the file as given by the user, or the name of a record made in memory.
    pub name: String,
    /// SHA-256 of the file's bytes in lower-case hexadecimal digits; `None` for a record made in memory.
    pub sha256: Option<String>,
}

/// A checked record of one or more files; see the [module](super).
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    pub(super) sources: Vec<Source>,
    pub(super) labelled: bool,
    pub(super) labels: Vec<i64>,
    pub(super) segments: Vec<Range<usize>>,
    pub(super) file_of_segment: Vec<usize>,
    /// The sample period of each segment.
    pub(super) periods: Vec<Period>,
    pub(super) time: Vec<f64>,
    pub(super) input_column: String,
    pub(super) input: Option<Vec<f64>>,
    pub(super) output: Option<(OutputUnit, Vec<f64>)>,
    pub(super) temperature: Option<Vec<f64>>,
    pub(super) load: Option<Vec<f64>>,
    pub(super) lost: Losses,
    /// True for rows whose output is missing; empty if no output is missing.
    pub(super) missing: Vec<bool>,
    /// Whether the values were resampled to even times.
    #[serde(default)]
    pub(super) resampled: bool,
    /// The changes that were made while reading the file.
    pub(super) notes: Vec<String>,
    /// The text of the file, from which its columns are written again unchanged.
    #[serde(skip)]
    pub(super) text: Option<Text>,
}

/// The bytes of a text file, and the start of the text after a byte-order mark.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub(super) bytes: Arc<Vec<u8>>,
    pub(super) start: usize,
}

impl Text {
    pub(super) fn as_bytes(&self) -> &[u8] {
        self.bytes.get(self.start..).unwrap_or_default()
    }
}

impl Record {
    /// Returns a copy with another input of the same length.
    pub(crate) fn driven_by(&self, input: Vec<f64>) -> Self {
        Self { input: Some(input), ..self.clone() }
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
