//! Versions 5 to 7: tagged elements. Each variable is one element, which is compressed since version 7.

use std::borrow::Cow;
use std::io::Read;

use super::text;
use super::tree::{Array, Structs, Value, count};
use crate::record::source::elements::{Kind, Storage};
use crate::record::source::gather::Budget;

const HEADER: usize = 128;
/// Deepest nesting of structs.
const MAX_DEPTH: u32 = 32;
/// Largest number of arrays of a file, including those in cells and structs.
const MAX_ARRAYS: usize = 1_000_000;
const MAX_DIMENSIONS: usize = 32;

const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

const CUT: &str = "the file ends inside it; it is cut off: copy it again";

/// The header of a file: the first 128 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Header {
    big_endian: bool,
}

/// Returns whether a file begins like one of version 5, also if it is truncated inside the header.
pub(super) fn is(bytes: &[u8]) -> bool {
    match bytes.get(HEADER - 4..HEADER) {
        Some(end) => end == [0, 1, b'I', b'M'] || end == [1, 0, b'M', b'I'],
        None => bytes.starts_with(b"MATLAB 5.0 MAT-file"),
    }
}

pub(super) fn header(bytes: &[u8]) -> Result<Header, String> {
    let big_endian =
        bytes.get(HEADER - 1).ok_or("the file ends inside its header; it is cut off: copy it again")? == &b'I';
    Ok(Header { big_endian })
}

/// The element of a variable.
pub(super) struct Part<'a> {
    bytes: Cow<'a, [u8]>,
    /// The range of the content without the tag.
    range: std::ops::Range<usize>,
}

/// Returns the elements of all variables, uncompressed.
pub(super) fn unpack<'a>(bytes: &'a [u8], header: Header, budget: &mut Budget) -> Result<Vec<Part<'a>>, String> {
    let mut parts = Vec::new();
    let mut elements = Elements { bytes: bytes.get(HEADER..).unwrap_or_default(), big_endian: header.big_endian };
    while !elements.bytes.is_empty() {
        let fault = |what: String| format!("variable {}: {what}", parts.len() + 1);
        let (kind, content) = elements.next().map_err(fault)?;
        match kind {
            MATRIX => parts.push(Part { bytes: Cow::Borrowed(content), range: 0..content.len() }),
            COMPRESSED => {
                let own = inflate(content, budget).map_err(fault)?;
                let mut inner = Elements { bytes: &own, big_endian: header.big_endian };
                if let (MATRIX, content) = inner.next().map_err(fault)? {
                    // The tag of a matrix always has eight bytes.
                    let range = 8..8 + content.len();
                    parts.push(Part { bytes: Cow::Owned(own), range });
                }
            }
            _ => {}
        }
    }
    Ok(parts)
}

fn inflate(content: &[u8], budget: &mut Budget) -> Result<Vec<u8>, String> {
    let mut own = Vec::new();
    let read = flate2::read::ZlibDecoder::new(content).take(budget.remaining().saturating_add(1)).read_to_end(&mut own);
    read.map_err(|error| format!("cannot be unpacked ({error}); the file is damaged: copy it again"))?;
    budget.take(own.len() as u64)?;
    Ok(own)
}

/// Parses the variables in the elements.
pub(super) fn variables<'a>(parts: &'a [Part<'_>], header: Header) -> Result<Structs<'a>, String> {
    let (mut names, mut values) = (Vec::new(), Vec::new());
    let mut left = MAX_ARRAYS;
    for part in parts {
        let elements = Elements { bytes: &part.bytes[part.range.clone()], big_endian: header.big_endian };
        let mut matrix = Matrix { elements, left: &mut left, depth: MAX_DEPTH };
        let start = matrix.start().map_err(|what| format!("variable {}: {what}", names.len() + 1))?;
        // A variable without a name belongs to MATLAB objects.
        if start.name.is_empty() {
            continue;
        }
        let value = matrix.value(&start).map_err(|what| format!("variable \"{}\": {what}", start.name))?;
        names.push(start.name);
        values.push(Array { dims: start.dims, value });
    }
    Ok(Structs { names, elements: vec![values] })
}

/// A sequence of elements.
struct Elements<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl<'a> Elements<'a> {
    fn word(&mut self) -> Result<u32, String> {
        let (own, rest) = self.bytes.split_first_chunk().ok_or(CUT)?;
        self.bytes = rest;
        Ok(if self.big_endian { u32::from_be_bytes(*own) } else { u32::from_le_bytes(*own) })
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (own, rest) = self.bytes.split_at_checked(count).ok_or(CUT)?;
        self.bytes = rest;
        Ok(own)
    }

    /// Returns the type and the content of the next element.
    fn next(&mut self) -> Result<(u32, &'a [u8]), String> {
        let word = self.word()?;
        // A content of up to four bytes is in the tag itself.
        if word >> 16 != 0 {
            let own = self.take(4)?.get(..(word >> 16) as usize);
            return Ok((word & 0xffff, own.ok_or("a short element is longer than four bytes; save the file again")?));
        }
        let size = self.word()? as usize;
        let own = self.take(size)?;
        if word != COMPRESSED {
            let padding = size.next_multiple_of(8) - size;
            self.bytes = self.bytes.get(padding..).unwrap_or_default();
        }
        Ok((word, own))
    }

    fn storage(&self, kind: u32) -> Result<Storage, String> {
        let kind = match kind {
            1 => Kind::I8,
            2 | 16 => Kind::U8,
            3 => Kind::I16,
            4 | 17 => Kind::U16,
            5 => Kind::I32,
            6 | 18 => Kind::U32,
            7 => Kind::F32,
            9 => Kind::F64,
            12 => Kind::I64,
            13 => Kind::U64,
            other => return Err(format!("numbers of the unknown type {other}; save the file again")),
        };
        Ok(Storage { kind, big_endian: self.big_endian })
    }

    fn numbers(&mut self) -> Result<Vec<f64>, String> {
        let (kind, content) = self.next()?;
        Ok(self.storage(kind)?.all(content))
    }
}

/// The beginning of an array.
struct Start {
    class: u32,
    complex: bool,
    dims: Vec<usize>,
    name: String,
}

/// An array being parsed.
struct Matrix<'a, 'b> {
    elements: Elements<'a>,
    /// Number of further arrays that are allowed.
    left: &'b mut usize,
    /// Number of further levels that are allowed.
    depth: u32,
}

impl<'a> Matrix<'a, '_> {
    fn start(&mut self) -> Result<Start, String> {
        *self.left = self.left.checked_sub(1).ok_or("more than a million arrays; save only the signals")?;
        // A field that was not set is empty.
        if self.elements.bytes.is_empty() {
            return Ok(Start { class: 6, complex: false, dims: vec![0, 0], name: String::new() });
        }
        let flags =
            self.elements.numbers()?.first().copied().ok_or("an array without flags; save the file again")? as u32;
        let (class, complex) = (flags & 0xff, flags & 0x800 != 0);
        // An object has its name in the place of the dimensions.
        if class == 17 {
            let name = String::from_utf8_lossy(self.elements.next()?.1).into_owned();
            return Ok(Start { class, complex, dims: Vec::new(), name });
        }
        let dims: Vec<usize> = self.elements.numbers()?.into_iter().map(|dim| dim.max(0.0) as usize).collect();
        if dims.len() > MAX_DIMENSIONS {
            return Err(format!("more than {MAX_DIMENSIONS} dimensions; save the file again"));
        }
        let name = String::from_utf8_lossy(self.elements.next()?.1).trim_end_matches('\0').to_owned();
        Ok(Start { class, complex, dims, name })
    }

    fn value(&mut self, start: &Start) -> Result<Value<'a>, String> {
        let count = count(&start.dims).ok_or("its dimensions are too large; the file is damaged: copy it again")?;
        Ok(match start.class {
            1 => {
                self.claim(count)?;
                Value::Cells((0..count).map(|_| self.inner()).collect::<Result<_, _>>()?)
            }
            2 => Value::Structs(self.structs(count)?),
            3 => {
                self.elements.next()?;
                Value::Structs(self.structs(count)?)
            }
            4 => Value::Text(self.text(start.dims.first().copied().unwrap_or(1))?),
            5 => Value::Unread("is sparse; save full(…) of it".to_owned()),
            6..=15 if start.complex => Value::Unread("is complex; save real(…) or abs(…) of it".to_owned()),
            6..=15 if count == 0 => Value::empty(),
            6..=15 => {
                let (kind, content) = self.elements.next()?;
                let storage = self.elements.storage(kind)?;
                if content.len() / storage.kind.size() != count {
                    let found = content.len() / storage.kind.size();
                    return Err(format!(
                        "{found} numbers found, but {count} are stated; the file is damaged: copy it again"
                    ));
                }
                Value::Numbers { bytes: Cow::Borrowed(content), storage }
            }
            16 => Value::Unread("is a function".to_owned()),
            17 => Value::Unread(
                "is a MATLAB object; save its parts as arrays, for example t = x.Time; y = x.Data; save file.mat t y"
                    .to_owned(),
            ),
            _ => Value::Unread("has an unknown class".to_owned()),
        })
    }

    /// Refuses a number of arrays that the remaining bytes cannot hold. The shortest array has eight bytes.
    fn claim(&self, count: usize) -> Result<(), String> {
        if count > self.elements.bytes.len() / 8 + 1 {
            return Err(format!(
                "{count} elements are stated, more than the file can hold; the file is damaged: copy it again"
            ));
        }
        Ok(())
    }

    /// Parses an array inside this one.
    fn inner(&mut self) -> Result<Array<'a>, String> {
        let (kind, content) = self.elements.next()?;
        if kind != MATRIX {
            return Err("an element is not an array; the file is damaged: copy it again".to_owned());
        }
        let depth = self
            .depth
            .checked_sub(1)
            .ok_or_else(|| format!("structs are nested more than {MAX_DEPTH} deep; save only the signals"))?;
        let elements = Elements { bytes: content, big_endian: self.elements.big_endian };
        let mut inner = Matrix { elements, left: self.left, depth };
        let start = inner.start()?;
        let value = inner.value(&start)?;
        Ok(Array { dims: start.dims, value })
    }

    fn structs(&mut self, count: usize) -> Result<Structs<'a>, String> {
        let length = self.elements.numbers()?.first().copied().unwrap_or_default() as usize;
        let (_, names) = self.elements.next()?;
        if length == 0 && !names.is_empty() {
            return Err("a struct has fields without names; save the file again".to_owned());
        }
        let text = |name: &[u8]| {
            String::from_utf8_lossy(name.split(|byte| *byte == 0).next().unwrap_or_default()).into_owned()
        };
        let names: Vec<String> = names.chunks(length.max(1)).map(text).collect();
        if names.is_empty() {
            return Ok(Structs::default());
        }
        self.claim(count.saturating_mul(names.len()))?;
        let mut element = || names.iter().map(|_| self.inner()).collect::<Result<Vec<_>, _>>();
        let elements = (0..count).map(|_| element()).collect::<Result<_, _>>()?;
        Ok(Structs { names, elements })
    }

    fn text(&mut self, rows: usize) -> Result<Vec<String>, String> {
        if self.elements.bytes.is_empty() {
            return Ok(Vec::new());
        }
        let (kind, content) = self.elements.next()?;
        if kind == 16 {
            return Ok(text::lines(String::from_utf8_lossy(content).chars().collect(), rows));
        }
        let codes: Vec<u16> = self.elements.storage(kind)?.all(content).into_iter().map(|code| code as u16).collect();
        Ok(text::from_codes(&codes, rows))
    }
}
