//! MCAP logs of other programs: JSON, ROS 2 and Protobuf messages.
//!
//! Every numeric field of a topic is a column `/topic.field`. The column `/topic@time` has the time stamps in the
//! headers of the messages, or else the log times.

mod align;
mod budget;
mod cdr;
mod clock;
mod decoder;
mod json;
mod json_units;
mod log;
mod protobuf;
mod ros2;
mod series;
mod stated_unit;
#[cfg(test)]
mod tests;
mod words;

use crate::record::error::RecordError;
use crate::record::log::LogRecords;

use super::{Axis, Head, Table};
use clock::Clock;
use log::Log;
use series::Series;
use words::listed;

/// The note of a truncated log.
const CUT_OFF: &str = "the log was cut off: its end is missing";

/// The name of the format in messages.
const FORMAT: &str = "MCAP";
/// Largest number of notes on one file.
const MAX_NOTES: usize = 24;
/// Fewest messages of a topic.
const MIN_ROWS: usize = 2;

/// Returns whether `bytes` begin as an MCAP file does.
pub(crate) fn is(bytes: &[u8]) -> bool {
    LogRecords::new(bytes).is_some()
}

/// Reads the numeric fields of all topics. `file` is the file name in messages.
///
/// # Errors
/// If no topic has two messages with numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let damaged = |what: String| RecordError::Damaged { file: file.to_owned(), format: FORMAT, what };
    let log = Log::read(bytes).map_err(damaged)?;
    let (mut topics, mut notes, mut left_out) = (Vec::new(), log.notes(), log.left_out.clone());
    if !log.is_closed() {
        notes.insert(0, CUT_OFF.to_owned());
    }
    let encodings = log.encodings();
    let (is_empty, cut_off) = (log.is_empty(), !log.is_closed());
    for topic in log.topics {
        let decoder = topic.decoder;
        let mut series = topic.series;
        series.sort();
        notes.extend(series.notes());
        if series.rows() < MIN_ROWS || series.columns.is_empty() {
            left_out.push(format!("{} ({})", series.topic, series.why_unused()));
            continue;
        }
        let (clock, note) = Clock::of(&mut series);
        notes.extend(note);
        series.complete().map_err(damaged)?;
        series.set_units(&decoder.units());
        topics.push((series, clock));
    }
    topics.retain(|(series, _)| !series.columns.is_empty());
    if topics.is_empty() {
        return Err(damaged(why_nothing(is_empty, &left_out, &notes)));
    }
    notes.extend(align::align(&mut topics));
    if !left_out.is_empty() {
        notes.push(format!("left out: {}", listed(&left_out)));
    }
    let more = notes.len().saturating_sub(MAX_NOTES);
    notes.truncate(MAX_NOTES);
    notes.extend((more > 0).then(|| format!("and {more} more notes")));
    Ok(Table { notes, cut_off, ..table(topics, &encodings) })
}

/// Returns why there is no column, and what to do.
fn why_nothing(is_empty: bool, left_out: &[String], notes: &[String]) -> String {
    let notes = if notes.is_empty() { String::new() } else { format!(" ({})", listed(notes)) };
    if is_empty {
        return format!("the file has no message{notes}; copy the file again, or record again");
    }
    let topics = if left_out.is_empty() { String::new() } else { format!(": {}", listed(left_out)) };
    format!(
        "no topic has two messages with numbers{topics}{notes}; supported are JSON, ROS 2 (cdr with ros2msg) and Protobuf messages"
    )
}

/// Makes the table. Topics with the same times share one time column.
fn table(topics: Vec<(Series, Clock)>, encodings: &str) -> Table {
    let mut table = Table::new(format!("MCAP log of {encodings} messages"));
    let zeros = clock::zeros(topics.iter().map(|(_, clock)| clock));
    let mut written: Vec<(Clock, usize)> = Vec::new();
    for ((series, clock), zero) in topics.into_iter().zip(zeros) {
        let axis = if !clock.moves() {
            Axis::Unknown
        } else if let Some((_, column)) = written.iter().find(|(other, _)| *other == clock) {
            Axis::Column(*column)
        } else {
            let head = Head { unit: Some("s".to_owned()), ..Head::new(format!("{}@time", clock.topic)) };
            let column = table.push(head, clock.seconds_from(zero));
            table.heads[column].axis = Axis::Column(column);
            written.push((clock, column));
            Axis::Column(column)
        };
        for column in series.columns {
            let name = format!("{}{}", series.topic, column.path);
            table.push(Head { unit: column.unit, axis, ..Head::new(name) }, column.values);
        }
    }
    table
}
