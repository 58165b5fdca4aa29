//! The schema: the columns, their types and the number of their buffers.

use super::fault::{FILE, Fault};
use super::flatbuffer::Table;
use crate::record::source::columnar::is_unit_key;

/// Deepest nesting of fields. Tables of numbers need at most three levels.
const MAX_DEPTH: usize = 16;
/// Largest number of fields of a file, including nested fields.
const MAX_FIELDS: usize = 100_000;
/// Largest size of all names, units and metadata \[bytes\]. A text can be referred to any number of times.
const MAX_TEXT: usize = 16 << 20;
/// Largest number of metadata pairs of one field.
const MAX_PAIRS: usize = 1000;

/// A type of numbers, with its width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Number {
    Float {
        bytes: usize,
    },
    Integer {
        bytes: usize,
        signed: bool,
    },
    Boolean,
    Decimal {
        bytes: usize,
        scale: i32,
    },
    /// Ticks since 1970. Ticks of four bytes are days.
    Instant {
        bytes: usize,
        per_second: i64,
    },
}

impl Number {
    /// Returns the size of `rows` numbers \[bytes\].
    pub(super) fn size(self, rows: usize) -> Option<usize> {
        match self {
            Self::Boolean => Some(rows.div_ceil(8)),
            Self::Float { bytes }
            | Self::Integer { bytes, .. }
            | Self::Decimal { bytes, .. }
            | Self::Instant { bytes, .. } => rows.checked_mul(bytes),
        }
    }
}

/// The type of the values of a field.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    Number(Number),
    /// Indices into the dictionary `id`, which holds numbers.
    Dictionary {
        id: i64,
        index: Number,
    },
    /// A struct, whose fields are columns.
    Struct,
    /// Lists of this length, of numbers.
    Lists(usize),
    /// Text, lists of varying length and other types, which are skipped.
    Other,
}

/// A field of the schema.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) unit: Option<String>,
    pub(super) kind: Kind,
    /// Number of buffers without those of its children.
    pub(super) buffers: usize,
    /// Whether each batch states a number of further buffers.
    pub(super) variadic: bool,
    pub(super) children: Vec<Field>,
}

/// The type of the values of a dictionary.
#[derive(Clone, Debug)]
pub(super) struct Dictionary {
    pub(super) id: i64,
    /// The field that describes the values.
    pub(super) values: Field,
}

/// A schema.
#[derive(Debug)]
pub(super) struct Schema {
    pub(super) fields: Vec<Field>,
    pub(super) dictionaries: Vec<Dictionary>,
    /// Key-value metadata of the file.
    pub(super) statements: Vec<(String, String)>,
}

impl Schema {
    /// Parses the schema in a message or footer. `open` is the Python function that opens such a file.
    ///
    /// # Errors
    /// If it is nested too deeply, has an unknown type, or is big-endian.
    pub(super) fn parse(table: Table<'_>, open: &str) -> Result<Self, Fault> {
        if table.i16(0, 0) != 0 {
            let line =
                format!("pyarrow.feather.write_feather(pyarrow.ipc.{open}(\"{FILE}\").read_all(), \"new.feather\")");
            return Err(Fault::new(format!(
                "the numbers are big-endian, which is not supported; in Python, {line} rewrites them"
            )));
        }
        let mut reading = Reading { count: 0, text: 0, dictionaries: Vec::new() };
        let fields = table.tables(1).map(|field| reading.field(field, 0)).collect::<Result<_, _>>()?;
        let statements = table.pairs(2).take(MAX_PAIRS);
        let statements =
            statements.map(|(key, value)| Ok((reading.text(key)?, reading.text(value)?))).collect::<Result<_, _>>()?;
        Ok(Self { fields, dictionaries: reading.dictionaries, statements })
    }
}

struct Reading {
    /// Number of fields so far.
    count: usize,
    /// Size of the text so far \[bytes\].
    text: usize,
    dictionaries: Vec<Dictionary>,
}

impl Reading {
    fn text(&mut self, text: &str) -> Result<String, Fault> {
        self.text += text.len();
        if self.text > MAX_TEXT { Err(Fault::damaged("the schema is too long")) } else { Ok(text.to_owned()) }
    }

    fn field(&mut self, table: Table<'_>, depth: usize) -> Result<Field, Fault> {
        self.count += 1;
        if depth > MAX_DEPTH || self.count > MAX_FIELDS {
            return Err(Fault::damaged("the schema is nested too deeply or has too many fields"));
        }
        let name = self.text(table.text(0).unwrap_or_default())?;
        let children = table.tables(5).map(|child| self.field(child, depth + 1)).collect::<Result<Vec<_>, _>>()?;
        let (kind, buffers, unit) = type_of(table.u8(2, 0), table.table(3), &children, &name)?;
        let stated = table.pairs(6).take(MAX_PAIRS).find(|(key, _)| is_unit_key(key)).map(|(_, unit)| unit);
        // The unit of a time is part of its type.
        let unit = unit.or(stated).map(|unit| self.text(unit)).transpose()?;
        let variadic = matches!(table.u8(2, 0), BINARY_VIEW | TEXT_VIEW);
        let field = Field { name, unit, kind, buffers, variadic, children };
        Ok(match table.table(4) {
            Some(encoding) => self.encoded(field, encoding),
            None => field,
        })
    }

    /// Makes a field of indices into a dictionary of `values`.
    fn encoded(&mut self, values: Field, encoding: Table<'_>) -> Field {
        let id = encoding.i64(0, 0);
        let index = encoding.table(1).map_or(Some(Number::Integer { bytes: 4, signed: true }), integer);
        // Dictionaries of times are not supported, because clocks count from the first row.
        let numeric = matches!(&values.kind, Kind::Number(number) if !matches!(number, Number::Instant { .. }));
        let kind = index.filter(|_| numeric).map_or(Kind::Other, |index| Kind::Dictionary { id, index });
        let (name, unit) = (values.name.clone(), values.unit.clone());
        if self.dictionaries.iter().all(|known| known.id != id) {
            self.dictionaries.push(Dictionary { id, values });
        }
        Field { name, unit, kind, buffers: 2, variadic: false, children: Vec::new() }
    }
}

const BINARY_VIEW: u8 = 23;
const TEXT_VIEW: u8 = 24;

fn integer(table: Table<'_>) -> Option<Number> {
    let bytes = match table.i32(0, 0) {
        8 => 1,
        16 => 2,
        32 => 4,
        64 => 8,
        _ => return None,
    };
    Some(Number::Integer { bytes, signed: table.u8(1, 0) != 0 })
}

/// Returns ticks per second and symbol of a time unit.
fn time_unit(unit: i16) -> Option<(i64, &'static str)> {
    [(1, "s"), (1000, "ms"), (1_000_000, "us"), (1_000_000_000, "ns")].get(usize::try_from(unit).ok()?).copied()
}

/// Returns kind, number of buffers and unit of a type, by its number in Arrow's `Schema.fbs`.
fn type_of(
    number: u8,
    parameters: Option<Table<'_>>,
    children: &[Field],
    name: &str,
) -> Result<(Kind, usize, Option<&'static str>), Fault> {
    let small = |field: usize, default: i16| parameters.map_or(default, |table| table.i16(field, default));
    let wide = |field: usize, default: i32| parameters.map_or(default, |table| table.i32(field, default));
    let plain = |number: Option<Number>| (number.map_or(Kind::Other, Kind::Number), 2, None);
    let ticks = |bytes, unit: i16| {
        let known = time_unit(unit);
        (
            known.map_or(Kind::Other, |_| Kind::Number(Number::Integer { bytes, signed: true })),
            2,
            known.map(|(_, symbol)| symbol),
        )
    };
    let instant = |bytes, per_second| (Kind::Number(Number::Instant { bytes, per_second }), 2, Some("s"));
    Ok(match number {
        // Null has no buffers; run ends and values are in the children.
        1 | 22 => (Kind::Other, 0, None),
        2 => plain(parameters.and_then(integer)),
        3 => {
            plain([2, 4, 8].get(usize::from(small(0, 0).cast_unsigned())).map(|bytes| Number::Float { bytes: *bytes }))
        }
        6 => plain(Some(Number::Boolean)),
        7 => {
            let bytes =
                [(32, 4), (64, 8), (128, 16)].iter().find(|(bits, _)| *bits == wide(2, 128)).map(|(_, bytes)| *bytes);
            plain(bytes.map(|bytes| Number::Decimal { bytes, scale: wide(1, 0) }))
        }
        8 if small(0, 1) == 0 => instant(4, 1),
        8 => instant(8, 1000),
        9 => ticks(if wide(1, 32) == 64 { 8 } else { 4 }, small(0, 1)),
        10 => match time_unit(small(0, 0)) {
            Some((per_second, _)) => instant(8, per_second),
            None => (Kind::Other, 2, None),
        },
        18 => ticks(8, small(0, 1)),
        13 => (Kind::Struct, 1, None),
        16 => match children {
            [child] if matches!(child.kind, Kind::Number(_)) => {
                (usize::try_from(wide(0, 0)).map_or(Kind::Other, Kind::Lists), 1, None)
            }
            _ => (Kind::Other, 1, None),
        },
        // Intervals, bytes of fixed length, lists and maps: validity, and values or offsets.
        11 | 12 | 15 | 17 | 21 => (Kind::Other, 2, None),
        // Text and bytes: validity, offsets, values. Lists by view: validity, offsets, sizes.
        4 | 5 | 19 | 20 | 25 | 26 => (Kind::Other, 3, None),
        // Views: validity and views.
        BINARY_VIEW | TEXT_VIEW => (Kind::Other, 2, None),
        // Unions: the type of each row, and its offset if the union is dense.
        14 => (Kind::Other, 1 + usize::from(small(0, 0) == 1), None),
        _ => {
            return Err(Fault::new(format!(
                "column \"{name}\" has a type that is not known (number {number}); write the file again without this column"
            )));
        }
    })
}
