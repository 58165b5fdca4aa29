//! The messages of a file or stream: kind, header and body.

use super::fault::Fault;
use super::flatbuffer::{self, u32_at};

/// The first word of each message of a stream.
pub(super) const CONTINUES: u32 = u32::MAX;

/// Kinds of messages.
pub(super) const SCHEMA: u8 = 1;
pub(super) const DICTIONARY: u8 = 2;
pub(super) const BATCH: u8 = 3;

/// A message, and the place of the next one.
pub(super) struct Message<'a> {
    pub(super) kind: u8,
    pub(super) header: Option<flatbuffer::Table<'a>>,
    pub(super) body: &'a [u8],
    pub(super) next: usize,
}

impl<'a> Message<'a> {
    /// Returns the kind of a message by its metadata.
    pub(super) fn kind_of(metadata: &[u8]) -> Option<u8> {
        Some(flatbuffer::Table::root(metadata)?.u8(1, 0))
    }

    /// Reads the message at byte `at`; `None` at the end mark.
    pub(super) fn read(bytes: &'a [u8], at: usize) -> Result<Option<Self>, Fault> {
        let cut = || Fault::damaged(format!("the file ends in the middle of the message at byte {at}"));
        let too_long = |length: i64| {
            let left = bytes.len().saturating_sub(at);
            Fault::damaged(format!("the message at byte {at} states {length} bytes, but the file has only {left} more"))
        };
        let mut start = at;
        let mut word = || {
            let word = u32_at(bytes, start);
            start = start.saturating_add(4);
            word.ok_or_else(cut)
        };
        // Before version 0.15 a message began with its length.
        let mut length = word()?;
        if length == CONTINUES {
            length = word()?;
        }
        if length == 0 {
            return Ok(None);
        }
        let part = |start: usize, length: usize| bytes.get(start..start.checked_add(length)?);
        let metadata = part(start, length as usize).ok_or_else(|| too_long(length.into()))?;
        let start = start + metadata.len();
        let table = flatbuffer::Table::root(metadata).ok_or_else(cut)?;
        let stated = table.i64(3, 0);
        let body =
            usize::try_from(stated).ok().and_then(|length| part(start, length)).ok_or_else(|| too_long(stated))?;
        Ok(Some(Self { kind: table.u8(1, 0), header: table.table(2), body, next: start + body.len() }))
    }
}
