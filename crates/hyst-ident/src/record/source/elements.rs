//! Conversion of numbers that are stored in binary formats.

/// The type of a stored number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl Kind {
    /// Returns the size of one number \[bytes\].
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// The storage of the numbers of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Storage {
    pub(crate) kind: Kind,
    pub(crate) big_endian: bool,
}

impl Storage {
    /// Returns contiguous numbers.
    pub(crate) fn all(self, bytes: &[u8]) -> Vec<f64> {
        self.column(bytes, 0, self.kind.size(), bytes.len() / self.kind.size())
    }

    /// Returns `rows` numbers. The first is at byte `first`, each following one `step` bytes later. NaN after the end
    /// of the bytes.
    pub(crate) fn column(self, bytes: &[u8], first: usize, step: usize, rows: usize) -> Vec<f64> {
        match self.kind {
            Kind::I8 => self.each(bytes, first, step, rows, |b: [u8; 1]| f64::from(i8::from_le_bytes(b))),
            Kind::U8 => self.each(bytes, first, step, rows, |b: [u8; 1]| f64::from(b[0])),
            Kind::I16 => self.each(bytes, first, step, rows, |b| f64::from(i16::from_le_bytes(b))),
            Kind::U16 => self.each(bytes, first, step, rows, |b| f64::from(u16::from_le_bytes(b))),
            Kind::I32 => self.each(bytes, first, step, rows, |b| f64::from(i32::from_le_bytes(b))),
            Kind::U32 => self.each(bytes, first, step, rows, |b| f64::from(u32::from_le_bytes(b))),
            Kind::I64 => self.each(bytes, first, step, rows, |b| i64::from_le_bytes(b) as f64),
            Kind::U64 => self.each(bytes, first, step, rows, |b| u64::from_le_bytes(b) as f64),
            Kind::F16 => self.each(bytes, first, step, rows, |b| half(u16::from_le_bytes(b))),
            Kind::F32 => self.each(bytes, first, step, rows, |b| f64::from(f32::from_le_bytes(b))),
            Kind::F64 => self.each(bytes, first, step, rows, f64::from_le_bytes),
        }
    }

    fn each<const N: usize>(
        self,
        bytes: &[u8],
        first: usize,
        step: usize,
        rows: usize,
        of: impl Fn([u8; N]) -> f64,
    ) -> Vec<f64> {
        let number = |row: usize| {
            let start = row.checked_mul(step)?.checked_add(first)?;
            let mut own: [u8; N] = bytes.get(start..)?.first_chunk().copied()?;
            if self.big_endian {
                own.reverse();
            }
            Some(of(own))
        };
        (0..rows).map(|row| number(row).unwrap_or(f64::NAN)).collect()
    }
}

/// Converts an IEEE 754 half-precision number exactly.
fn half(bits: u16) -> f64 {
    let (exponent, mantissa) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let magnitude = match exponent {
        0 => mantissa * 2f64.powi(-24),
        31 if mantissa == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + mantissa / 1024.0) * 2f64.powi(exponent - 15),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_converted_exactly() {
        let of = |kind, big_endian, bytes: &[u8]| Storage { kind, big_endian }.all(bytes);
        assert_eq!(of(Kind::F32, false, &0.1f32.to_le_bytes()), [f64::from(0.1f32)]);
        assert_eq!(of(Kind::I16, true, &[0xff, 0xfe, 0, 3]), [-2.0, 3.0]);
        assert_eq!(of(Kind::F16, false, &[0x00, 0x3c, 0x00, 0xc0, 0x01, 0x00]), [1.0, -2.0, 2f64.powi(-24)]);
        assert_eq!(of(Kind::U64, false, &[1, 0, 0, 0, 0, 0, 0, 0, 9]), [1.0]);
    }

    #[test]
    fn columns_of_a_table_are_extracted() {
        let storage = Storage { kind: Kind::U8, big_endian: false };
        assert_eq!(storage.column(&[1, 2, 3, 4, 5, 6], 1, 2, 3), [2.0, 4.0, 6.0]);
        assert!(storage.column(&[1, 2], 1, 2, 2)[1].is_nan());
        assert!(storage.column(&[1, 2], usize::MAX, usize::MAX, 3)[2].is_nan());
    }
}
