//! Makes a record of columns in memory and checks their lengths, values, labels and times.

use std::collections::HashSet;
use std::ops::Range;

use super::checked::{Record, Source};
use super::error::{Place, RecordError};
use super::grid::{self, Fault, Period, Printed};
use super::losses::Losses;
use super::unit::OutputUnit;

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

    /// Makes a record from finite columns of equal length. `periods` are the sample periods of the segments, if known.
    pub(super) fn assemble(
        samples: Columns,
        printed: Printed,
        periods: Option<Vec<Period>>,
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
}

/// The names of columns and the places of rows in messages.
pub(super) struct Origin<'a> {
    pub(super) time_column: &'a str,
    pub(super) segment_column: &'a str,
    pub(super) place: &'a dyn Fn(usize) -> Place,
}

/// Splits rows by their labels. The error is the row at which an earlier label appears again.
pub(super) fn split(labels: &[i64]) -> Result<(Vec<i64>, Vec<Range<usize>>), usize> {
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
