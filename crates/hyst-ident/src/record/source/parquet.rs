//! Parquet files: columns of numbers, including those inside structs.
//!
//! The crate `parquet` decodes the file. It does not check all sizes, so [`pages::check`] does this first. A panic
//! caused by a damaged file is converted to an error.

mod numbers;
mod pages;

use bytes::Bytes;
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::columnar::{apply_statements, unpacked_limit};
use super::{Head, Table, arrow};
use crate::record::error::RecordError;
use numbers::Numbers;

const FORMAT: &str = "Parquet";
/// First and last bytes of a file.
const MAGIC: &[u8] = b"PAR1";
/// First and last bytes of a file whose footer is encrypted.
const ENCRYPTED: &[u8] = b"PARE";
/// Size of the length and the magic number after the footer \[bytes\].
const TRAILER: usize = 8;
/// The key of the schema of Arrow programs.
const ARROW_SCHEMA: &str = "ARROW:schema";

/// An error message: what is wrong with a file, and what to do.
#[derive(Debug, PartialEq)]
struct Fault(String);

impl Fault {
    fn new(what: impl Into<String>) -> Self {
        Self(what.into())
    }

    /// Makes the message of a damaged file.
    fn damaged(what: impl std::fmt::Display) -> Self {
        Self(format!("{what}; the file is damaged: copy it again, or write it again with the program that made it"))
    }
}

/// Returns whether `bytes` begin as a Parquet file does.
pub(crate) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC) || bytes.starts_with(ENCRYPTED)
}

/// Reads the columns of a Parquet file. `file` is the file name in messages.
///
/// # Errors
/// If the file is damaged or encrypted, or has no column of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    // The decoder panics at some damaged files.
    let table =
        std::panic::catch_unwind(|| table(bytes)).unwrap_or_else(|_| Err(Fault::damaged("the file cannot be decoded")));
    table.map_err(|Fault(what)| RecordError::Damaged { file: file.to_owned(), format: FORMAT, what })
}

fn table(bytes: &[u8]) -> Result<Table, Fault> {
    if bytes.starts_with(ENCRYPTED) || bytes.ends_with(ENCRYPTED) {
        return Err(Fault::new("the file is encrypted, which is not supported; write it again without encryption"));
    }
    let inner = bytes.strip_suffix(MAGIC).filter(|inner| inner.len() >= MAGIC.len() + 4);
    let footer = inner.and_then(|inner| inner.last_chunk()).map(|length| u32::from_le_bytes(*length) as usize);
    let Some(footer) = footer else { return Err(Fault::damaged("the end of the file is missing")) };
    if footer > bytes.len() - TRAILER {
        return Err(Fault::damaged("the description at the end is longer than the file"));
    }
    let unreadable =
        |error: ParquetError| Fault::damaged(format!("the description of the columns cannot be read ({error})"));
    let reader = SerializedFileReader::new(Bytes::copy_from_slice(bytes)).map_err(unreadable)?;
    let mut table = Table::new(FORMAT);
    let metadata = reader.metadata();
    let mut columns = columns(metadata, &mut table.notes);
    let limit = unpacked_limit(bytes.len());
    pages::check(bytes, metadata, &columns.iter().map(|column| column.at).collect::<Vec<_>>(), limit)?;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(unreadable)?;
        for Column { at, head, numbers } in &mut columns {
            let read = group.get_column_reader(*at).and_then(|reader| numbers.read(reader));
            read.map_err(|error| Fault::damaged(format!("column \"{}\" cannot be read ({error})", head.name)))?;
        }
    }
    // A column with a single row is a setting, not a measurement.
    for column in columns.into_iter().filter(|column| column.numbers.values.len() >= 2) {
        table.push(column.head, column.numbers.values);
    }
    if table.heads.is_empty() {
        return Err(Fault::new(
            "no column holds two or more numbers; write time, voltage and displacement as columns of numbers",
        ));
    }
    apply_statements(&mut table, statements(metadata));
    Ok(table)
}

/// A column of numbers that is being read.
struct Column {
    /// The number of the column in the file.
    at: usize,
    head: Head,
    numbers: Numbers,
}

/// Returns the key-value metadata of a file.
fn statements(metadata: &ParquetMetaData) -> impl Iterator<Item = (&str, &str)> {
    let pairs = metadata.file_metadata().key_value_metadata().map(Vec::as_slice).unwrap_or_default();
    pairs.iter().filter_map(|pair| Some((pair.key.as_str(), pair.value.as_deref()?)))
}

/// Returns the columns of numbers, without values yet.
fn columns(metadata: &ParquetMetaData, notes: &mut Vec<String>) -> Vec<Column> {
    let message = statements(metadata).find(|(key, _)| *key == ARROW_SCHEMA).and_then(|(_, text)| base64(text));
    let units = message.map_or_else(Vec::new, |message| arrow::units_of_schema(&message));
    let schema = metadata.file_metadata().schema_descr();
    let mut columns = Vec::new();
    for (at, descriptor) in schema.columns().iter().enumerate() {
        let Some(numbers) = Numbers::of(descriptor) else { continue };
        let name = descriptor.path().string();
        if descriptor.max_rep_level() > 0 {
            notes.extend(note_on_lists(descriptor, notes));
            continue;
        }
        let stated = || units.iter().find(|(own, _)| *own == name).map(|(_, unit)| unit.clone());
        let unit = numbers.unit().map(str::to_owned).or_else(stated);
        columns.push(Column { at, head: Head { unit, ..Head::new(name) }, numbers });
    }
    columns
}

/// Returns a note on a column of lists, for the first few such columns.
fn note_on_lists(descriptor: &ColumnDescriptor, notes: &[String]) -> Option<String> {
    const MAX_NOTES: usize = 3;
    let name = descriptor.path().parts().first()?;
    (notes.len() < MAX_NOTES).then(|| {
        format!("column \"{name}\" holds lists and was left out; write their elements as columns to read them")
    })
}

/// Decodes base64; `None` if the text is not base64.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for byte in text.trim_end_matches('=').bytes() {
        let digit = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(digit);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests;
