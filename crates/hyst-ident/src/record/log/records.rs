//! What is whole in an MCAP file that may have been cut off or damaged.

mod chunk;
mod layout;

use std::borrow::Cow;

use mcap::read::parse_record;
use mcap::records::{Record, op};

use chunk::Unpacker;

/// What an MCAP file begins with.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Kind and length in front of every record \[bytes\].
const HEAD: usize = 9;

/// The records of a log in their order, those inside of chunks among them.
///
/// A cut ends them; of a chunk that was cut its whole records are given. Of a chunk whose check sum is wrong nothing is given, and
/// what comes after it is. One chunk is unpacked at a time, and its records are parsed one by one.
#[derive(Debug)]
pub struct LogRecords<'a> {
    rest: &'a [u8],
    /// Contents of the chunk that is being read, and where its next record begins.
    chunk: (Cow<'a, [u8]>, usize),
    unpacker: Unpacker,
    damaged: usize,
    problem: Option<String>,
}

impl<'a> LogRecords<'a> {
    /// Of the bytes of a file; `None` if it is no MCAP file.
    pub fn new(bytes: &'a [u8]) -> Option<Self> {
        let rest = bytes.strip_prefix(MAGIC)?;
        let unpacker = Unpacker::of_file(bytes.len());
        Some(Self { rest, chunk: (Cow::Borrowed(&[]), 0), unpacker, damaged: 0, problem: None })
    }

    /// Records that were left out because they are damaged; a chunk counts as one.
    pub fn damaged(&self) -> usize {
        self.damaged
    }

    /// What is wrong with the first record that was left out, as part of a sentence.
    pub fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    fn leave_out(&mut self, problem: String) {
        self.damaged += 1;
        self.problem.get_or_insert(problem);
    }

    /// The next record of the chunk that is being read.
    fn next_of_chunk(&mut self) -> Option<Result<Record<'a>, String>> {
        let (contents, at) = &mut self.chunk;
        let Some((kind, body, rest)) = split(&contents[*at..]) else {
            self.chunk = (Cow::Borrowed(&[]), 0);
            return None;
        };
        let (from, end) = (*at + HEAD, *at + HEAD + body.len());
        *at = contents.len() - rest.len();
        Some(match contents {
            // Borrowed from the file, and not only from this reader.
            Cow::Borrowed(contents) => {
                let contents: &'a [u8] = contents;
                parsed(kind, &contents[from..end])
            }
            Cow::Owned(contents) => parsed(kind, &contents[from..end]).map(Record::into_owned),
        })
    }
}

/// Kind and body of the record that `bytes` begin with, and what follows it; `None` if it is not whole.
fn split(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (head, rest) = bytes.split_at_checked(HEAD)?;
    let (kind, length) = head.split_first()?;
    let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
    let (body, rest) = rest.split_at_checked(length)?;
    Some((*kind, body, rest))
}

/// A record from its body.
fn parsed(kind: u8, body: &[u8]) -> Result<Record<'_>, String> {
    // The parser takes the lengths inside on trust: it reserves memory for them, and stops the program at an attachment that is cut.
    if !layout::fits(kind, body) {
        return Err(format!("a record of kind {kind} is shorter than it says"));
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
                            Err(problem) => self.leave_out(problem),
                        }
                        continue;
                    }
                    Some((kind, body, rest)) => {
                        self.rest = rest;
                        parsed(kind, body)
                    }
                    // Cut off.
                    None => {
                        let last = std::mem::take(&mut self.rest);
                        if let Some(body) = last.get(HEAD..).filter(|_| last.first() == Some(&op::CHUNK)) {
                            match self.unpacker.cut(body) {
                                Ok(contents) => self.chunk = (contents, 0),
                                Err(problem) => self.leave_out(problem),
                            }
                        }
                        continue;
                    }
                },
            };
            match record {
                Ok(record) => return Some(record),
                Err(problem) => self.leave_out(problem),
            }
        }
    }
}

#[cfg(test)]
mod tests;
