//! Version 4: a sequence of matrices, each after a header of 20 bytes and its name.

use std::borrow::Cow;

use super::text;
use super::tree::{Array, Structs, Value, count};
use crate::record::source::elements::{Kind, Storage};

const HEADER: usize = 20;
/// Longest name. MATLAB allows 63 characters; other programs may allow more.
const LONGEST_NAME: usize = 256;

/// The first 20 bytes of a matrix.
#[derive(Clone, Copy, Debug)]
struct Header {
    storage: Storage,
    /// Class of the matrix; 0: numbers, 1: text, 2: sparse.
    class: u32,
    dims: [usize; 2],
    complex: bool,
    name_length: usize,
}

impl Header {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let word = |at: usize, big_endian: bool| {
            let own = *bytes.get(4 * at..)?.first_chunk()?;
            Some(if big_endian { u32::from_be_bytes(own) } else { u32::from_le_bytes(own) })
        };
        // Digits of the type: thousands = byte order, tens = type of the numbers, ones = class.
        let big_endian = word(0, false)? > 4052;
        let kind = word(0, big_endian)?;
        if kind / 1000 != u32::from(big_endian) || kind / 100 % 10 != 0 || kind % 10 > 2 {
            return None;
        }
        let number = match kind / 10 % 10 {
            0 => Kind::F64,
            1 => Kind::F32,
            2 => Kind::I32,
            3 => Kind::I16,
            4 => Kind::U16,
            5 => Kind::U8,
            _ => return None,
        };
        let size = |at: usize| usize::try_from(word(at, big_endian)?).ok();
        let (complex, name_length) = (word(3, big_endian)?, size(4)?);
        (complex <= 1 && (1..=LONGEST_NAME).contains(&name_length)).then_some(Self {
            storage: Storage { kind: number, big_endian },
            class: kind % 10,
            dims: [size(1)?, size(2)?],
            complex: complex == 1,
            name_length,
        })
    }
}

/// Returns whether a file begins with a valid header and a name. Version 4 has no signature.
pub(super) fn is(bytes: &[u8]) -> bool {
    let Some(header) = Header::parse(bytes) else { return false };
    let name = bytes.get(HEADER..).unwrap_or_default();
    let name = &name[..name.len().min(header.name_length)];
    let is_letter = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let letters = name.iter().position(|byte| *byte == 0).unwrap_or(name.len());
    name.first().is_some_and(u8::is_ascii_alphabetic)
        && name[..letters].iter().all(is_letter)
        && name[letters..].iter().all(|byte| *byte == 0)
}

/// Reads the matrices of a file.
pub(super) fn variables(bytes: &[u8]) -> Result<Structs<'_>, String> {
    let (mut names, mut values) = (Vec::new(), Vec::new());
    let mut at = 0;
    while at < bytes.len() {
        let rest = &bytes[at..];
        let number = names.len() + 1;
        let cut = |name: &str| format!("the file ends inside variable {number}{name}; it is cut off: copy it again");
        if rest.len() < HEADER {
            return Err(cut(""));
        }
        let header = Header::parse(rest)
            .ok_or_else(|| format!("variable {number} has no header of this format; save the file again with -v7"))?;
        let name = rest.get(HEADER..HEADER + header.name_length).ok_or_else(|| cut(""))?;
        let name = String::from_utf8_lossy(name).trim_end_matches('\0').to_owned();
        let start = HEADER + header.name_length;
        let size = count(&header.dims).and_then(|count| count.checked_mul(header.storage.kind.size()));
        let end = size
            .and_then(|size| size.checked_mul(if header.complex { 2 } else { 1 }))
            .and_then(|size| size.checked_add(start));
        let Some(data) = end.and_then(|end| rest.get(start..end)) else {
            let [rows, columns] = header.dims;
            return Err(format!(
                "variable {number}, \"{name}\", states {rows} × {columns} numbers, more than the file holds; \
                 the file is cut off or damaged: copy it again, or save it again"
            ));
        };
        values.push(array(header, data));
        names.push(name);
        at += start + data.len();
    }
    Ok(Structs { names, elements: vec![values] })
}

fn array(header: Header, data: &[u8]) -> Array<'_> {
    let value = match header.class {
        1 => {
            let codes: Vec<char> = header.storage.all(data).into_iter().map(|code| char::from(code as u8)).collect();
            Value::Text(text::lines(codes, header.dims[0]))
        }
        2 => Value::Unread("is sparse; save full(…) of it".to_owned()),
        _ if header.complex => Value::Unread("is complex; save real(…) or abs(…) of it".to_owned()),
        _ => Value::Numbers { bytes: Cow::Borrowed(data), storage: header.storage },
    };
    Array { dims: header.dims.to_vec(), value }
}
