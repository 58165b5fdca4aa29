//! What is whole in an MCAP file that may have been cut off or damaged.

use mcap::McapError;
use mcap::read::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// What an MCAP file begins with.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Kind and length in front of every record.
const HEAD: usize = 9;
/// Bytes of the largest record that a chunk may have, unless the file itself is larger: what a damaged length asks for is not tried.
const LARGEST: usize = 64 << 20;

/// The records of a log in their order, those inside of chunks among them.
///
/// A cut ends them; of a chunk that was cut its whole records are given. Of a chunk whose check sum is wrong nothing is given, and
/// what comes after it is.
#[derive(Debug)]
pub struct LogRecords<'a> {
    rest: &'a [u8],
    /// Records of a chunk, last first.
    unpacked: Vec<Record<'static>>,
    largest: usize,
    damaged: usize,
}

impl<'a> LogRecords<'a> {
    /// Of the bytes of a file; `None` if it is no MCAP file.
    pub fn new(bytes: &'a [u8]) -> Option<Self> {
        let rest = bytes.strip_prefix(MAGIC)?;
        Some(Self { rest, unpacked: Vec::new(), largest: bytes.len().max(LARGEST), damaged: 0 })
    }

    /// Records that were left out because they are damaged; a chunk counts as one.
    pub fn damaged(&self) -> usize {
        self.damaged
    }

    /// Takes a chunk, or what there is of it, apart.
    fn unpack(&mut self, chunk: &[u8], whole: bool) {
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(self.largest);
        let (mut reader, mut left, mut unpacked) = (LinearReader::new_with_options(options), chunk, Vec::new());
        let ended = loop {
            match reader.next_event() {
                None => break Ok(()),
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    let (now, later) = left.split_at(wanted.min(left.len()));
                    reader.insert(now.len()).copy_from_slice(now);
                    reader.notify_read(now.len());
                    left = later;
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => match parse_record(opcode, data) {
                    Ok(record) => unpacked.push(record.into_owned()),
                    Err(error) => break Err(error),
                },
                Some(Err(error)) => break Err(error),
            }
        };
        match ended {
            Ok(()) => {}
            Err(McapError::UnexpectedEof) if !whole => {}
            Err(_) => {
                self.damaged += 1;
                return;
            }
        }
        unpacked.reverse();
        self.unpacked = unpacked;
    }
}

impl<'a> Iterator for LogRecords<'a> {
    type Item = Record<'a>;

    fn next(&mut self) -> Option<Record<'a>> {
        loop {
            if let Some(record) = self.unpacked.pop() {
                return Some(record);
            }
            let (head, _) = self.rest.split_at_checked(HEAD)?;
            let (kind, length) = head.split_first()?;
            let length = length.try_into().map_or(u64::MAX, u64::from_le_bytes);
            let end = usize::try_from(length).ok().and_then(|length| length.checked_add(HEAD)).unwrap_or(usize::MAX);
            let (record, rest) = self.rest.split_at_checked(end).unwrap_or((self.rest, &[]));
            let whole = record.len() == end;
            self.rest = rest;
            if *kind == op::CHUNK {
                self.unpack(record, whole);
            } else if whole {
                match parse_record(*kind, &record[HEAD..]) {
                    Ok(record) => return Some(record),
                    Err(_) => self.damaged += 1,
                }
            }
        }
    }
}
