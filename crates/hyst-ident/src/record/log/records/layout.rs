//! Check of the lengths inside a record.

use mcap::records::op;

/// A part of a record.
enum Part {
    /// A fixed number of bytes.
    Bytes(usize),
    /// A length of four bytes, followed by that many bytes.
    Text,
    /// A length of four bytes, followed by pairs of texts in that many bytes.
    Pairs,
    /// A length of four bytes, followed by pairs of numbers in that many bytes.
    Offsets,
    /// A length of eight bytes, followed by that many bytes.
    Data,
}

use Part::{Bytes, Data, Offsets, Pairs, Text};

/// Size of a channel number and an offset \[bytes\].
const OFFSET: usize = 10;

/// Returns the parts of a record of `kind` up to the last part with a length.
fn parts(kind: u8) -> &'static [Part] {
    match kind {
        op::HEADER => &[Text, Text],
        op::SCHEMA => &[Bytes(2), Text, Text, Text],
        op::CHANNEL => &[Bytes(4), Text, Text, Pairs],
        op::CHUNK => &[Bytes(28), Text, Data],
        op::MESSAGE_INDEX => &[Bytes(2), Text],
        op::CHUNK_INDEX => &[Bytes(32), Offsets, Bytes(8), Text, Bytes(16)],
        op::ATTACHMENT => &[Bytes(16), Text, Text, Data, Bytes(4)],
        op::ATTACHMENT_INDEX => &[Bytes(40), Text, Text],
        op::METADATA => &[Text, Pairs],
        op::METADATA_INDEX => &[Bytes(16), Text],
        _ => &[],
    }
}

/// Returns whether every length inside the record is within the record.
pub(super) fn fits(kind: u8, body: &[u8]) -> bool {
    parts(kind).iter().try_fold(body, |rest, part| after(part, rest)).is_some()
}

/// Returns the bytes after a part.
fn after<'a>(part: &Part, bytes: &'a [u8]) -> Option<&'a [u8]> {
    match part {
        Bytes(count) => bytes.get(*count..),
        Text => text(bytes).map(|(_, rest)| rest),
        // The parser reads whole pairs, beyond the length if the length ends within a pair.
        Pairs => {
            let (length, mut rest) = length(bytes)?;
            let all = rest.len();
            while all - rest.len() < length {
                rest = text(text(rest)?.1)?.1;
            }
            Some(rest)
        }
        Offsets => {
            let (length, rest) = length(bytes)?;
            rest.get(length.div_ceil(OFFSET).checked_mul(OFFSET)?..)
        }
        Data => {
            let (length, rest) = bytes.split_first_chunk()?;
            rest.get(usize::try_from(u64::from_le_bytes(*length)).ok()?..)
        }
    }
}

/// Splits off a length of four bytes and that many bytes; returns those bytes and the rest.
fn text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = length(bytes)?;
    rest.split_at_checked(length)
}

/// Splits off a length of four bytes; returns it and the rest.
fn length(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    Some((usize::try_from(u32::from_le_bytes(*length)).ok()?, rest))
}
