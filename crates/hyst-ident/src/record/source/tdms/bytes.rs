//! Bytes of a TDMS file: integers and texts in either byte order, and the types of values.

/// The error of reading beyond the end.
const TOO_SHORT: &str = "a description of objects is longer than its bytes";

/// Reads one item after another and checks the end.
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
}

impl<'a> Cursor<'a> {
    pub(crate) fn new(bytes: &'a [u8], big_endian: bool) -> Self {
        Self { bytes, at: 0, big_endian }
    }

    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let taken = self.bytes.get(self.at..).and_then(|rest| rest.get(..count)).ok_or(TOO_SHORT)?;
        self.at += count;
        Ok(taken)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(little_endian(self.take(4)?, self.big_endian)))
    }

    pub(crate) fn u64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(little_endian(self.take(8)?, self.big_endian)))
    }

    pub(crate) fn text(&mut self) -> Result<String, String> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    pub(crate) fn number(&mut self, kind: Kind) -> Result<f64, String> {
        let size = kind.size().unwrap_or(0);
        Ok(kind.number(self.take(size)?, self.big_endian))
    }

    pub(crate) fn moment(&mut self) -> Result<i128, String> {
        Ok(moment(self.take(16)?, self.big_endian))
    }
}

/// Returns the first bytes of an item in little-endian order. Missing bytes are zero.
fn little_endian<const N: usize>(item: &[u8], big_endian: bool) -> [u8; N] {
    let mut array = [0; N];
    for (to, from) in array.iter_mut().zip(item) {
        *to = *from;
    }
    if big_endian {
        array.reverse();
    }
    array
}

/// Returns a time stamp \[2⁻⁶⁴ s since 1904-01-01 UTC\].
///
/// The file has whole seconds and a fraction in two words of 64 bits. In both byte orders they form one integer of 128
/// bits.
pub(crate) fn moment(item: &[u8], big_endian: bool) -> i128 {
    i128::from_le_bytes(little_endian(item, big_endian))
}

/// Converts a difference of two time stamps to seconds. It is rounded once, because the power of two is exact.
pub(crate) fn seconds(difference: i128) -> f64 {
    difference as f64 / 2_f64.powi(64)
}

/// Returns the midnight (UTC) before a time stamp.
pub(crate) fn midnight(moment: i128) -> i128 {
    const DAY: i128 = 86_400 << 64;
    moment.div_euclid(DAY).saturating_mul(DAY)
}

/// The type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    F32,
    F64,
    Bool,
    Time,
    Text,
    /// Complex numbers, of 8 or 16 bytes.
    Complex(usize),
    /// A DAQmx channel, whose values are in [scalers](super::objects::Scaler).
    Scalers,
    Void,
}

impl Kind {
    pub(crate) fn of(code: u32) -> Option<Self> {
        Some(match code {
            0 => Self::Void,
            1 => Self::I8,
            2 => Self::I16,
            3 => Self::I32,
            4 => Self::I64,
            5 => Self::U8,
            6 => Self::U16,
            7 => Self::U32,
            8 => Self::U64,
            // 0x19 and 0x1A are numbers of a channel with a unit, which is in a property.
            9 | 0x19 => Self::F32,
            10 | 0x1A => Self::F64,
            0x20 => Self::Text,
            0x21 => Self::Bool,
            0x44 => Self::Time,
            0x08_000C => Self::Complex(8),
            0x10_000D => Self::Complex(16),
            u32::MAX => Self::Scalers,
            _ => return None,
        })
    }

    /// Returns the type of a DAQmx scaler. Its codes differ from those of other values.
    pub(crate) fn of_scaler(code: u32) -> Option<Self> {
        const KINDS: [Kind; 10] = [
            Kind::U8,
            Kind::I8,
            Kind::U16,
            Kind::I16,
            Kind::U32,
            Kind::I32,
            Kind::U64,
            Kind::I64,
            Kind::F32,
            Kind::F64,
        ];
        // Files with DAQmx data describe time stamps as scalers too.
        if code == u32::MAX { Some(Kind::Time) } else { KINDS.get(code as usize).copied() }
    }

    /// Returns the size of a value \[bytes\]; `None` for texts and scalers.
    pub(crate) fn size(self) -> Option<usize> {
        Some(match self {
            Self::Void => 0,
            Self::I8 | Self::U8 | Self::Bool => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
            Self::Time => 16,
            Self::Complex(size) => size,
            Self::Text | Self::Scalers => return None,
        })
    }

    pub(crate) fn is_number(self) -> bool {
        !matches!(self, Self::Void | Self::Time | Self::Text | Self::Complex(_) | Self::Scalers)
    }

    /// Returns the number at the start of `item`.
    pub(crate) fn number(self, item: &[u8], big_endian: bool) -> f64 {
        match self {
            Self::I8 => f64::from(i8::from_le_bytes(little_endian(item, big_endian))),
            Self::I16 => f64::from(i16::from_le_bytes(little_endian(item, big_endian))),
            Self::I32 => f64::from(i32::from_le_bytes(little_endian(item, big_endian))),
            Self::I64 => i64::from_le_bytes(little_endian(item, big_endian)) as f64,
            Self::U8 | Self::Bool => f64::from(u8::from_le_bytes(little_endian(item, big_endian))),
            Self::U16 => f64::from(u16::from_le_bytes(little_endian(item, big_endian))),
            Self::U32 => f64::from(u32::from_le_bytes(little_endian(item, big_endian))),
            Self::U64 => u64::from_le_bytes(little_endian(item, big_endian)) as f64,
            Self::F32 => f64::from(f32::from_le_bytes(little_endian(item, big_endian))),
            Self::F64 => f64::from_le_bytes(little_endian(item, big_endian)),
            Self::Void | Self::Time | Self::Text | Self::Complex(_) | Self::Scalers => f64::NAN,
        }
    }
}
