//! A writer of small files.

use std::io::Write;

/// An array before the byte order is chosen.
#[derive(Clone)]
pub(super) struct Array {
    class: u32,
    dims: Vec<i32>,
    name: String,
    content: Vec<Element>,
}

#[derive(Clone)]
pub(super) enum Element {
    Doubles(Vec<f64>),
    Words(Vec<u32>),
    Bytes(u32, Vec<u8>),
    Array(Array),
}

/// The class of an array and the elements after its name.
pub(super) type Content = (u32, Vec<Element>);

impl Array {
    pub(super) fn complex(mut self) -> Self {
        self.class |= 0x800;
        self
    }
}

pub(super) fn array(name: &str, dims: &[i32], (class, content): Content) -> Array {
    Array { class, dims: dims.to_vec(), name: name.to_owned(), content }
}

pub(super) fn numbers(values: &[f64]) -> Content {
    (6, vec![Element::Doubles(values.to_vec())])
}

pub(super) fn empty() -> Array {
    array("", &[0, 0], (6, vec![Element::Doubles(vec![])]))
}

pub(super) fn text(name: &str, text: &str) -> Array {
    array(name, &[1, text.chars().count() as i32], (4, vec![Element::Bytes(16, text.as_bytes().to_vec())]))
}

pub(super) fn cells(cells: &[Array]) -> Content {
    (1, cells.iter().cloned().map(Element::Array).collect())
}

/// Structs with these fields and values.
pub(super) fn structs(names: &[&str], elements: &[&[Array]]) -> Content {
    let padded: Vec<u8> = names.iter().flat_map(|name| format!("{name:\0<32}").into_bytes()).collect();
    let values = elements.iter().flat_map(|element| element.iter().cloned().map(Element::Array));
    (2, [Element::Words(vec![32]), Element::Bytes(1, padded)].into_iter().chain(values).collect())
}

/// A file of version 5.
pub(super) fn file(variables: &[Array], big_endian: bool) -> Vec<u8> {
    let mut bytes = vec![b' '; 124];
    bytes[..19].copy_from_slice(b"MATLAB 5.0 MAT-file");
    bytes.extend(if big_endian { *b"\x01\0MI" } else { *b"\0\x01IM" });
    for variable in variables {
        put_array(&mut bytes, variable, big_endian);
    }
    bytes
}

fn word(value: u32, big_endian: bool) -> [u8; 4] {
    if big_endian { value.to_be_bytes() } else { value.to_le_bytes() }
}

fn put(bytes: &mut Vec<u8>, kind: u32, content: &[u8], big_endian: bool) {
    if content.len() <= 4 && !content.is_empty() && kind != 14 {
        bytes.extend(word((content.len() as u32) << 16 | kind, big_endian));
        bytes.extend(content);
        bytes.extend(vec![0; 4 - content.len()]);
        return;
    }
    bytes.extend(word(kind, big_endian));
    bytes.extend(word(content.len() as u32, big_endian));
    bytes.extend(content);
    bytes.extend(vec![0; content.len().next_multiple_of(8) - content.len()]);
}

fn put_array(bytes: &mut Vec<u8>, array: &Array, big_endian: bool) {
    let mut own = Vec::new();
    let words = |words: &[u32]| words.iter().flat_map(|value| word(*value, big_endian)).collect::<Vec<u8>>();
    put(&mut own, 6, &words(&[array.class, 0]), big_endian);
    put(&mut own, 5, &words(&array.dims.iter().map(|dim| *dim as u32).collect::<Vec<_>>()), big_endian);
    put(&mut own, 1, array.name.as_bytes(), big_endian);
    for element in &array.content {
        match element {
            Element::Doubles(values) => {
                let of = |value: &f64| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
                put(&mut own, 9, &values.iter().flat_map(of).collect::<Vec<u8>>(), big_endian);
            }
            Element::Words(values) => put(&mut own, 5, &words(values), big_endian),
            Element::Bytes(kind, content) => put(&mut own, *kind, content, big_endian),
            Element::Array(inner) => put_array(&mut own, inner, big_endian),
        }
    }
    put(bytes, 14, &own, big_endian);
}

/// A little-endian file with compressed variables.
pub(super) fn compressed(file: &[u8]) -> Vec<u8> {
    let (header, mut rest) = file.split_at(128);
    let mut bytes = header.to_vec();
    while rest.len() >= 8 {
        let size = u32::from_le_bytes([rest[4], rest[5], rest[6], rest[7]]) as usize;
        let (variable, after) = rest.split_at(8 + size.next_multiple_of(8));
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(variable).unwrap();
        let packed = encoder.finish().unwrap();
        bytes.extend(word(15, false));
        bytes.extend(word(packed.len() as u32, false));
        bytes.extend(packed);
        rest = after;
    }
    bytes
}

/// A file of version 4. `variables` have a name, a number of columns and values.
pub(super) fn version_4(variables: &[(&str, usize, &[f64])], big_endian: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (name, columns, values) in variables {
        let kind = if big_endian { 1000 } else { 0 };
        for value in [kind, (values.len() / columns) as u32, *columns as u32, 0, name.len() as u32 + 1] {
            bytes.extend(word(value, big_endian));
        }
        bytes.extend(name.as_bytes());
        bytes.push(0);
        bytes
            .extend(values.iter().flat_map(|value| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() }));
    }
    bytes
}
