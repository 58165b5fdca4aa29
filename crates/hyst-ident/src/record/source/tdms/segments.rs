//! Segments of a TDMS file: a lead-in, a description of objects, and raw data.
//!
//! A segment describes only the differences from the segment before. Objects are the file, its groups and their
//! channels.

use std::collections::HashMap;

use super::bytes::{Cursor, Kind};
use super::data;
use super::objects::{Index, Object, Property, Scaler};

/// Size of a lead-in \[bytes\].
const LEAD_IN: usize = 28;
/// The tag of a segment.
const TAG: &[u8] = b"TDSm";
/// Bits of the lead-in.
const HAS_METADATA: u32 = 1 << 1;
const HAS_NEW_LIST: u32 = 1 << 2;
const HAS_RAW_DATA: u32 = 1 << 3;
const IS_INTERLEAVED: u32 = 1 << 5;
const IS_BIG_ENDIAN: u32 = 1 << 6;
/// Headers of a raw data index.
const NO_RAW_DATA: u32 = u32::MAX;
const AS_BEFORE: u32 = 0;
const DAQMX_SCALERS: u32 = 0x1269;
const DAQMX_DIGITAL_LINES: u32 = 0x126A;
/// Largest number of DAQmx scalers of a channel. Usual are one, or a few whose sum is the value.
const MAX_SCALERS: u32 = 256;

/// The objects of a file.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    pub(crate) objects: Vec<Object>,
    /// The segment in which the file is truncated, counted from 1.
    pub(crate) cut_in: Option<usize>,
    by_path: HashMap<String, usize>,
    /// Objects of the segment, and whether they have raw data in it.
    listed: Vec<(usize, bool)>,
    /// The place of each object in `listed`.
    place: Vec<Option<usize>>,
    /// Objects with raw data in the segment, in order.
    active: Vec<usize>,
}

impl Contents {
    /// Reads all segments.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, String> {
        let mut contents = Self::default();
        let (mut at, mut number) = (0, 0);
        while at < bytes.len() {
            number += 1;
            let rest = &bytes[at..];
            if rest.len() < LEAD_IN && (rest.starts_with(TAG) || TAG.starts_with(rest)) {
                contents.cut_in = Some(number);
                break;
            }
            if !rest.starts_with(TAG) {
                return Err(format!(
                    "no segment begins at byte {at}, where the one before ends; the file is damaged: copy it again"
                ));
            }
            at += contents.segment(rest, number)?;
        }
        Ok(contents)
    }

    /// Reads the segment at the start of `rest` and returns its length.
    fn segment(&mut self, rest: &[u8], number: usize) -> Result<usize, String> {
        let flags = Cursor::new(&rest[TAG.len()..], false).u32()?;
        let big_endian = flags & IS_BIG_ENDIAN != 0;
        let mut lead_in = Cursor::new(&rest[12..], big_endian);
        let (length, metadata) = (lead_in.u64()?, lead_in.u64()?);
        // A program that is stopped while writing leaves a length with all bits set.
        let body = &rest[LEAD_IN..];
        let is_cut = usize::try_from(length).map_or(true, |length| length > body.len());
        let body = &body[..usize::try_from(length).unwrap_or(usize::MAX).min(body.len())];
        let metadata = usize::try_from(metadata).unwrap_or(usize::MAX).min(body.len());
        let (described, raw) = body.split_at(metadata);
        let done = self.describe(described, flags, big_endian).and_then(|()| {
            let is_interleaved = flags & IS_INTERLEAVED != 0;
            let layout = data::Layout { is_interleaved, is_cut, big_endian };
            if flags & HAS_RAW_DATA == 0 { Ok(()) } else { data::read(raw, layout, &self.active, &mut self.objects) }
        });
        if is_cut {
            // Errors in a truncated segment are due to the missing end.
            self.cut_in = Some(number);
        } else {
            done.map_err(|what| format!("segment {number}: {what}"))?;
        }
        Ok(LEAD_IN + body.len())
    }

    /// Reads the description of the objects of a segment.
    fn describe(&mut self, described: &[u8], flags: u32, big_endian: bool) -> Result<(), String> {
        if flags & HAS_METADATA == 0 {
            return Ok(());
        }
        if flags & HAS_NEW_LIST != 0 {
            for (object, _) in self.listed.drain(..) {
                self.place[object] = None;
            }
        }
        let mut cursor = Cursor::new(described, big_endian);
        for _ in 0..cursor.u32()? {
            let path = cursor.text()?;
            let at = self.object(path);
            let object = &mut self.objects[at];
            let has_data = index(&mut cursor, object).map_err(|what| named(object, &what))?;
            match self.place[at] {
                Some(place) => self.listed[place].1 = has_data,
                None => {
                    self.place[at] = Some(self.listed.len());
                    self.listed.push((at, has_data));
                }
            }
            for _ in 0..cursor.u32()? {
                let (name, value) = property(&mut cursor).map_err(|what| named(object, &what))?;
                object.set(name, value);
            }
        }
        let has_values = |index: &Index| index.bytes > 0 || index.count > 0 && !index.scalers.is_empty();
        let is_active = |(object, has_data): &&(usize, bool)| {
            *has_data && self.objects[*object].index.as_ref().is_some_and(has_values)
        };
        self.active = self.listed.iter().filter(is_active).map(|(object, _)| *object).collect();
        Ok(())
    }

    /// Returns the number of the object with this path.
    fn object(&mut self, path: String) -> usize {
        if let Some(at) = self.by_path.get(&path) {
            return *at;
        }
        let mut names = parts(&path).into_iter();
        let group = names.next().unwrap_or_default();
        self.objects.push(Object { group, channel: names.next(), ..Object::default() });
        self.place.push(None);
        self.by_path.insert(path, self.objects.len() - 1);
        self.objects.len() - 1
    }
}

fn named(object: &Object, what: &str) -> String {
    format!("\"{}\": {what}", object.name())
}

/// Reads the raw data index of an object. Returns whether the object has raw data in this segment.
fn index(cursor: &mut Cursor<'_>, object: &mut Object) -> Result<bool, String> {
    let header = cursor.u32()?;
    match header {
        NO_RAW_DATA => return Ok(false),
        AS_BEFORE if object.index.is_none() => {
            return Err(
                "its raw data index refers to an earlier segment that does not exist; copy the file again".into()
            );
        }
        AS_BEFORE => return Ok(true),
        _ => {}
    }
    let code = cursor.u32()?;
    let kind = Kind::of(code).ok_or_else(|| unknown_type(code))?;
    let _dimension = cursor.u32()?;
    let count = cursor.u64()?;
    let mut index = Index { kind, count, bytes: 0, scalers: Vec::new(), widths: Vec::new() };
    if matches!(header, DAQMX_SCALERS | DAQMX_DIGITAL_LINES) {
        let is_digital = header == DAQMX_DIGITAL_LINES;
        let scalers = cursor.u32()?;
        if scalers > MAX_SCALERS {
            return Err(format!("{scalers} DAQmx scalers are impossible; the file is damaged: copy it again"));
        }
        for _ in 0..scalers {
            let code = cursor.u32()?;
            let kind = Kind::of_scaler(code).ok_or_else(|| unknown_type(code))?;
            let (buffer, offset) = (cursor.u32()? as usize, cursor.u32()? as usize);
            // The sample format is not needed.
            cursor.take(if is_digital { 1 } else { 4 })?;
            index.scalers.push(Scaler { kind, buffer, offset, id: cursor.u32()?, is_digital });
        }
        let fits = kind == Kind::Scalers || matches!(index.scalers.as_slice(), [only] if only.kind == kind);
        let is_repeated =
            |(at, scaler): (usize, &Scaler)| index.scalers[..at].iter().any(|other| other.id == scaler.id);
        if !fits || index.scalers.iter().enumerate().any(is_repeated) {
            return Err("its DAQmx scalers contradict one another; the file is damaged: copy it again".into());
        }
        for _ in 0..cursor.u32()? {
            index.widths.push(cursor.u32()? as usize);
        }
    } else {
        let product = || kind.size().and_then(|size| count.checked_mul(size as u64));
        index.bytes = if kind == Kind::Text { cursor.u64()? } else { product().ok_or_else(|| impossible(count))? };
    }
    object.index = Some(index);
    Ok(true)
}

fn unknown_type(code: u32) -> String {
    format!("its type {code:#x} is not known; in LabVIEW, convert the channel to DBL")
}

fn impossible(count: u64) -> String {
    format!("{count} values are impossible; the file is damaged: copy it again")
}

/// Reads a property and its name.
fn property(cursor: &mut Cursor<'_>) -> Result<(String, Property), String> {
    let (name, code) = (cursor.text()?, cursor.u32()?);
    let value = match Kind::of(code) {
        Some(Kind::Text) => Property::Text(cursor.text()?),
        Some(Kind::Time) => Property::Time(cursor.moment()?),
        Some(Kind::Scalers) | None => {
            return Err(format!("the property \"{name}\" is of unknown type {code:#x}; remove it"));
        }
        Some(kind) => Property::Number(cursor.number(kind)?),
    };
    Ok((name, value))
}

/// Returns the names in a path such as `/'Group'/'Channel'`, where `''` means one quotation mark.
fn parts(path: &str) -> Vec<String> {
    let mut parts = Vec::new();
    let mut characters = path.chars().peekable();
    while let Some(character) = characters.next() {
        if character != '\'' {
            continue;
        }
        let mut part = String::new();
        while let Some(character) = characters.next() {
            if character == '\'' && characters.next_if_eq(&'\'').is_none() {
                break;
            }
            part.push(character);
        }
        parts.push(part);
    }
    parts
}
