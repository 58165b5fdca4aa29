//! Reading records from files.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use super::ABSOLUTE_ZERO;
use super::columns::{ColumnMap, Need};
use super::error::{Place, RecordError};
use super::grid::Printed;
use super::heading::{Dimension, Heading, Unit};
use super::log::is_run_log;
use super::repair::{place_of, repair};
use super::roles::{Choice, Clock, File, Layout};
use super::source::{self, Axis, Contents, Values, Wanted};
use super::survey::MAX_CHANNELS;
use super::unit::OutputUnit;
use super::{Columns, Origin, Record, Text, sum_of};

/// How a file is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// The columns whose role or unit the headings do not state.
    pub map: ColumnMap,
    /// The sample rate of files without times \[Hz\]. If it is given, times in the file are ignored.
    pub rate: Option<f64>,
}

impl From<&ColumnMap> for Reading {
    fn from(map: &ColumnMap) -> Self {
        Self { map: map.clone(), rate: None }
    }
}

impl Record {
    /// Reads and checks the file at `path`. The format is detected from its content.
    ///
    /// # Errors
    /// If the file cannot be read, or the column of a role is missing or ambiguous. The message states the file, line
    /// and column and what to do.
    pub fn read(path: impl AsRef<Path>, how: impl Into<Reading>, need: Need) -> Result<Self, RecordError> {
        Self::read_watched(path, how, need, &mut |_| {})
    }

    /// Reads as [`read`](Self::read) does and reports progress.
    ///
    /// `watch` is called with the share of a large file that has been read. A text of more than 256 MB is read in
    /// blocks. If it has more than two million rows, groups of rows are averaged into one, so memory does not grow with
    /// the size of the file.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn read_watched(
        path: impl AsRef<Path>,
        how: impl Into<Reading>,
        need: Need,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Self, RecordError> {
        let path = path.as_ref();
        if let Some(contents) = source::LargeText::open(path, watch)? {
            let record = of_contents(&path.display().to_string(), &contents, &how.into(), need)?;
            return record.kept_in(path);
        }
        let file = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|source| RecordError::Io { file: file.clone(), source })?;
        Self::parse_bytes(&file, Cow::Owned(bytes), &how.into(), need)
    }

    /// Reads the bytes of a file as [`read`](Self::read) does. `name` is the file name in messages.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn parse(name: &str, bytes: &[u8], how: impl Into<Reading>, need: Need) -> Result<Self, RecordError> {
        Self::parse_bytes(name, Cow::Borrowed(bytes), &how.into(), need)
    }

    /// The bytes of a text are kept without a copy if they are owned.
    fn parse_bytes(name: &str, bytes: Cow<'_, [u8]>, how: &Reading, need: Need) -> Result<Self, RecordError> {
        if is_run_log(&bytes) {
            return Self::parse_log(name, &bytes, &how.map, need);
        }
        // The checksum takes as long as parsing, so both run in parallel.
        let (found, sum) = rayon::join(
            || {
                let unpacked = source::unpack(name, &bytes)?;
                let contents = source::open(name, &unpacked)?;
                let found = with_layout(name, contents.as_ref(), how, need)?;
                // A UTF-8 text is kept as part of the bytes of the file; of other encodings the decoded text is kept.
                let text = contents.plain_text().filter(|_| found.is_plain).map(|text| {
                    let start = unpacked.len().saturating_sub(text.len());
                    if unpacked.ends_with(text.as_bytes()) { Ok(start) } else { Err(text.as_bytes().to_vec()) }
                });
                drop(contents);
                let unpacked = if let Cow::Owned(unpacked) = unpacked { Some(unpacked) } else { None };
                Ok((found.record, text, unpacked))
            },
            || sum_of(&bytes),
        );
        let (mut record, text, unpacked): (Self, _, _) = found?;
        record.text = text.map(|text| match text {
            Ok(start) => Text { bytes: Arc::new(unpacked.unwrap_or_else(|| bytes.into_owned())), start },
            Err(decoded) => Text { bytes: Arc::new(decoded), start: 0 },
        });
        Ok(record.kept_with(sum))
    }
}

/// Makes a record of the columns of a file.
pub(super) fn of_contents(
    name: &str,
    contents: &dyn Contents,
    how: &Reading,
    need: Need,
) -> Result<Record, RecordError> {
    Ok(with_layout(name, contents, how, need)?.record)
}

/// A record and the columns that it was read from.
pub(super) struct Found {
    pub(super) record: Record,
    /// The columns that it was read from.
    pub(super) layout: Layout,
    /// Whether the rows of the record are those of the text, so that further columns can be copied unchanged.
    is_plain: bool,
}

/// Makes a record of the columns of a file, and returns also the columns that it was read from.
pub(super) fn with_layout(
    name: &str,
    contents: &dyn Contents,
    how: &Reading,
    need: Need,
) -> Result<Found, RecordError> {
    if let Some(rate) = how.rate.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
        let problems = format!("the sample rate is {rate} Hz");
        let advice = "give a positive number of samples per second, for example --rate 1000".to_owned();
        return Err(RecordError::Columns {
            file: name.to_owned(),
            problems,
            advice,
            options: String::new(),
            columns: 0,
        });
    }
    let heads = contents.heads();
    let file = File { name, header: contents.header(), heads, texts: contents.texts(), counters: &[] };
    let layout = match Layout::resolve(&file, &how.map, need, how.rate) {
        // The message proposes columns. Row counters are excluded from the proposals.
        Err(RecordError::Columns { .. }) => {
            let counters = counters(contents).unwrap_or_default();
            Layout::resolve(&File { counters: &counters, ..file }, &how.map, need, how.rate)?
        }
        resolved => resolved?,
    };
    let column = |at: usize| heads[at].name.as_str();

    // The time comes first.
    let clock = match layout.time {
        Clock::Column { column, .. } => Some(column),
        Clock::Even { .. } => None,
    };
    let choices = [&layout.input, &layout.output, &layout.temperature, &layout.load];
    let chosen = choices.map(|choice| choice.as_ref().map(|choice| choice.column));
    let wanted: Vec<usize> = [clock].into_iter().chain([layout.segment]).chain(chosen).flatten().collect();
    let asked = Wanted {
        columns: &wanted,
        time: clock.map(|_| 0),
        segment: layout.segment.map(|_| usize::from(clock.is_some())),
    };
    let mut read = contents.values(asked)?.into_iter();
    // Values arrive in the order of the request.
    let mut next = |asked: bool| if asked { read.next() } else { None };
    let time = next(clock.is_some());
    let labels = next(layout.segment.is_some());
    let mut values = choices.map(|choice| next(choice.is_some()).map(|values| values.numbers));
    for (choice, values) in choices.into_iter().zip(&mut values) {
        if let (Some(choice), Some(values)) = (choice, values) {
            convert(choice, values);
        }
    }
    let notes = align_to_output(contents, &layout, &mut values)?;
    let [input, output, temperature, load] = values;
    let rows = output.as_ref().or(input.as_ref()).map_or(0, Vec::len);
    let (mut time, mut printed) = match (time, &layout.time) {
        (Some(Values { numbers, mut printed }), Clock::Column { per_second, .. }) => {
            printed.decimals += per_second.log10().round() as i32;
            let exact = *per_second >= 1.0 && per_second.log10().fract() == 0.0;
            let mut seconds = numbers;
            if *per_second != 1.0 {
                seconds.iter_mut().for_each(|t| *t /= per_second);
            }
            (seconds, if exact { printed } else { Printed::EXACT })
        }
        (_, Clock::Even { start, step }) => {
            // The mean of n rows belongs to the middle of their times.
            let n = contents.rows_per_row() as f64;
            ((0..rows).map(|k| start + (k as f64 * n + 0.5 * (n - 1.0)) * step).collect(), Printed::EXACT)
        }
        (None, Clock::Column { .. }) => (Vec::new(), Printed::EXACT),
    };
    let place = |row: usize| contents.place(row);
    let lengths = [&input, &output, &temperature, &load].map(|values| values.as_ref().map(Vec::len));
    let of_labels = (layout.segment, labels.as_ref().map(|values| values.numbers.len()));
    for (at, found) in chosen.into_iter().zip(lengths).chain([of_labels]) {
        if let (Some(at), Some(found)) = (at, found.filter(|found| *found != time.len())) {
            return Err(RecordError::Lengths {
                name: name.to_owned(),
                column: column(at).to_owned(),
                found,
                expected: time.len(),
            });
        }
    }
    let segment = labels
        .map(|values| integers(name, &values.numbers, column(layout.segment.unwrap_or(0)), &place))
        .transpose()?;
    too_cold(name, &layout, temperature.as_deref(), column, &place)?;
    let unit = layout.output.as_ref().and_then(|choice| OutputUnit::of_column(&choice.canonical));
    let mut samples = Columns {
        name: name.to_owned(),
        segment,
        time: std::mem::take(&mut time),
        input_column: layout.input.as_ref().map_or_else(String::new, |choice| choice.canonical.clone()),
        input,
        output: unit.zip(output),
        temperature,
        load,
    };
    let origin = Origin {
        time_column: clock.map_or("time_s", column),
        segment_column: layout.segment.map_or("segment", column),
        place: &place,
    };
    if samples.time.is_empty() {
        return Err(RecordError::NoRows { file: name.to_owned() });
    }
    let done = repair(&mut samples, &mut printed, need == Need::Output, &origin)?;
    let place = place_of(&done, &place);
    finite(&samples, &place)?;
    let mut record = Record::assemble(samples, printed, done.periods.clone(), &Origin { place: &place, ..origin })?;
    record.missing.clone_from(&done.missing);
    record.resampled = done.resampled;
    record.lost.cut_off = contents.cut_off();
    record.notes = contents
        .notes()
        .iter()
        .chain(&contents.late_notes())
        .chain(&layout.notes)
        .chain(&notes)
        .chain(&done.notes)
        .cloned()
        .collect();
    Ok(Found { record, layout, is_plain: !done.changed })
}

/// Returns the columns without a unit that count the rows. Only messages need them.
fn counters(contents: &dyn Contents) -> Result<Vec<usize>, RecordError> {
    if contents.rows_per_row() > 1 {
        return Ok(Vec::new());
    }
    let heads = contents.heads().iter().take(MAX_CHANNELS).enumerate();
    let unstated = heads.filter(|(_, head)| Heading::parse(&head.name, head.unit.as_deref()).unit.is_none());
    let unstated: Vec<usize> = unstated.map(|(at, _)| at).collect();
    let is_counter = |values: &Values| {
        let numbers = values.numbers.as_slice();
        numbers.len() > 2 && numbers[0].fract() == 0.0 && numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0)
    };
    let values = contents.values(Wanted::all(&unstated))?;
    Ok(unstated.into_iter().zip(values).filter(|(_, values)| is_counter(values)).map(|(at, _)| at).collect())
}

/// Interpolates columns with other times linearly to the times of the output (without an output: of the input).
///
/// Before the first and after the last value of a column the result is NaN. Returns one note per interpolated column.
fn align_to_output(
    contents: &dyn Contents,
    layout: &Layout,
    values: &mut [Option<Vec<f64>>; 4],
) -> Result<Vec<String>, RecordError> {
    let heads = contents.heads();
    let choices = [&layout.input, &layout.output, &layout.temperature, &layout.load];
    let Some(main) = layout.output.as_ref().or(layout.input.as_ref()) else { return Ok(Vec::new()) };
    let axis = |choice: &Choice| heads[choice.column].axis;
    // A time column named by --map, or a rate, applies to all columns.
    let named = match (layout.time.clone(), axis(main)) {
        (Clock::Column { column, .. }, Axis::Column(own)) => column != own,
        (Clock::Column { .. }, _) => true,
        (Clock::Even { step, .. }, Axis::Even { step: own, .. }) => step != own,
        (Clock::Even { .. }, _) => true,
    };
    let (Some(rows), false) = (values[usize::from(layout.output.is_some())].as_ref().map(Vec::len), named) else {
        return Ok(Vec::new());
    };
    let times = |axis: Axis, rows: usize| -> Result<Vec<f64>, RecordError> {
        match axis {
            Axis::Even { start, step } => Ok((0..rows).map(|k| start + k as f64 * step).collect()),
            Axis::Column(column) => {
                let unit = Heading::parse(&heads[column].name, heads[column].unit.as_deref()).unit;
                let per_second =
                    unit.filter(|unit| unit.dimension == Dimension::Time).map_or(1.0, |unit| unit.per_base);
                let read = contents.values(Wanted::all(&[column]))?.remove(0).numbers;
                Ok(read.into_iter().map(|t| t / per_second).collect())
            }
            Axis::Unknown => Ok(Vec::new()),
        }
    };
    let mut wanted = None;
    let mut notes = Vec::new();
    for (choice, values) in choices.into_iter().zip(values) {
        let (Some(choice), Some(values)) = (choice, values) else { continue };
        let own = axis(choice);
        if own == axis(main) || own == Axis::Unknown {
            continue;
        }
        let from = times(own, values.len())?;
        let to = match &wanted {
            Some(to) => to,
            None => wanted.insert(times(axis(main), rows)?),
        };
        if from == *to || from.len() != values.len() {
            continue;
        }
        *values = interpolated(&from, values, to);
        notes.push(format!(
            "\"{}\" is sampled at other times: interpolated to the times of \"{}\"",
            heads[choice.column].name, heads[main.column].name
        ));
    }
    Ok(notes)
}

/// Longest step in time that is interpolated, as a multiple of the usual step.
const MAX_STEP: f64 = 1.75;

/// Interpolates values at increasing times `from` to the times `to`; NaN outside.
fn interpolated(from: &[f64], values: &[f64], to: &[f64]) -> Vec<f64> {
    let mut steps: Vec<f64> = from.windows(2).map(|t| t[1] - t[0]).collect();
    if steps.iter().any(|step| *step <= 0.0 || step.is_nan()) {
        return vec![f64::NAN; to.len()];
    }
    steps.sort_unstable_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    // A time that is outside by rounding only counts as inside.
    let slack = 1e-6 * usual;
    let (Some(first), Some(last)) = (from.first(), from.last()) else { return vec![f64::NAN; to.len()] };
    to.iter()
        .map(|t| {
            if *t < first - slack || *t > last + slack || !t.is_finite() {
                return f64::NAN;
            }
            let after = from.partition_point(|own| own <= t).clamp(1, from.len().max(2) - 1).min(from.len() - 1);
            let before = after.saturating_sub(1);
            let step = from[after] - from[before];
            if step > MAX_STEP * usual {
                f64::NAN
            } else if step > 0.0 {
                values[before] + (values[after] - values[before]) * (t - from[before]) / step
            } else {
                values[before]
            }
        })
        .collect()
}

/// Converts values to the unit and sign of their role.
fn convert(choice: &Choice, values: &mut [f64]) {
    let own = Unit::of_canonical(&choice.canonical);
    if let Some(to) = choice.unit.zip(own).and_then(|(unit, own)| unit.to(own)) {
        values.iter_mut().for_each(|value| *value = to(*value));
    }
    if let Some(factor) = choice.factor {
        values.iter_mut().for_each(|value| *value *= factor);
    }
}

/// Checks that no value overflowed during interpolation.
fn finite(samples: &Columns, place: &dyn Fn(usize) -> Place) -> Result<(), RecordError> {
    let Columns { name, time, input_column, input, output, temperature, load, .. } = samples;
    let columns = [
        ("time_s", Some(time)),
        (input_column.as_str(), input.as_ref()),
        (output.as_ref().map_or("", |(unit, _)| unit.column()), output.as_ref().map(|(_, y)| y)),
        ("temperature_degc", temperature.as_ref()),
        ("load_n", load.as_ref()),
    ];
    for (column, values) in columns.into_iter().filter_map(|(column, values)| Some((column, values?))) {
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            let value = format!("{} (overflow: the neighbouring values are too large)", values[row]);
            let (file, column) = (name.clone(), column.to_owned());
            return Err(RecordError::NotFinite { file, place: place(row), column, value });
        }
    }
    Ok(())
}

/// Converts segment labels to integers.
fn integers(file: &str, values: &[f64], column: &str, place: &dyn Fn(usize) -> Place) -> Result<Vec<i64>, RecordError> {
    let of = |(row, value): (usize, &f64)| {
        // A double holds integers up to 2^53 ≈ 9e15 exactly.
        if value.fract() == 0.0 && value.abs() < 9e15 {
            return Ok(*value as i64);
        }
        Err(RecordError::SegmentNotInteger {
            file: file.to_owned(),
            place: place(row),
            column: column.to_owned(),
            text: value.to_string(),
        })
    };
    values.iter().enumerate().map(of).collect()
}

fn too_cold<'a>(
    file: &str,
    layout: &Layout,
    values: Option<&[f64]>,
    column: impl Fn(usize) -> &'a str,
    place: &dyn Fn(usize) -> Place,
) -> Result<(), RecordError> {
    let coldest =
        values.and_then(|values| values.iter().position(|degc| *degc < ABSOLUTE_ZERO).map(|row| (row, values[row])));
    coldest.map_or(Ok(()), |(row, degc)| {
        Err(RecordError::TooCold {
            file: file.to_owned(),
            place: place(row),
            column: layout.temperature.as_ref().map_or("", |choice| column(choice.column)).to_owned(),
            value: degc.to_string(),
        })
    })
}
