//! TDMS, the binary format of LabVIEW and other programs of National Instruments.
//!
//! Channels are columns with the names `group/channel`. The properties of a waveform state its times. NI scales are
//! applied.

mod bytes;
mod data;
mod objects;
mod scale;
mod segments;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use super::{Axis, Head, Table};
use crate::record::error::RecordError;
use bytes::{midnight, seconds};
use objects::{Object, Values};
use segments::Contents;

const FORMAT: &str = "TDMS";
/// Properties with a unit: first those of LabVIEW, then those of other programs.
const UNIT_PROPERTIES: [&str; 6] = ["unit_string", "NI_UnitDescription", "Unit", "unit", "Units", "units"];
/// Units of a waveform axis that mean seconds. Some programs write the quantity instead.
const SECONDS: [&str; 8] = ["", "s", "sec", "second", "seconds", "Seconds", "Time", "time"];
/// Largest number of channels that a message names.
const MAX_NAMED: usize = 6;

/// Returns whether `bytes` are a TDMS file, or the index of one.
pub(crate) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(b"TDSm") || bytes.starts_with(b"TDSh")
}

/// Reads the channels of a file. `file` is the file name in messages.
///
/// # Errors
/// If the file is damaged, or has no channel of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let damaged = |what| RecordError::Damaged { file: file.to_owned(), format: FORMAT, what };
    if bytes.starts_with(b"TDSh") {
        return Err(damaged(
            "this is the index of a TDMS file, without values; give the file with the same name that ends in .tdms"
                .into(),
        ));
    }
    table(Contents::read(bytes).map_err(damaged)?).map_err(damaged)
}

/// Columns of time stamps by group and number of rows.
type Clocks = HashMap<(String, usize), usize>;

/// A channel with its values.
struct Column {
    channel: Object,
    values: Vec<f64>,
    is_time: bool,
}

fn table(mut contents: Contents) -> Result<Table, String> {
    let mut table = Table::new(FORMAT);
    let columns = columns(&mut contents, &mut table.notes);
    if let Some(segment) = contents.cut_in {
        let rows = columns.first().map_or(0, |column| column.values.len());
        if rows == 0 {
            return Err("the file is cut off before its first row is complete; copy it again".into());
        }
        table.notes.insert(
            0,
            format!("the file is cut off in its segment {segment}; the {rows} rows before are read; if the file should be longer, copy it again"),
        );
    }
    if columns.is_empty() {
        let why = if table.notes.is_empty() { String::new() } else { format!(" ({})", table.notes.join("; ")) };
        return Err(format!(
            "no channel has two or more numbers{why}; write voltage and displacement as channels of numbers"
        ));
    }
    let waveforms = || columns.iter().filter(|column| period(&column.channel).is_some());
    let earliest = waveforms().filter_map(|column| column.channel.time("wf_start_time")).min();
    let breaks = breaks(&columns, &mut table.notes);
    let is_clock = |(_, column): &(usize, &Column)| column.is_time;
    let place = |(at, column): (usize, &Column)| ((column.channel.group.clone(), column.values.len()), at);
    // If a group has several columns of time stamps, the first applies.
    let clocks: Clocks = columns.iter().enumerate().rev().filter(is_clock).map(place).collect();
    let axes: Vec<Axis> = columns.iter().map(|column| axis(column, &clocks, earliest)).collect();
    for (column, axis) in columns.into_iter().zip(axes) {
        let unit = unit(&column.channel);
        let unit = if column.is_time { Some("s".to_owned()) } else { unit };
        table.push(Head { unit, axis, ..Head::new(column.channel.name()) }, column.values);
    }
    if let Some(breaks) = breaks {
        let rows = table.values.first().map_or(0, Vec::len);
        let labels = (0..rows).map(|row| breaks.partition_point(|start| *start <= row) as f64).collect();
        table.push(Head::new("segment"), labels);
    }
    Ok(table)
}

/// Returns the channels with two or more numbers, with their scales applied.
fn columns(contents: &mut Contents, notes: &mut Vec<String>) -> Vec<Column> {
    let taken: Vec<Values> = contents.objects.iter_mut().map(|object| std::mem::take(&mut object.values)).collect();
    let (mut columns, mut unread) = (Vec::new(), Vec::new());
    let is_above = |object: &&Object| object.channel.is_none();
    let above: HashMap<&str, &Object> =
        contents.objects.iter().filter(is_above).map(|object| (object.group.as_str(), object)).collect();
    for (object, values) in contents.objects.iter().zip(taken) {
        if object.channel.is_none() || values.rows() < 2 {
            continue;
        }
        let is_time = matches!(values, Values::Times(_));
        let values = match values {
            Values::Times(times) => Ok(since_midnight(&times)),
            values => {
                // Scales of the group take precedence over those of the file, whose group name is empty.
                let stated = [Some(object), above.get(object.group.as_str()).copied(), above.get("").copied()];
                scale::apply(values, stated.into_iter().flatten())
            }
        };
        match values {
            Ok(values) => columns.push(Column { channel: Object { index: None, ..object.clone() }, values, is_time }),
            Err(what) => unread.push(format!("\"{}\" is not read: {what}", object.name())),
        }
    }
    let more = unread.len().saturating_sub(MAX_NAMED);
    unread.truncate(MAX_NAMED);
    notes.extend(unread);
    if more > 0 {
        notes.push(format!("{more} more channels are not read"));
    }
    columns
}

/// Returns the seconds since the midnight (UTC) before the first time stamp.
fn since_midnight(times: &[i128]) -> Vec<f64> {
    let start = times.first().map_or(0, |first| midnight(*first));
    times.iter().map(|time| seconds(time.saturating_sub(start))).collect()
}

fn unit(channel: &Object) -> Option<String> {
    UNIT_PROPERTIES.iter().filter_map(|name| channel.text(name)).find(|unit| !unit.trim().is_empty()).map(str::to_owned)
}

/// Returns the sample period \[s\] of a channel that is a waveform over time.
fn period(channel: &Object) -> Option<f64> {
    let is_time = channel.text("wf_xunit_string").is_none_or(|unit| SECONDS.contains(&unit.trim()));
    channel.number("wf_increment").filter(|step| is_time && step.is_finite() && *step > 0.0 && !channel.changes_period)
}

/// Returns the times of a column: those of its waveform, or the time stamps of its group.
///
/// Time 0 is the start of the earliest waveform. Waveforms that start later keep their delay.
fn axis(column: &Column, clocks: &Clocks, earliest: Option<i128>) -> Axis {
    if let Some(step) = period(&column.channel) {
        let offset = column.channel.number("wf_start_offset").filter(|offset| offset.is_finite()).unwrap_or(0.0);
        let since = column.channel.time("wf_start_time").zip(earliest);
        let delay = since.map_or(0.0, |(start, earliest)| seconds(start.saturating_sub(earliest)));
        return Axis::Even { start: offset + delay, step };
    }
    if column.is_time {
        return Axis::Unknown;
    }
    clocks.get(&(column.channel.group.clone(), column.values.len())).map_or(Axis::Unknown, |clock| Axis::Column(*clock))
}

/// Returns the rows at which all waveforms restart (several runs in one file). Adds notes on channels whose times are
/// not known.
fn breaks(columns: &[Column], notes: &mut Vec<String>) -> Option<Vec<usize>> {
    for column in columns.iter().filter(|column| column.channel.changes_period).take(MAX_NAMED) {
        notes.push(format!("\"{}\" changes its sample period; its times are not known", column.channel.name()));
    }
    let all: Vec<Vec<usize>> = columns.iter().map(|column| restarts(&column.channel, column.values.len())).collect();
    let (at, first) = all.iter().enumerate().find(|(_, rows)| !rows.is_empty())?;
    let name = columns[at].channel.name();
    let (row, parts) = (first[0] + 1, first.len() + 1);
    let same_rows = columns.iter().all(|column| column.values.len() == columns[at].values.len());
    let is_free = columns.iter().all(|column| column.channel.channel.as_deref() != Some("segment"));
    let are_shared = same_rows && is_free && all.iter().all(|rows| rows == first);
    notes.push(if are_shared {
        format!("\"{name}\" restarts at row {row}; the column \"segment\" numbers its {parts} parts")
    } else {
        format!("\"{name}\" restarts at row {row}, but is read as one segment; save each run in a separate file")
    });
    are_shared.then(|| first.clone())
}

/// Returns the rows at which the start time of a channel differs from the expected time.
fn restarts(channel: &Object, rows: usize) -> Vec<usize> {
    let (Some(start), Some(step)) = (channel.time("wf_start_time"), period(channel)) else { return Vec::new() };
    let (mut start, mut first, mut found) = (start, 0, Vec::new());
    for (row, restart) in &channel.restarts {
        // A segment that repeats the start time of the whole waveform is not a restart.
        let distance = seconds(restart.saturating_sub(start));
        let late = distance - (row - first) as f64 * step;
        if distance != 0.0 && late.abs() > step / 2.0 && *row < rows {
            (start, first) = (*restart, *row);
            found.push(*row);
        }
    }
    found
}
