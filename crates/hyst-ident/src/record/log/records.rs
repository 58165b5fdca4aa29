//! The intact records of an MCAP file that may be truncated or damaged.

mod chunk;
mod framing;
mod layout;

use std::borrow::Cow;

use mcap::read::parse_record;
use mcap::records::{Record, op};

use chunk::Unpacker;
use framing::{HEAD, split};

/// The first bytes of an MCAP file.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Iterates over the records of a log in order, including those inside chunks.
///
/// A truncated log ends the iteration; complete records of its last chunk are returned. A chunk with a wrong checksum
/// is skipped. One chunk is unpacked at a time, and its records are parsed one by one.
#[derive(Debug)]
pub struct LogRecords<'a> {
    rest: &'a [u8],
    /// Contents of the current chunk, and the byte at which its next record begins.
    chunk: (Cow<'a, [u8]>, usize),
    unpacker: Unpacker,
    damaged: usize,
    problem: Option<String>,
}

impl<'a> LogRecords<'a> {
    /// Makes the iterator from the bytes of a file; `None` if it is not an MCAP file.
    pub fn new(bytes: &'a [u8]) -> Option<Self> {
        let rest = bytes.strip_prefix(MAGIC)?;
        let unpacker = Unpacker::of_file(bytes.len());
        Some(Self { rest, chunk: (Cow::Borrowed(&[]), 0), unpacker, damaged: 0, problem: None })
    }

    /// Returns the number of damaged records that were skipped. A chunk counts as one.
    pub fn damaged(&self) -> usize {
        self.damaged
    }

    /// Returns the problem of the first skipped record, as part of a sentence.
    pub fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    fn skip_damaged(&mut self, problem: String) {
        self.damaged += 1;
        self.problem.get_or_insert(problem);
    }

    /// Returns the next record of the current chunk.
    fn next_of_chunk(&mut self) -> Option<Result<Record<'a>, String>> {
        let (contents, at) = &mut self.chunk;
        let Some((kind, body, rest)) = split(&contents[*at..]) else {
            self.chunk = (Cow::Borrowed(&[]), 0);
            return None;
        };
        let (from, end) = (*at + HEAD, *at + HEAD + body.len());
        *at = contents.len() - rest.len();
        Some(match contents {
            // Borrowed from the file, not from this iterator.
            Cow::Borrowed(contents) => {
                let contents: &'a [u8] = contents;
                parsed(kind, &contents[from..end])
            }
            Cow::Owned(contents) => parsed(kind, &contents[from..end]).map(Record::into_owned),
        })
    }
}

/// Parses the body of a record.
fn parsed(kind: u8, body: &[u8]) -> Result<Record<'_>, String> {
    // The parser does not check lengths: it reserves memory for them, and it panics at a truncated attachment.
    if !layout::fits(kind, body) {
        return Err(format!("a record of kind {kind} is shorter than its stated length"));
    }
    parse_record(kind, body).map_err(|error| format!("a record of kind {kind} is damaged ({error})"))
}

impl<'a> Iterator for LogRecords<'a> {
    type Item = Record<'a>;

    fn next(&mut self) -> Option<Record<'a>> {
        loop {
            let record = match self.next_of_chunk() {
                Some(record) => record,
                None if self.rest.is_empty() => return None,
                None => match split(self.rest) {
                    Some((op::CHUNK, body, rest)) => {
                        self.rest = rest;
                        match self.unpacker.whole(body) {
                            Ok(contents) => self.chunk = (contents, 0),
                            Err(problem) => self.skip_damaged(problem),
                        }
                        continue;
                    }
                    Some((kind, body, rest)) => {
                        self.rest = rest;
                        parsed(kind, body)
                    }
                    // The file is truncated.
                    None => {
                        let last = std::mem::take(&mut self.rest);
                        if let Some(body) = last.get(HEAD..).filter(|_| last.first() == Some(&op::CHUNK)) {
                            match self.unpacker.cut(body) {
                                Ok(contents) => self.chunk = (contents, 0),
                                Err(problem) => self.skip_damaged(problem),
                            }
                        }
                        continue;
                    }
                },
            };
            match record {
                Ok(record) => return Some(record),
                Err(problem) => self.skip_damaged(problem),
            }
        }
    }
}

#[cfg(test)]
mod tests;
