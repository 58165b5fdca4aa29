//! Arrow IPC files (Feather version 2) and Arrow streams.

mod buffers;
mod columns;
mod fault;
mod flatbuffer;
mod message;
mod schema;

use super::Table;
use super::columnar::apply_statements;
use crate::record::error::RecordError;
use columns::Columns;
use fault::{FILE, Fault};
use flatbuffer::{i64_at, u32_at};
use message::{BATCH, CONTINUES, DICTIONARY, Message, SCHEMA};
use schema::Schema;

const FORMAT: &str = "Arrow";
/// First and last bytes of a file.
const MAGIC: &[u8] = b"ARROW1";
/// First bytes of a Feather file of version 1, which is another format.
const FEATHER_1: &[u8] = b"FEA1";

/// Returns whether `bytes` are an Arrow file or stream, or a Feather file.
pub(crate) fn is(bytes: &[u8]) -> bool {
    // The first message of a stream is a schema. A damaged length is accepted here and reported later.
    let stream = u32_at(bytes, 0) == Some(CONTINUES) && u32_at(bytes, 4).is_some_and(|length| length >= 16);
    let plausible = || Message::kind_of(&bytes[8..]) == Some(SCHEMA);
    bytes.starts_with(MAGIC) || bytes.starts_with(FEATHER_1) || stream && plausible()
}

/// Reads the columns of an Arrow file or stream. `file` is the file name in messages.
///
/// # Errors
/// If the file is damaged, or has no column of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let named =
        |Fault(what)| RecordError::Damaged { file: file.to_owned(), format: FORMAT, what: what.replace(FILE, file) };
    table(bytes).map_err(named)
}

fn table(bytes: &[u8]) -> Result<Table, Fault> {
    if bytes.starts_with(FEATHER_1) {
        let line = format!("pandas.read_feather(\"{FILE}\").to_feather(\"new.feather\")");
        return Err(Fault::new(format!(
            "the file is Feather version 1, which is not supported; in Python, {line} rewrites it as version 2"
        )));
    }
    let is_file = bytes.starts_with(MAGIC);
    let mut table = Table::new(if is_file { "Arrow file (Feather)" } else { "Arrow stream" });
    let columns = if is_file { of_file(bytes)? } else { of_stream(bytes, &mut table.notes)? };
    let statements = columns.fill(&mut table);
    if table.heads.is_empty() {
        return Err(Fault::new(
            "no column holds two or more numbers; write time, voltage and displacement as columns of numbers",
        ));
    }
    apply_statements(&mut table, statements.iter().map(|(key, value)| (key.as_str(), value.as_str())));
    Ok(table)
}

/// Returns the units of a schema message, by column name. Parquet files of Arrow programs contain one.
pub(super) fn units_of_schema(message: &[u8]) -> Vec<(String, String)> {
    let Ok(Some(message)) = Message::read(message, 0) else { return Vec::new() };
    let schema =
        message.header.filter(|_| message.kind == SCHEMA).and_then(|header| Schema::parse(header, "open_stream").ok());
    let stated = |field: schema::Field| Some((field.name, field.unit?));
    schema.map_or_else(Vec::new, |schema| schema.fields.into_iter().filter_map(stated).collect())
}

/// Reads the batches that the footer lists.
fn of_file(bytes: &[u8]) -> Result<Columns, Fault> {
    let no_end = || Fault::damaged("the end of the file is missing");
    let inner = bytes.strip_suffix(MAGIC).filter(|inner| inner.len() >= 12).ok_or_else(no_end)?;
    let end = inner.len() - 4;
    let length = u32_at(inner, end).map_or(usize::MAX, |length| length as usize);
    let damaged = || Fault::damaged("the list of batches at the end of the file cannot be read");
    let start = end.checked_sub(length).ok_or_else(damaged)?;
    let footer = flatbuffer::Table::root(&inner[start..end]).ok_or_else(damaged)?;
    let schema = Schema::parse(footer.table(1).ok_or_else(damaged)?, "open_file")?;
    let mut columns = Columns::new(schema, bytes.len())?;
    // Overlapping batches are refused, because they could use the same bytes a million times.
    let mut unread = bytes.len();
    for (kind, field) in [(DICTIONARY, 2), (BATCH, 3)] {
        for block in footer.vector(field, 24).unwrap_or_default().chunks_exact(24) {
            let at = i64_at(block, 0).and_then(|at| usize::try_from(at).ok()).ok_or_else(damaged)?;
            let message = Message::read(bytes, at)?.filter(|message| message.kind == kind).ok_or_else(damaged)?;
            unread = unread.checked_sub(message.next - at).ok_or_else(damaged)?;
            columns.take(message.kind, message.header.ok_or_else(damaged)?, message.body)?;
        }
    }
    Ok(columns)
}

/// Reads the messages of a stream in order.
fn of_stream(bytes: &[u8], notes: &mut Vec<String>) -> Result<Columns, Fault> {
    let no_schema = || Fault::damaged("the first message is not a schema");
    let first = Message::read(bytes, 0)?.filter(|message| message.kind == SCHEMA).ok_or_else(no_schema)?;
    let mut columns = Columns::new(Schema::parse(first.header.ok_or_else(no_schema)?, "open_stream")?, bytes.len())?;
    let mut at = first.next;
    while at < bytes.len() {
        let Some(message) = Message::read(bytes, at)? else { return Ok(columns) };
        let header = message.header.ok_or_else(|| Fault::damaged("a message has no header"))?;
        columns.take(message.kind, header, message.body)?;
        at = message.next;
    }
    notes.push("the stream has no end mark; its last rows may be missing".to_owned());
    Ok(columns)
}

#[cfg(test)]
mod tests;
