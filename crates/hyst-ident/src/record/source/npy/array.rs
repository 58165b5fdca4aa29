//! An array of an NPY file: header and values.

use super::dtype::{Field, Kind, Tick, fields};
use super::literal::Literal;

/// The first bytes of an NPY file.
pub(crate) const TAG: &[u8] = b"\x93NUMPY";

/// The shape of an array without lengths of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    Scalar,
    Vector(usize),
    /// Rows and columns, with at least as many rows as columns.
    Table(usize, usize),
    /// Any other shape.
    Other,
}

/// An array whose values are not converted yet.
#[derive(Debug)]
pub(crate) struct Array<'a> {
    pub(crate) fields: Vec<Field>,
    pub(crate) shape: Shape,
    /// The lengths in the file.
    pub(crate) lengths: Vec<usize>,
    /// Number of bytes after the last value.
    pub(crate) surplus: usize,
    /// Whether the array is stored column by column (Fortran order).
    is_by_column: bool,
    /// Size of an element \[bytes\].
    size: usize,
    values: &'a [u8],
}

impl<'a> Array<'a> {
    pub(crate) fn parse(bytes: &'a [u8]) -> Result<Self, String> {
        let (header, body) = header(bytes)?;
        let header = Literal::parse(&header).ok_or("its header cannot be read; the file is damaged: save it again")?;
        let description = header.get("descr").ok_or("its header states no type; the file is damaged: save it again")?;
        let (fields, size) = fields(description)?;
        let shape = header.get("shape").and_then(Literal::list);
        let lengths: Option<Vec<usize>> = shape.and_then(|shape| shape.iter().map(Literal::integer).collect());
        let lengths = lengths.ok_or("its header states no valid shape; the file is damaged: save it again")?;
        if fields.iter().any(|field| field.kind == Kind::Objects) {
            return Err(
                "it holds Python objects (pickled), which are not supported; save numpy.asarray(x, dtype=float) instead"
                    .into(),
            );
        }
        let count = lengths.iter().try_fold(1_usize, |count, length| count.checked_mul(*length));
        let needed = count.and_then(|count| count.checked_mul(size)).filter(|needed| *needed <= body.len());
        let Some(needed) = needed else {
            let what = format!("its shape {lengths:?} needs more than the {} bytes in the file", body.len());
            return Err(format!("{what}; the file is cut off: copy it again"));
        };
        let (values, surplus) = body.split_at(needed);
        let is_by_column = header.get("fortran_order") == Some(&Literal::Bool(true));
        Ok(Self { fields, shape: shape_of(&lengths), lengths, surplus: surplus.len(), is_by_column, size, values })
    }

    /// Returns the number of columns of a field.
    pub(crate) fn columns(&self) -> usize {
        match self.shape {
            Shape::Scalar | Shape::Vector(_) => 1,
            Shape::Table(_, columns) => columns,
            Shape::Other => 0,
        }
    }

    /// Returns the bytes of a field in each element of a column.
    fn items<'b>(&'b self, field: &'b Field, column: usize) -> impl Iterator<Item = &'a [u8]> + 'b {
        let (rows, columns) = match self.shape {
            Shape::Scalar => (1, 1),
            Shape::Vector(rows) => (rows, 1),
            Shape::Table(rows, columns) => (rows, columns),
            Shape::Other => (0, 1),
        };
        let (first, step) = if self.is_by_column { (column * rows, 1) } else { (column, columns) };
        (0..rows).filter_map(move |row| {
            let start = (first + row * step) * self.size + field.offset;
            self.values.get(start..start + field.size)
        })
    }

    /// Returns the numbers of a column; `None` for texts and other types that are not numbers.
    ///
    /// Times are in seconds, dates in seconds since the midnight (UTC) before the first.
    pub(crate) fn numbers(&self, field: &Field, column: usize) -> Option<Vec<f64>> {
        let items = self.items(field, column);
        let order = |item: &[u8]| word(item, field.big_endian);
        Some(match (field.kind, field.size) {
            (Kind::Float, 8) => items.map(|item| f64::from_bits(order(item))).collect(),
            (Kind::Float, 4) => items.map(|item| f64::from(f32::from_bits(order(item) as u32))).collect(),
            (Kind::Float, _) => items.map(|item| half(order(item) as u16)).collect(),
            (Kind::Signed, size) => items.map(|item| signed(order(item), size) as f64).collect(),
            (Kind::Unsigned | Kind::Bool, _) => items.map(|item| order(item) as f64).collect(),
            (Kind::Time { is_date, tick }, size) => {
                seconds(items.map(|item| signed(order(item), size)).collect(), is_date, tick)
            }
            _ => return None,
        })
    }

    /// Returns the texts of the first column of a field; `None` if it does not hold texts.
    pub(crate) fn texts(&self, field: &Field) -> Option<Vec<String>> {
        let items = self.items(field, 0);
        match field.kind {
            Kind::Bytes => Some(items.map(|item| trimmed(String::from_utf8_lossy(item).into_owned())).collect()),
            Kind::Text => {
                let character = |item: &[u8]| char::from_u32(word(item, field.big_endian) as u32).unwrap_or('\u{FFFD}');
                Some(items.map(|item| trimmed(item.chunks(4).map(character).collect())).collect())
            }
            _ => None,
        }
    }
}

/// Splits a file into header and values.
fn header(bytes: &[u8]) -> Result<(String, &[u8]), String> {
    const CUT: &str = "it ends within its header; the file is cut off: copy it again";
    let version = *bytes.get(TAG.len()).ok_or(CUT)?;
    // The minor version is not needed.
    let rest = bytes.get(TAG.len() + 2..).ok_or(CUT)?;
    let digits = match version {
        1 => 2,
        2 | 3 => 4,
        other => return Err(format!("its version {other} is not known; save the array with numpy.save")),
    };
    let (length, rest) = rest.split_at_checked(digits).ok_or(CUT)?;
    let length = usize::try_from(word(length, false)).unwrap_or(usize::MAX);
    let (header, body) = rest.split_at_checked(length).ok_or(CUT)?;
    let text = match version {
        3 => String::from_utf8_lossy(header).into_owned(),
        // Latin-1.
        _ => header.iter().map(|byte| char::from(*byte)).collect(),
    };
    Ok((text, body))
}

/// Returns the shape without lengths of 1.
fn shape_of(lengths: &[usize]) -> Shape {
    let long: Vec<usize> = lengths.iter().copied().filter(|length| *length != 1).collect();
    match *long.as_slice() {
        [] => Shape::Scalar,
        [rows] => Shape::Vector(rows),
        [rows, columns] if rows >= columns => Shape::Table(rows, columns),
        _ => Shape::Other,
    }
}

/// Returns up to eight bytes as an integer.
fn word(item: &[u8], big_endian: bool) -> u64 {
    let add = |word: u64, byte: &u8| word << 8 | u64::from(*byte);
    if big_endian { item.iter().fold(0, add) } else { item.iter().rev().fold(0, add) }
}

/// Returns the lowest `size` bytes of `word` as a signed integer.
fn signed(word: u64, size: usize) -> i64 {
    let unused = 64 - 8 * size.clamp(1, 8) as u32;
    (word << unused) as i64 >> unused
}

/// Converts an IEEE 754 half-precision number.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2_f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

/// Converts times to seconds. Dates are counted from the midnight before the first.
///
/// Ticks are subtracted as integers, because a double does not resolve nanoseconds since 1970.
fn seconds(ticks: Vec<i64>, is_date: bool, tick: Tick) -> Vec<f64> {
    // NaT ("not a time") of NumPy.
    const NONE: i64 = i64::MIN;
    let scaled = |ticks: i64| i128::from(ticks) * tick.numerator;
    let day = 86_400 * tick.denominator;
    let first = ticks.iter().copied().find(|ticks| *ticks != NONE).filter(|_| is_date);
    let start = first.map_or(0, |first| scaled(first).div_euclid(day) * day);
    let since =
        |ticks: i64| if ticks == NONE { f64::NAN } else { (scaled(ticks) - start) as f64 / tick.denominator as f64 };
    ticks.into_iter().map(since).collect()
}

fn trimmed(text: String) -> String {
    text.trim_end_matches('\0').trim().to_owned()
}
