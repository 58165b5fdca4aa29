//! LVM, the text format of LabVIEW's "Write To Measurement File".
//!
//! A header for the file states separators and whether rows have times; a header for each segment states the channels' units, start
//! times and sample periods.

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
/// The mark of UTF-8 that some editors put first.
const MARK: &[u8] = b"\xEF\xBB\xBF";

/// Whether a file is LVM.
pub(crate) fn is(bytes: &[u8]) -> bool {
    bytes.strip_prefix(MARK).unwrap_or(bytes).starts_with(header::FILE.as_bytes())
}

/// Reads the channels of a file; `file` stands for it in messages.
///
/// # Errors
/// When the file is damaged, or has no channel with values.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let text = text(bytes.strip_prefix(MARK).unwrap_or(bytes));
    rows::read(&text).and_then(table::table).map_err(|what| RecordError::Damaged {
        file: file.to_owned(),
        format: FORMAT,
        what,
    })
}

/// LabVIEW writes the code page of Windows, of which Latin-1 has all that units need.
fn text(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| char::from(*byte)).collect()),
    }
}
