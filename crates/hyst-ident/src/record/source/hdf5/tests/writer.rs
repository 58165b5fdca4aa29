//! A writer of small files: superblock version 2, object headers version 2, data in the headers.

use std::ops::Range;

const USER_BLOCK: usize = 512;
const UNDEFINED: [u8; 8] = [0xff; 8];

/// A group or a dataset.
#[derive(Clone)]
pub(super) struct Node {
    members: Vec<(&'static str, Node)>,
    data: Option<(Vec<u64>, Vec<f64>)>,
    attributes: Vec<(&'static str, Attribute)>,
}

#[derive(Clone)]
pub(super) struct Attribute {
    datatype: Vec<u8>,
    dims: Vec<u64>,
    data: Vec<u8>,
}

impl Attribute {
    pub(super) fn number(value: f64) -> Self {
        Self { datatype: double(), dims: vec![], data: value.to_le_bytes().to_vec() }
    }

    pub(super) fn text(text: &str) -> Self {
        Self { dims: vec![], ..Self::texts(&[text]) }
    }

    pub(super) fn texts(texts: &[&str]) -> Self {
        let size = texts.iter().map(|text| text.len()).max().unwrap_or(1);
        let mut data = vec![0; size * texts.len()];
        for (cell, text) in data.chunks_mut(size).zip(texts) {
            cell[..text.len()].copy_from_slice(text.as_bytes());
        }
        let datatype = [&[0x13, 0x11, 0, 0][..], &(size as u32).to_le_bytes()].concat();
        Self { datatype, dims: vec![texts.len() as u64], data }
    }
}

impl Node {
    pub(super) fn group(members: Vec<(&'static str, Self)>) -> Self {
        Self { members, data: None, attributes: vec![] }
    }

    pub(super) fn vector(values: &[f64]) -> Self {
        Self::table(&[values.len() as u64], values)
    }

    pub(super) fn table(dims: &[u64], values: &[f64]) -> Self {
        Self { members: vec![], data: Some((dims.to_vec(), values.to_vec())), attributes: vec![] }
    }

    /// A dataset without the numbers that its dimensions state.
    pub(super) fn claimed(dims: &[u64]) -> Self {
        Self::table(dims, &[])
    }

    pub(super) fn with(mut self, name: &'static str, attribute: Attribute) -> Self {
        self.attributes.push((name, attribute));
        self
    }

    /// Appends the object after its members and returns its address.
    fn put(&self, bytes: &mut Vec<u8>, base: usize, blocks: &mut Vec<Range<usize>>) -> u64 {
        let members: Vec<(&str, u64)> =
            self.members.iter().map(|(name, node)| (*name, node.put(bytes, base, blocks))).collect();
        let mut messages = Vec::new();
        match &self.data {
            None => {
                message(&mut messages, 2, &[&[0, 0][..], &UNDEFINED, &UNDEFINED].concat());
                for (name, address) in members {
                    message(
                        &mut messages,
                        6,
                        &[&[1, 0, name.len() as u8][..], name.as_bytes(), &address.to_le_bytes()].concat(),
                    );
                }
            }
            Some((dims, values)) => {
                let raw: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
                message(&mut messages, 1, &dataspace(dims));
                message(&mut messages, 3, &double());
                message(&mut messages, 8, &[&[3, 0][..], &(raw.len() as u16).to_le_bytes(), &raw].concat());
            }
        }
        for (name, attribute) in &self.attributes {
            let space = dataspace(&attribute.dims);
            let sizes = [name.len() + 1, attribute.datatype.len(), space.len()]
                .map(|size| (size as u16).to_le_bytes())
                .concat();
            let content =
                [&[3, 0][..], &sizes, &[0], name.as_bytes(), &[0], &attribute.datatype, &space, &attribute.data]
                    .concat();
            message(&mut messages, 12, &content);
        }
        let start = bytes.len();
        bytes.extend(b"OHDR\x02\x02");
        bytes.extend((messages.len() as u32).to_le_bytes());
        bytes.extend(messages);
        blocks.push(start..bytes.len());
        bytes.extend([0; 4]);
        (start - base) as u64
    }
}

fn message(messages: &mut Vec<u8>, kind: u8, content: &[u8]) {
    messages.push(kind);
    messages.extend((content.len() as u16).to_le_bytes());
    messages.push(0);
    messages.extend(content);
}

fn dataspace(dims: &[u64]) -> Vec<u8> {
    let mut space = vec![2, dims.len() as u8, 0, u8::from(!dims.is_empty())];
    space.extend(dims.iter().flat_map(|dim| dim.to_le_bytes()));
    space
}

fn double() -> Vec<u8> {
    let mut datatype = vec![0x11, 0x20, 0x3f, 0, 8, 0, 0, 0];
    datatype.extend([0, 0, 64, 0, 52, 11, 0, 52]);
    datatype.extend(1023_u32.to_le_bytes());
    datatype
}

pub(super) struct File {
    root: Node,
}

impl File {
    pub(super) fn new(members: Vec<(&'static str, Node)>) -> Self {
        Self { root: Node::group(members) }
    }

    pub(super) fn bytes(&self) -> Vec<u8> {
        self.write(0).0
    }

    /// Returns the file with a MATLAB header.
    pub(super) fn matlab(&self) -> Vec<u8> {
        let mut bytes = self.write(USER_BLOCK).0;
        bytes[..MATLAB.len()].copy_from_slice(MATLAB);
        bytes
    }

    /// Returns the place at which the HDF5 data begin.
    pub(super) fn start(&self, bytes: &[u8]) -> usize {
        if bytes.starts_with(MATLAB) { USER_BLOCK } else { 0 }
    }

    /// Returns the ranges that a checksum follows.
    pub(super) fn blocks(&self, bytes: &[u8]) -> Vec<Range<usize>> {
        self.write(self.start(bytes)).1
    }

    fn write(&self, base: usize) -> (Vec<u8>, Vec<Range<usize>>) {
        let mut bytes = vec![0; base + 48];
        let mut blocks = Vec::new();
        let root = self.root.put(&mut bytes, base, &mut blocks);
        let end = bytes.len() as u64;
        let addresses = [(base as u64).to_le_bytes(), UNDEFINED, end.to_le_bytes(), root.to_le_bytes()].concat();
        let superblock = [super::SIGNATURE, &[2, 8, 8, 0], &addresses].concat();
        bytes[base..base + superblock.len()].copy_from_slice(&superblock);
        blocks.push(base..base + superblock.len());
        checksummed(&mut bytes, &blocks);
        (bytes, blocks)
    }
}

use super::MATLAB;

/// Writes checksums after the ranges.
pub(super) fn checksummed(bytes: &mut [u8], blocks: &[Range<usize>]) {
    for block in blocks {
        let sum = lookup3(&bytes[block.clone()]);
        bytes[block.end..block.end + 4].copy_from_slice(&sum.to_le_bytes());
    }
}

/// Computes the Jenkins hash that HDF5 uses.
fn lookup3(bytes: &[u8]) -> u32 {
    let start = 0xdead_beef_u32.wrapping_add(bytes.len() as u32);
    let (mut a, mut b, mut c) = (start, start, start);
    let word = |bytes: &[u8], at: usize| {
        (0..4).fold(0, |word, k| word | bytes.get(at + k).map_or(0, |byte| u32::from(*byte) << (8 * k)))
    };
    let mut rest = bytes;
    while rest.len() > 12 {
        a = a.wrapping_add(word(rest, 0));
        b = b.wrapping_add(word(rest, 4));
        c = c.wrapping_add(word(rest, 8));
        for (from, by) in [(0, 4), (1, 6), (2, 8), (0, 16), (1, 19), (2, 4)] {
            let (x, y, z) = match from {
                0 => (&mut a, &mut b, &mut c),
                1 => (&mut b, &mut c, &mut a),
                _ => (&mut c, &mut a, &mut b),
            };
            *x = x.wrapping_sub(*z) ^ z.rotate_left(by);
            *z = z.wrapping_add(*y);
        }
        rest = &rest[12..];
    }
    if rest.is_empty() {
        return c;
    }
    a = a.wrapping_add(word(rest, 0));
    b = b.wrapping_add(word(rest, 4));
    c = c.wrapping_add(word(rest, 8));
    for (from, by) in [(0, 14), (1, 11), (2, 25), (0, 16), (1, 4), (2, 14), (0, 24)] {
        let (x, y) = match from {
            0 => (&mut c, b),
            1 => (&mut a, c),
            _ => (&mut b, a),
        };
        *x = (*x ^ y).wrapping_sub(y.rotate_left(by));
    }
    c
}
