//! The numbers of a column of any stored type.

use parquet::basic::{ConvertedType, IntType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{DataType, Int96};
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::ColumnDescriptor;

use crate::record::source::columnar::{Clock, decimal, half};

/// Rows that are decoded at a time.
const ROWS: usize = 8192;
/// The Julian day number of 1970-01-01. Timestamps of 96 bits have Julian days.
const JULIAN_DAY_OF_1970: i128 = 2_440_588;

/// The meaning of stored values.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Meaning {
    Number,
    Unsigned,
    Half,
    /// Integers with this number of digits after the decimal point.
    Decimal(i32),
    /// Days since 1970.
    Days(Clock),
    /// Ticks since 1970.
    Instant(Clock),
    /// Times in this unit.
    Ticks(&'static str),
}

/// The numbers of a column so far.
pub(super) struct Numbers {
    meaning: Meaning,
    /// The definition level of a value that is not null; `None` if nulls are not allowed.
    defined: Option<i16>,
    /// The values; NaN for null.
    pub(super) values: Vec<f64>,
}

fn per_second(unit: &TimeUnit) -> (i64, &'static str) {
    match unit {
        TimeUnit::MILLIS => (1000, "ms"),
        TimeUnit::MICROS => (1_000_000, "us"),
        TimeUnit::NANOS => (1_000_000_000, "ns"),
    }
}

impl Meaning {
    /// Returns the meaning of the values of a column; `None` if they are not numbers.
    fn of(descriptor: &ColumnDescriptor) -> Option<Self> {
        let scaled = Self::Decimal(descriptor.type_scale());
        // Older programs state only the converted type.
        let stated = match (descriptor.logical_type_ref(), descriptor.converted_type()) {
            (Some(LogicalType::Decimal { .. }), _) | (None, ConvertedType::DECIMAL) => Some(scaled),
            (Some(LogicalType::Date), _) | (None, ConvertedType::DATE) => Some(Self::Days(Clock::new(1))),
            (Some(LogicalType::Timestamp(stamp)), _) => Some(Self::Instant(Clock::new(per_second(&stamp.unit).0))),
            (None, ConvertedType::TIMESTAMP_MILLIS) => Some(Self::Instant(Clock::new(1000))),
            (None, ConvertedType::TIMESTAMP_MICROS) => Some(Self::Instant(Clock::new(1_000_000))),
            (Some(LogicalType::Time(time)), _) => Some(Self::Ticks(per_second(&time.unit).1)),
            (None, ConvertedType::TIME_MILLIS) => Some(Self::Ticks("ms")),
            (None, ConvertedType::TIME_MICROS) => Some(Self::Ticks("us")),
            (Some(LogicalType::Integer(IntType { is_signed: false, .. })), _)
            | (
                None,
                ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32 | ConvertedType::UINT_64,
            ) => Some(Self::Unsigned),
            (Some(LogicalType::Float16), _) => Some(Self::Half),
            _ => None,
        };
        // A column that has only nulls has no type.
        if descriptor.logical_type_ref() == Some(&LogicalType::Unknown) {
            return None;
        }
        match descriptor.physical_type() {
            // Decimal numbers of more than 16 bytes are not supported: they have more digits than any measured value.
            Type::FIXED_LEN_BYTE_ARRAY if descriptor.type_length() > 16 => None,
            Type::BOOLEAN | Type::FLOAT | Type::DOUBLE => Some(Self::Number),
            Type::INT32 | Type::INT64 => Some(stated.filter(|stated| *stated != Self::Half).unwrap_or(Self::Number)),
            Type::INT96 => Some(Self::Instant(Clock::new(1_000_000_000))),
            Type::FIXED_LEN_BYTE_ARRAY => stated.filter(|stated| matches!(stated, Self::Half | Self::Decimal(_))),
            Type::BYTE_ARRAY => stated.filter(|stated| matches!(stated, Self::Decimal(_))),
        }
    }

    fn integer(&mut self, value: i64) -> f64 {
        match self {
            Self::Decimal(scale) => decimal(i128::from(value), *scale),
            Self::Days(clock) => value.checked_mul(86_400).map_or(f64::NAN, |seconds| clock.seconds(seconds)),
            Self::Instant(clock) => clock.seconds(value),
            Self::Unsigned => value.cast_unsigned() as f64,
            Self::Number | Self::Half | Self::Ticks(_) => value as f64,
        }
    }

    fn int96(&mut self, value: &Int96) -> f64 {
        let [low, high, day] = *value.data() else { return f64::NAN };
        let nanoseconds = i128::from(u64::from(high) << 32 | u64::from(low));
        let since = (i128::from(day) - JULIAN_DAY_OF_1970) * 86_400_000_000_000 + nanoseconds;
        i64::try_from(since).map_or(f64::NAN, |since| self.integer(since))
    }

    /// Converts a half-precision number, or an integer in big-endian order.
    fn bytes(&self, bytes: &[u8]) -> f64 {
        match (self, bytes) {
            (Self::Half, [low, high]) => half(u16::from_le_bytes([*low, *high])),
            (Self::Decimal(scale), [first, ..]) if bytes.len() <= 16 => {
                let sign = if first & 0x80 != 0 { -1_i128 } else { 0 };
                decimal(bytes.iter().fold(sign, |integer, byte| integer << 8 | i128::from(*byte)), *scale)
            }
            // An integer without bytes, or of more than 128 bits.
            _ => f64::NAN,
        }
    }
}

impl Numbers {
    /// Makes an empty column; `None` if the column does not hold numbers.
    pub(super) fn of(descriptor: &ColumnDescriptor) -> Option<Self> {
        let level = descriptor.max_def_level();
        let defined = (level > 0).then_some(level);
        Some(Self { meaning: Meaning::of(descriptor)?, defined, values: Vec::new() })
    }

    /// Returns the unit that the type states.
    pub(super) fn unit(&self) -> Option<&'static str> {
        match self.meaning {
            Meaning::Days(_) | Meaning::Instant(_) => Some("s"),
            Meaning::Ticks(unit) => Some(unit),
            _ => None,
        }
    }

    /// Appends the rows of a row group.
    pub(super) fn read(&mut self, reader: ColumnReader) -> Result<()> {
        let Self { meaning, defined, values } = self;
        let defined = *defined;
        match reader {
            ColumnReader::BoolColumnReader(reader) => {
                append(reader, defined, values, |value| f64::from(u8::from(*value)))
            }
            ColumnReader::FloatColumnReader(reader) => append(reader, defined, values, |value| f64::from(*value)),
            ColumnReader::DoubleColumnReader(reader) => append(reader, defined, values, |value| *value),
            ColumnReader::Int32ColumnReader(reader) if *meaning == Meaning::Unsigned => {
                append(reader, defined, values, |value| f64::from(value.cast_unsigned()))
            }
            ColumnReader::Int32ColumnReader(reader) => {
                append(reader, defined, values, |value| meaning.integer(i64::from(*value)))
            }
            ColumnReader::Int64ColumnReader(reader) => append(reader, defined, values, |value| meaning.integer(*value)),
            ColumnReader::Int96ColumnReader(reader) => append(reader, defined, values, |value| meaning.int96(value)),
            ColumnReader::FixedLenByteArrayColumnReader(reader) => {
                append(reader, defined, values, |value| meaning.bytes(value.data()))
            }
            ColumnReader::ByteArrayColumnReader(reader) => {
                append(reader, defined, values, |value| meaning.bytes(value.data()))
            }
        }
    }
}

/// Appends the values of a column chunk.
fn append<D: DataType>(
    mut reader: ColumnReaderImpl<D>,
    defined: Option<i16>,
    values: &mut Vec<f64>,
    mut convert: impl FnMut(&D::T) -> f64,
) -> Result<()> {
    let (mut stored, mut levels) = (Vec::new(), Vec::new());
    loop {
        stored.clear();
        levels.clear();
        let (rows, _, _) = reader.read_records(ROWS, defined.map(|_| &mut levels), None, &mut stored)?;
        if rows == 0 {
            return Ok(());
        }
        let Some(defined) = defined else {
            values.extend(stored.iter().map(&mut convert));
            continue;
        };
        let mut stored = stored.iter();
        for level in &levels {
            let value = if *level == defined {
                convert(stored.next().ok_or_else(|| ParquetError::EOF("fewer values than rows".to_owned()))?)
            } else {
                f64::NAN
            };
            values.push(value);
        }
    }
}
