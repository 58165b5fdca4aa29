//! LVM, the text format of LabVIEW's "Write To Measurement File".
//!
//! The header of the file states the separators and whether rows have times. The header of each segment states units,
//! start times and sample periods of the channels.

mod header;
mod numbers;
mod rows;
mod table;
#[cfg(test)]
mod tests;

use std::borrow::Cow;

use super::Table;
use crate::record::error::RecordError;

const FORMAT: &str = "LVM";
/// The byte-order mark of UTF-8, which some editors add.
const MARK: &[u8] = b"\xEF\xBB\xBF";

/// Returns whether `bytes` are an LVM file.
pub(crate) fn is(bytes: &[u8]) -> bool {
    bytes.strip_prefix(MARK).unwrap_or(bytes).starts_with(header::FILE.as_bytes())
}

/// Reads the channels of a file. `file` is the file name in messages.
///
/// # Errors
/// If the file is damaged, or has no channel with values.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let text = text(bytes.strip_prefix(MARK).unwrap_or(bytes));
    rows::read(&text).and_then(table::table).map_err(|what| RecordError::Damaged {
        file: file.to_owned(),
        format: FORMAT,
        what,
    })
}

/// Decodes UTF-8 or else Latin-1. LabVIEW writes the code page of Windows, whose letters of units are the same in
/// Latin-1.
fn text(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| char::from(*byte)).collect()),
    }
}
