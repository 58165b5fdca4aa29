//! What a file holds, for somebody who looks at it: format, channels, and the record in them.

use std::path::Path;

use super::columns::{ColumnMap, Need};
use super::error::RecordError;
use super::heading::{Heading, Unit};
use super::log::is_run_log;
use super::read::{Found, Reading, with_layout};
use super::roles::{Clock, File, Layout, mapped};
use super::source::{self, Contents};
use super::unit::TimeUnit;
use super::{Record, RunLog};
use crate::noise::quantisation;
use crate::samples::range;

/// A column of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name, as `--map` takes it.
    pub name: String,
    /// Its unit, where heading or file state one that is known.
    pub unit: Option<&'static str>,
    /// Rows.
    pub rows: usize,
    /// Rows without a value.
    pub missing: usize,
    /// Smallest and largest value, in its unit.
    pub range: Option<(f64, f64)>,
    /// Smallest difference between two values, in its unit; 0 where all are one.
    pub step: f64,
    /// What the record takes it for: `segment`, `time`, `input`, `output`, `temperature` or `load`.
    pub role: Option<&'static str>,
    /// The unit that `--map` gives it, where the file states none or `--map` scales its values.
    pub mapped_unit: Option<&'static str>,
    /// How many of that unit one of the file's numbers is, if `--map` says so.
    pub scale: Option<f64>,
    /// Whether its unit is stated elsewhere in the file than in its name.
    pub unit_outside_name: bool,
}

/// What a file holds.
#[derive(Debug)]
pub struct Survey {
    /// The format, as `table of text, ';' between columns`.
    pub format: String,
    /// Its columns, in their order.
    pub channels: Vec<Channel>,
    /// Columns that hold text, with a cell of each.
    pub texts: Vec<(String, String)>,
    /// Where the times of the record come from, or would, as `the column "t"` or `the sample interval in the file`.
    pub times: Option<String>,
    /// The record, or why it is none yet.
    pub record: Result<Record, RecordError>,
}

/// Columns that are looked at; a file with more is listed in part.
pub const MAX_CHANNELS: usize = 200;

impl Survey {
    /// Looks at the file at `path`.
    ///
    /// # Errors
    /// When it cannot be read or has no columns.
    pub fn read(path: impl AsRef<Path>, how: &Reading) -> Result<Self, RecordError> {
        let path = path.as_ref();
        let file = path.display().to_string();
        if let Some(contents) = source::LargeText::open(path, &mut |_| {})? {
            return Self::of(&file, &contents, how);
        }
        let bytes = std::fs::read(path).map_err(|source| RecordError::Io { file: file.clone(), source })?;
        Self::parse(&file, &bytes, how)
    }

    /// As [`read`](Self::read), of the bytes of a file.
    ///
    /// # Errors
    /// As those of [`read`](Self::read).
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

    /// Looks at the columns of a file.
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
                // A rate or a clock that was named stands for it.
                let open = matches!(error, RecordError::Columns { .. }) && how.rate.is_none();
                let even = open && contents.heads().iter().any(|head| matches!(head.axis, source::Axis::Even { .. }));
                (Err(error), even.then(|| "the sample interval in the file".to_owned()))
            }
        };
        Ok(Self { format: contents.format(), channels, texts: contents.texts().to_vec(), times, record })
    }
}

/// Notes which channels a record is read from.
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

/// The same for what a map says of columns that are no record yet. A map that is wrong is said so by the error.
fn mark_mapped(channels: &mut [Channel], name: &str, contents: &dyn Contents, map: &ColumnMap) {
    let file =
        File { name, header: contents.header(), heads: contents.heads(), texts: contents.texts(), counters: &[] };
    for (role, choice) in mapped(&file, map).unwrap_or_default() {
        mark_one(channels, contents, (choice.column, role.word()), &choice.canonical, choice.factor);
    }
}

/// Notes the role of a channel, and the unit of its values that a map states.
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

/// Where times come from.
fn times(contents: &dyn Contents, how: &Reading, layout: &Layout) -> String {
    match layout.time {
        Clock::Column { column, .. } => {
            format!("the column \"{}\"", contents.heads().get(column).map_or("", |head| &head.name))
        }
        Clock::Even { .. } if how.rate.is_some() => "--rate".to_owned(),
        Clock::Even { .. } => "the sample interval in the file".to_owned(),
    }
}

/// A record with what a file has: input and output, or one of them if there is nothing else. If it is none, the reason is why it has
/// not both.
fn any<T>(
    rated: bool,
    read: impl Fn(Need) -> Result<T, RecordError>,
    record: impl Fn(&T) -> &Record,
) -> Result<T, RecordError> {
    read(Need::InputAndOutput).or_else(|error| match error {
        RecordError::Columns { columns, .. } => {
            // A record at a stated rate may have no column of times.
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
    /// How many columns of a file have a role.
    fn columns(&self) -> usize {
        let channels = [self.input.is_some(), self.output.is_some(), self.temperature.is_some(), self.load.is_some()];
        1 + usize::from(self.labelled) + channels.into_iter().filter(|there| *there).count()
    }

    /// Reads what a file has: input and output, or one of them.
    ///
    /// # Errors
    /// As those of [`read`](Self::read).
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
