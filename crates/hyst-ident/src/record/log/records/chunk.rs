//! Contents of a chunk, unpacked within limits.

use std::borrow::Cow;
use std::io::{Error, ErrorKind, Read};

use super::split;

/// Bytes that a chunk may unpack to whatever its size, and all chunks of a file together.
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// How many times its size a chunk may unpack to beyond that: logs of numbers shrink to a third or a tenth.
const MAX_EXPANSION: u64 = 200;
/// Largest window that a Zstandard frame may ask for, as a power of two: the largest that its tools use without being told to.
const MAX_WINDOW_LOG: u32 = 27;

/// Unpacks chunks, and knows how much they may unpack to.
#[derive(Debug)]
pub(super) struct Unpacker {
    /// Bytes that all further chunks of the file may unpack to.
    room: u64,
}

/// What stands in front of a chunk's contents.
struct Header<'a> {
    /// Size of the contents \[bytes\].
    size: u64,
    /// Check sum of the contents; 0 if there is none.
    sum: u32,
    compression: &'a [u8],
    /// Size of the packed contents \[bytes\].
    packed: u64,
}

impl Header<'_> {
    /// The packed contents out of what follows the header; `None` if they are not whole.
    fn packed_of<'a>(&self, rest: &'a [u8]) -> Option<&'a [u8]> {
        rest.get(..usize::try_from(self.packed).ok()?)
    }
}

impl Unpacker {
    pub(super) fn of_file(length: usize) -> Self {
        Self { room: limit(length) }
    }

    /// The contents of a chunk that is there as a whole, which are whole records.
    ///
    /// # Errors
    /// If the chunk is damaged, or unpacks to too much.
    pub(super) fn whole<'a>(&mut self, body: &'a [u8]) -> Result<Cow<'a, [u8]>, String> {
        let (header, packed) = header(body).ok_or("a chunk is shorter than its header")?;
        let packed = header.packed_of(packed).ok_or("a chunk is shorter than it says")?;
        let (contents, fault) = self.unpack(&header, packed)?;
        if let Some(error) = fault {
            return Err(format!("a chunk cannot be unpacked ({error})"));
        }
        // Of contents that are not packed, their check sum says enough.
        if contents.len() as u64 != header.size && !header.compression.is_empty() {
            return Err(format!("a chunk has {} bytes, and says that it has {}", contents.len(), header.size));
        }
        let mut sum = flate2::Crc::new();
        sum.update(&contents);
        if header.sum != 0 && sum.sum() != header.sum {
            return Err("the check sum of a chunk is wrong".to_owned());
        }
        let mut rest: &[u8] = &contents;
        while !rest.is_empty() {
            (_, _, rest) = split(rest).ok_or("a record of a chunk is longer than the chunk")?;
        }
        Ok(contents)
    }

    /// What there is of a chunk that is longer than the rest of the file: the file was cut off, or the chunk's length is damaged.
    ///
    /// # Errors
    /// If more is wrong than that the end is missing.
    pub(super) fn cut<'a>(&mut self, body: &'a [u8]) -> Result<Cow<'a, [u8]>, String> {
        let Some((header, packed)) = header(body) else { return Ok(Cow::Borrowed(&[])) };
        // All that was packed is there, so that the check sum counts.
        if header.packed_of(packed).is_some() {
            return self.whole(body);
        }
        match self.unpack(&header, packed)? {
            (_, Some(error)) if error.kind() != ErrorKind::UnexpectedEof => {
                Err(format!("a chunk cannot be unpacked ({error})"))
            }
            (contents, _) => Ok(contents),
        }
    }

    /// The contents as far as they can be unpacked, and why not further.
    fn unpack<'a>(&mut self, header: &Header<'_>, packed: &'a [u8]) -> Result<(Cow<'a, [u8]>, Option<Error>), String> {
        if header.compression.is_empty() {
            return Ok((Cow::Borrowed(packed), None));
        }
        let largest = limit(packed.len()).min(self.room);
        if header.size > largest {
            return Err(format!(
                "a chunk of {} bytes says that it unpacks to {} bytes, and no more than {largest} are unpacked",
                packed.len(),
                header.size
            ));
        }
        let reader: Box<dyn Read + 'a> = match header.compression {
            b"zstd" => {
                let mut decoder =
                    zstd::stream::read::Decoder::with_buffer(packed).map_err(|error| error.to_string())?;
                decoder.window_log_max(MAX_WINDOW_LOG).map_err(|error| error.to_string())?;
                Box::new(decoder)
            }
            b"lz4" => Box::new(lz4_flex::frame::FrameDecoder::new(packed)),
            other => {
                let name: String = String::from_utf8_lossy(other).chars().take(16).collect();
                return Err(format!("a chunk is compressed by {name:?}, and only zstd and lz4 are unpacked"));
            }
        };
        // Reserved is what the packed bytes justify; beyond that the contents grow as they come.
        let likely = header.size.min(MAX_EXPANSION.saturating_mul(packed.len() as u64));
        let mut contents = Vec::with_capacity(usize::try_from(likely).unwrap_or(0));
        let ended = reader.take(header.size).read_to_end(&mut contents);
        self.room = self.room.saturating_sub(contents.len() as u64);
        Ok((Cow::Owned(contents), ended.err()))
    }
}

/// Bytes that so many packed ones may unpack to.
fn limit(packed: usize) -> u64 {
    ALWAYS_UNPACKED.max(MAX_EXPANSION.saturating_mul(packed as u64))
}

/// The header of a chunk, and what follows it.
fn header(body: &[u8]) -> Option<(Header<'_>, &[u8])> {
    // The first and the last time.
    let (_, rest) = body.split_first_chunk::<16>()?;
    let (size, rest) = rest.split_first_chunk()?;
    let (sum, rest) = rest.split_first_chunk()?;
    let (length, rest) = rest.split_first_chunk()?;
    let (compression, rest) = rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)?;
    let (packed, rest) = rest.split_first_chunk()?;
    let (size, sum, packed) = (u64::from_le_bytes(*size), u32::from_le_bytes(*sum), u64::from_le_bytes(*packed));
    Some((Header { size, sum, compression, packed }, rest))
}
