//! Decompression of chunks with a limit on their size.

use std::borrow::Cow;
use std::io::{Error, ErrorKind, Read};

use super::framing::split;

/// Size up to which a chunk, and all chunks of a file together, may always unpack \[bytes\].
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// Largest ratio of unpacked to packed size of larger chunks. Logs of numbers compress by a factor of 3 to 10.
const MAX_EXPANSION: u64 = 200;
/// Largest window of a Zstandard frame, as a power of two. It is the default limit of the zstd tools.
const MAX_WINDOW_LOG: u32 = 27;

/// Unpacks chunks up to a total size.
#[derive(Debug)]
pub(super) struct Unpacker {
    /// Remaining size for all further chunks of the file \[bytes\].
    budget: u64,
}

/// The header of a chunk.
struct Header<'a> {
    /// Size of the contents \[bytes\].
    size: u64,
    /// Checksum of the contents; 0 if there is none.
    sum: u32,
    compression: &'a [u8],
    /// Size of the packed contents \[bytes\].
    packed: u64,
}

impl Header<'_> {
    /// Returns the packed contents from the bytes after the header; `None` if they are not complete.
    fn packed_of<'a>(&self, rest: &'a [u8]) -> Option<&'a [u8]> {
        rest.get(..usize::try_from(self.packed).ok()?)
    }
}

impl Unpacker {
    pub(super) fn of_file(length: usize) -> Self {
        Self { budget: limit(length) }
    }

    /// Unpacks a complete chunk and checks that it consists of complete records.
    ///
    /// # Errors
    /// If the chunk is damaged or unpacks to too many bytes.
    pub(super) fn whole<'a>(&mut self, body: &'a [u8]) -> Result<Cow<'a, [u8]>, String> {
        let (header, packed) = header(body).ok_or("a chunk is shorter than its header")?;
        let packed = header.packed_of(packed).ok_or("a chunk is shorter than its stated length")?;
        let (contents, fault) = self.unpack(&header, packed)?;
        if let Some(error) = fault {
            return Err(format!("a chunk cannot be unpacked ({error})"));
        }
        // Contents that are not compressed are checked by their checksum.
        if contents.len() as u64 != header.size && !header.compression.is_empty() {
            return Err(format!("a chunk has {} bytes, but its header states {}", contents.len(), header.size));
        }
        let mut sum = flate2::Crc::new();
        sum.update(&contents);
        if header.sum != 0 && sum.sum() != header.sum {
            return Err("the checksum of a chunk is wrong".to_owned());
        }
        let mut rest: &[u8] = &contents;
        while !rest.is_empty() {
            (_, _, rest) = split(rest).ok_or("a record of a chunk is longer than the chunk")?;
        }
        Ok(contents)
    }

    /// Unpacks the available part of a chunk that is longer than the rest of the file (truncated file or damaged
    /// length).
    ///
    /// # Errors
    /// If the chunk has another fault than a missing end.
    pub(super) fn cut<'a>(&mut self, body: &'a [u8]) -> Result<Cow<'a, [u8]>, String> {
        let Some((header, packed)) = header(body) else { return Ok(Cow::Borrowed(&[])) };
        // The packed contents are complete, so the checksum applies.
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

    /// Returns the contents up to the first error, and that error.
    fn unpack<'a>(&mut self, header: &Header<'_>, packed: &'a [u8]) -> Result<(Cow<'a, [u8]>, Option<Error>), String> {
        if header.compression.is_empty() {
            return Ok((Cow::Borrowed(packed), None));
        }
        let largest = limit(packed.len()).min(self.budget);
        if header.size > largest {
            return Err(format!(
                "a chunk of {} bytes states an unpacked size of {} bytes; the limit is {largest} bytes",
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
                return Err(format!("a chunk is compressed by {name:?}; only zstd and lz4 are supported"));
            }
        };
        // Memory is reserved in proportion to the packed bytes, not by the stated size, which may be wrong.
        let likely = header.size.min(MAX_EXPANSION.saturating_mul(packed.len() as u64));
        let mut contents = Vec::with_capacity(usize::try_from(likely).unwrap_or(0));
        let ended = reader.take(header.size).read_to_end(&mut contents);
        self.budget = self.budget.saturating_sub(contents.len() as u64);
        Ok((Cow::Owned(contents), ended.err()))
    }
}

/// Returns the largest unpacked size of `packed` bytes.
fn limit(packed: usize) -> u64 {
    ALWAYS_UNPACKED.max(MAX_EXPANSION.saturating_mul(packed as u64))
}

/// Parses the header of a chunk and returns it with the bytes after it.
fn header(body: &[u8]) -> Option<(Header<'_>, &[u8])> {
    // Start time and end time.
    let (_, rest) = body.split_first_chunk::<16>()?;
    let (size, rest) = rest.split_first_chunk()?;
    let (sum, rest) = rest.split_first_chunk()?;
    let (length, rest) = rest.split_first_chunk()?;
    let (compression, rest) = rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)?;
    let (packed, rest) = rest.split_first_chunk()?;
    let (size, sum, packed) = (u64::from_le_bytes(*size), u32::from_le_bytes(*sum), u64::from_le_bytes(*packed));
    Some((Header { size, sum, compression, packed }, rest))
}
