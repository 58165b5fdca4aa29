//! Survey of a file: its format, its columns and the record in them (`hystctl info`).

use std::path::Path;

use super::checked::Record;
use super::columns::{ColumnMap, Need, Reading};
use super::contents::{Found, MAX_CHANNELS, with_layout};
use super::error::RecordError;
use super::heading::{Heading, Unit};
use super::log::{RunLog, is_run_log};
use super::roles::{Clock, File, Layout, mapped};
use super::source::{self, Contents};
use super::unit::TimeUnit;
use crate::noise::quantisation;
use crate::statistics::range;

/// A column of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The name for `--map`.
    pub name: String,
    /// The unit, if the heading or the file states a known unit.
    pub unit: Option<&'static str>,
    /// The number of rows.
    pub rows: usize,
    /// The number of rows without a value.
    pub missing: usize,
    /// Minimum and maximum, in `unit`.
    pub range: Option<(f64, f64)>,
    /// Smallest difference between two values, in `unit`; 0 if all values are equal.
    pub step: f64,
    /// The role in the record: `segment`, `time`, `input`, `output`, `temperature` or `load`.
    pub role: Option<&'static str>,
    /// The unit that `--map` assigns, if the file states none or `--map` scales the values.
    pub mapped_unit: Option<&'static str>,
    /// The factor of `--map` from values in the file to `mapped_unit`, if given.
    pub scale: Option<f64>,
    /// Whether the file states the unit outside the name, for example in a row of units.
    pub unit_outside_name: bool,
}

/// The contents of a file.
#[derive(Debug)]
pub struct Survey {
    /// The format, such as `table of text, ';' between columns`.
    pub format: String,
    /// The columns of numbers, in the order of the file.
    pub channels: Vec<Channel>,
    /// The columns of text, each with an example of a cell.
    pub texts: Vec<(String, String)>,
    /// The source of the times, such as `the column "t"` or `the sample interval in the file`.
    pub times: Option<String>,
    /// The record, or the reason why the file does not make one.
    pub record: Result<Record, RecordError>,
}

impl Survey {
    /// Surveys the file at `path`.
    ///
    /// # Errors
    /// If the file cannot be read or has no columns.
    pub fn read(path: impl AsRef<Path>, how: &Reading) -> Result<Self, RecordError> {
        let path = path.as_ref();
        let file = path.display().to_string();
        if let Some(contents) = source::LargeText::open(path, &mut |_| {})? {
            return Self::of(&file, &contents, how);
        }
        let bytes = std::fs::read(path).map_err(|source| RecordError::Io { file: file.clone(), source })?;
        Self::parse(&file, &bytes, how)
    }

    /// Surveys the bytes of a file.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn parse(name: &str, bytes: &[u8], how: &Reading) -> Result<Self, RecordError> {
        if is_run_log(bytes) {
            let log = RunLog::parse(name, bytes)?;
            let text = log.csv(name, false)?;
            let survey = Self::parse(name, text.as_bytes(), how)?;
            let record = any(how.rate.is_some(), |need| Record::parse(name, bytes, how.clone(), need), |record| record);
            return Ok(Self { format: "MCAP log of a run".to_owned(), record, ..survey });
        }
        let unpacked = source::unpack(name, bytes)?;
        let contents = source::open(name, &unpacked)?;
        let survey = Self::of(name, contents.as_ref(), how)?;
        Ok(Self { record: survey.record.map(|record| record.kept_as(bytes)), ..survey })
    }

    /// Surveys the columns of a file.
    fn of(name: &str, contents: &dyn Contents, how: &Reading) -> Result<Self, RecordError> {
        let mut channels = channels(contents)?;
        let read = |need| with_layout(name, contents, how, need);
        let (record, times) = match any(how.rate.is_some(), read, |found| &found.record) {
            Ok(Found { record, layout, .. }) => {
                mark(&mut channels, contents, &layout);
                (Ok(record), Some(times(contents, how, &layout)))
            }
            Err(error) => {
                mark_mapped(&mut channels, name, contents, &how.map);
                // A rate overrides the sample interval in the file.
                let open = matches!(error, RecordError::Columns { .. }) && how.rate.is_none();
                let even = open && contents.heads().iter().any(|head| matches!(head.axis, source::Axis::Even { .. }));
                (Err(error), even.then(|| "the sample interval in the file".to_owned()))
            }
        };
        Ok(Self { format: contents.format(), channels, texts: contents.texts().to_vec(), times, record })
    }
}

/// Sets the roles of the channels that a record is read from.
fn mark(channels: &mut [Channel], contents: &dyn Contents, layout: &Layout) {
    let mut note =
        |column, role, canonical: &str, factor| mark_one(channels, contents, (column, role), canonical, factor);
    if let Some(column) = layout.segment {
        note(column, "segment", "", None);
    }
    if let Clock::Column { column, per_second } = layout.time {
        let unit = TimeUnit::ALL.into_iter().find(|unit| unit.per_second() == per_second);
        note(column, "time", unit.map_or("", TimeUnit::column), None);
    }
    let choices = [
        ("input", &layout.input),
        ("output", &layout.output),
        ("temperature", &layout.temperature),
        ("load", &layout.load),
    ];
    for (role, choice) in choices {
        if let Some(choice) = choice {
            note(choice.column, role, &choice.canonical, choice.factor);
        }
    }
}

/// Sets the roles of the channels that `map` names, if the file does not make a record. Errors of the map are reported
/// elsewhere.
fn mark_mapped(channels: &mut [Channel], name: &str, contents: &dyn Contents, map: &ColumnMap) {
    let file =
        File { name, header: contents.header(), heads: contents.heads(), texts: contents.texts(), counters: &[] };
    for (role, choice) in mapped(&file, map).unwrap_or_default() {
        mark_one(channels, contents, (choice.column, role.word()), &choice.canonical, choice.factor);
    }
}

/// Sets the role of a channel and the unit that a map assigns.
fn mark_one(
    channels: &mut [Channel],
    contents: &dyn Contents,
    (column, role): (usize, &'static str),
    canonical: &str,
    factor: Option<f64>,
) {
    let Some(channel) = channels.get_mut(column) else { return };
    channel.role = Some(role);
    channel.scale = factor.filter(|factor| *factor != -1.0);
    if channel.scale.is_some() || contents.heads().get(column).is_some_and(|head| !has_unit(head)) {
        channel.mapped_unit = Unit::of_canonical(canonical).map(|unit| unit.symbol);
    }
}

fn has_unit(head: &source::Head) -> bool {
    Heading::parse(&head.name, head.unit.as_deref()).unit.is_some()
}

/// Returns the source of the times.
fn times(contents: &dyn Contents, how: &Reading, layout: &Layout) -> String {
    match layout.time {
        Clock::Column { column, .. } => {
            format!("the column \"{}\"", contents.heads().get(column).map_or("", |head| &head.name))
        }
        Clock::Even { .. } if how.rate.is_some() => "--rate".to_owned(),
        Clock::Even { .. } => "the sample interval in the file".to_owned(),
    }
}

/// Reads a record with input and output, or with one of them if the file has no further columns.
///
/// # Errors
/// Those of a record with input and output.
fn any<T>(
    rated: bool,
    read: impl Fn(Need) -> Result<T, RecordError>,
    record: impl Fn(&T) -> &Record,
) -> Result<T, RecordError> {
    read(Need::InputAndOutput).or_else(|error| match error {
        RecordError::Columns { columns, .. } => {
            // A record with a given rate may have no time column.
            let whole = |read: &T| {
                let own = record(read).columns();
                own == columns || rated && own == columns + 1
            };
            read(Need::Input).ok().filter(whole).or_else(|| read(Need::Output).ok().filter(whole)).ok_or(error)
        }
        error => Err(error),
    })
}

impl Record {
    /// Returns the number of columns with a role.
    fn columns(&self) -> usize {
        let channels = [self.input.is_some(), self.output.is_some(), self.temperature.is_some(), self.load.is_some()];
        1 + usize::from(self.labelled) + channels.into_iter().filter(|there| *there).count()
    }

    /// Reads a record with input and output, or with one of them if the file has no further columns.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn read_any(path: impl AsRef<Path>, how: &Reading) -> Result<Self, RecordError> {
        any(how.rate.is_some(), |need| Self::read(path.as_ref(), how.clone(), need), |record| record)
    }
}

fn channels(contents: &dyn Contents) -> Result<Vec<Channel>, RecordError> {
    let heads = &contents.heads()[..contents.heads().len().min(MAX_CHANNELS)];
    let all: Vec<usize> = (0..heads.len()).collect();
    let values = contents.values(source::Wanted::all(&all))?;
    let channel = |(head, values): (&source::Head, source::Values)| {
        let there: Vec<f64> = values.numbers.iter().copied().filter(|value| value.is_finite()).collect();
        let (low, high) = range(there.iter().copied());
        Channel {
            name: head.name.clone(),
            unit: Heading::parse(&head.name, head.unit.as_deref()).unit.map(|unit| unit.symbol),
            rows: values.numbers.len(),
            missing: values.numbers.len() - there.len(),
            range: (!there.is_empty()).then_some((low, high)),
            step: quantisation(&there) * 12f64.sqrt(),
            role: None,
            mapped_unit: None,
            scale: None,
            unit_outside_name: Heading::parse(&head.name, None).unit.is_none() && has_unit(head),
        }
    };
    Ok(heads.iter().zip(values).map(channel).collect())
}
