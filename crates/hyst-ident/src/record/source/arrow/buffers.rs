//! The buffers of a record batch, and the numbers in them.

use std::borrow::Cow;
use std::io::Read;

use super::fault::Fault;
use super::flatbuffer::{Table, i64_at};
use super::schema::Number;
use crate::record::source::columnar::{Clock, decimal, half, unpacked_limit};

/// The buffers and field nodes of a batch. Its fields use them in order.
pub(super) struct Batch<'a> {
    rows: usize,
    body: &'a [u8],
    /// Rows and nulls of each field, 16 bytes each.
    nodes: &'a [u8],
    /// Offset and length of each buffer, 16 bytes each.
    buffers: &'a [u8],
    /// Numbers of the variadic buffers of views, 8 bytes each.
    variadic: &'a [u8],
    codec: Option<Codec>,
}

#[derive(Clone, Copy)]
enum Codec {
    Lz4,
    Zstandard,
}

/// Rows and nulls of a field.
#[derive(Clone, Copy)]
pub(super) struct Node {
    pub(super) rows: usize,
    pub(super) nulls: bool,
}

fn take<'a>(vector: &mut &'a [u8], bytes: usize) -> Option<&'a [u8]> {
    let (first, rest) = vector.split_at_checked(bytes)?;
    *vector = rest;
    Some(first)
}

impl<'a> Batch<'a> {
    pub(super) fn open(header: Table<'a>, body: &'a [u8]) -> Result<Self, Fault> {
        let codec = match header.table(3).map(|compression| compression.u8(0, 0)) {
            None => None,
            Some(0) => Some(Codec::Lz4),
            Some(1) => Some(Codec::Zstandard),
            Some(_) => {
                return Err(Fault::new("the compression is not known; write the file again with compression=\"zstd\""));
            }
        };
        let vector = |number, width| header.vector(number, width).unwrap_or_default();
        let rows = usize::try_from(header.i64(0, 0)).map_err(|_| Fault::damaged("a batch has no number of rows"))?;
        Ok(Self { rows, body, nodes: vector(1, 16), buffers: vector(2, 16), variadic: vector(4, 8), codec })
    }

    /// Returns the number of rows of every column.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the node of the next field.
    pub(super) fn node(&mut self) -> Result<Node, Fault> {
        let read = |node: &[u8]| Some((usize::try_from(i64_at(node, 0)?).ok()?, i64_at(node, 8)?));
        let (rows, nulls) =
            take(&mut self.nodes, 16).and_then(read).ok_or_else(|| Fault::damaged("a batch has too few columns"))?;
        Ok(Node { rows, nulls: nulls != 0 })
    }

    /// Returns the next buffer, as stored.
    pub(super) fn buffer(&mut self) -> Result<&'a [u8], Fault> {
        let place = |entry: &[u8]| {
            let (start, length) = (usize::try_from(i64_at(entry, 0)?).ok()?, usize::try_from(i64_at(entry, 8)?).ok()?);
            self.body.get(start..start.checked_add(length)?)
        };
        take(&mut self.buffers, 16).and_then(place).ok_or_else(|| Fault::damaged("a buffer is outside its batch"))
    }

    /// Skips buffers.
    pub(super) fn skip(&mut self, buffers: usize, variadic: bool) -> Result<(), Fault> {
        let mut count = buffers;
        if variadic {
            let further = take(&mut self.variadic, 8).and_then(|entry| usize::try_from(i64_at(entry, 0)?).ok());
            count = further.and_then(|further| count.checked_add(further)).unwrap_or(usize::MAX);
        }
        let bytes = count.checked_mul(16).and_then(|bytes| take(&mut self.buffers, bytes));
        bytes.map(|_| ()).ok_or_else(|| Fault::damaged("a batch has too few buffers"))
    }

    /// Unpacks the first `wanted` bytes of a buffer.
    pub(super) fn unpack(&self, stored: &'a [u8], wanted: usize) -> Result<Cow<'a, [u8]>, Fault> {
        let short = || Fault::damaged("a buffer is shorter than its column");
        let (Some(codec), false) = (self.codec, stored.is_empty()) else {
            return stored.get(..wanted).map(Cow::Borrowed).ok_or_else(short);
        };
        let (length, packed) = (i64_at(stored, 0).ok_or_else(short)?, &stored[8..]);
        // A buffer that compression would enlarge is stored uncompressed.
        if length == -1 {
            return packed.get(..wanted).map(Cow::Borrowed).ok_or_else(short);
        }
        let length = usize::try_from(length).ok().filter(|length| *length >= wanted).ok_or_else(short)?;
        // A batch with a part of a column may contain the whole column, so `length` may exceed `wanted`.
        if length > unpacked_limit(packed.len()) {
            return Err(Fault::new(
                "a buffer unpacks to more than 200 times its size; write only the columns of the record, as CSV",
            ));
        }
        let failed = |error: std::io::Error| Fault::damaged(format!("a compressed buffer is damaged ({error})"));
        let mut bytes = match codec {
            Codec::Lz4 => {
                let mut bytes = Vec::new();
                lz4_flex::frame::FrameDecoder::new(packed)
                    .take(wanted as u64)
                    .read_to_end(&mut bytes)
                    .map_err(failed)?;
                bytes
            }
            // Unpacked in one step, because a stream would allocate the window size that its header states.
            Codec::Zstandard => zstd::bulk::decompress(packed, length).map_err(failed)?,
        };
        if bytes.len() < wanted {
            return Err(short());
        }
        bytes.truncate(wanted);
        Ok(Cow::Owned(bytes))
    }
}

/// Appends the numbers in `bytes`. Null rows are not converted, because a clock must not start at their ticks.
pub(super) fn append(
    numbers: &mut Vec<f64>,
    number: Number,
    bytes: &[u8],
    rows: usize,
    valid: &dyn Fn(usize) -> bool,
    clock: &mut Clock,
) {
    macro_rules! each {
        ($type:ty, $convert:expr) => {
            numbers.extend(
                bytes
                    .as_chunks::<{ size_of::<$type>() }>()
                    .0
                    .iter()
                    .enumerate()
                    .map(|(row, chunk)| if valid(row) { $convert(<$type>::from_le_bytes(*chunk)) } else { f64::NAN }),
            )
        };
    }
    match number {
        Number::Float { bytes: 8 } => each!(f64, |value| value),
        Number::Float { bytes: 4 } => each!(f32, f64::from),
        Number::Float { .. } => each!(u16, half),
        Number::Integer { bytes: 1, signed: true } => each!(i8, f64::from),
        Number::Integer { bytes: 2, signed: true } => each!(i16, f64::from),
        Number::Integer { bytes: 4, signed: true } => each!(i32, f64::from),
        Number::Integer { signed: true, .. } => each!(i64, |value| value as f64),
        Number::Integer { bytes: 1, .. } => each!(u8, f64::from),
        Number::Integer { bytes: 2, .. } => each!(u16, f64::from),
        Number::Integer { bytes: 4, .. } => each!(u32, f64::from),
        Number::Integer { .. } => each!(u64, |value| value as f64),
        Number::Decimal { bytes: 4, scale } => each!(i32, |value| decimal(i128::from(value), scale)),
        Number::Decimal { bytes: 8, scale } => each!(i64, |value| decimal(i128::from(value), scale)),
        Number::Decimal { scale, .. } => each!(i128, |value| decimal(value, scale)),
        Number::Instant { bytes: 4, .. } => each!(i32, |days| clock.seconds(86_400 * i64::from(days))),
        Number::Instant { .. } => each!(i64, |ticks| clock.seconds(ticks)),
        Number::Boolean => numbers.extend((0..rows).map(|row| match (valid(row), is_set(bytes, row)) {
            (false, _) => f64::NAN,
            (true, set) => f64::from(u8::from(set)),
        })),
    }
}

/// Returns whether the bit of a row is set.
pub(super) fn is_set(bits: &[u8], row: usize) -> bool {
    bits.get(row / 8).is_some_and(|byte| byte >> (row % 8) & 1 == 1)
}
