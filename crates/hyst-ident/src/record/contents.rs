//! Makes a record of the columns of a file: roles, units, common times and repairs.

use super::align::align_to_output;
use super::assembly::{Columns, Origin};
use super::checked::Record;
use super::columns::{Need, Reading};
use super::error::RecordError;
use super::grid::Printed;
use super::heading::Heading;
use super::repair::{place_of, repair};
use super::roles::{Clock, File, Layout};
use super::source::{Contents, Values, Wanted};
use super::unit::OutputUnit;
use super::values::{convert, finite, integers, too_cold};

/// The maximum number of columns in a survey. Further columns are not listed.
pub const MAX_CHANNELS: usize = 200;

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
    pub(super) is_plain: bool,
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
    let done = repair(&mut samples, &mut printed, matches!(need, Need::Output | Need::Reference { .. }), &origin)?;
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
