//! Whether the lengths inside of a record fit into it.

use mcap::records::op;

/// A part of a record.
enum Part {
    /// So many bytes.
    Bytes(usize),
    /// A length of four bytes, and as many bytes.
    Text,
    /// A length of four bytes, and pairs of texts in as many bytes.
    Pairs,
    /// A length of four bytes, and pairs of numbers in as many bytes.
    Offsets,
    /// A length of eight bytes, and as many bytes.
    Data,
}

use Part::{Bytes, Data, Offsets, Pairs, Text};

/// A channel's number and an offset \[bytes\].
const OFFSET: usize = 10;

/// The parts of a record of a kind, as far as lengths are among them.
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

/// Whether no length inside of the record reaches beyond its end.
pub(super) fn fits(kind: u8, body: &[u8]) -> bool {
    parts(kind).iter().try_fold(body, |rest, part| after(part, rest)).is_some()
}

/// What follows a part.
fn after<'a>(part: &Part, bytes: &'a [u8]) -> Option<&'a [u8]> {
    match part {
        Bytes(count) => bytes.get(*count..),
        Text => text(bytes).map(|(_, rest)| rest),
        // The parser reads whole pairs, and beyond the length where that ends within one.
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

/// The bytes behind a length of four bytes, and what follows them.
fn text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = length(bytes)?;
    rest.split_at_checked(length)
}

/// A length of four bytes, and what follows it.
fn length(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    Some((usize::try_from(u32::from_le_bytes(*length)).ok()?, rest))
}
