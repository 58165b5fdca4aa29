//! NPZ: a ZIP archive with an NPY file for each array.

use std::collections::{HashMap, HashSet};
use std::io::{Cursor, Read};

use super::array::{Array, Shape, TAG};
use super::{add, numbered};
use crate::record::source::{Axis, Table};
use zip::ZipArchive;

/// Size up to which an archive may always unpack \[bytes\].
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// Largest ratio of unpacked to packed size of larger archives.
const MAX_EXPANSION: u64 = 200;
const EXTENSION: &str = ".npy";
/// Names of scalars with a sample rate \[Hz\] or a sample period \[s\].
const RATES: [&str; 8] = ["fs", "Fs", "FS", "fs_hz", "sample_rate", "SampleRate", "sample_rate_hz", "sampling_rate"];
const PERIODS: [&str; 6] = ["dt", "Ts", "dt_s", "sample_period", "SamplePeriod", "sample_period_s"];
/// Names of text arrays with the column names of a table.
const TITLES: [&str; 8] = ["columns", "names", "labels", "channels", "header", "headers", "fields", "column_names"];
/// Part of the name of text arrays with units, in lower case.
const UNITS: &str = "unit";

/// Returns whether `bytes` are an archive of arrays.
///
/// The first name is checked first, so that a truncated archive is recognised too.
pub(crate) fn is(bytes: &[u8]) -> bool {
    if !bytes.starts_with(b"PK\x03\x04") {
        return false;
    }
    let length = bytes.get(26..28).map_or(0, |length| usize::from(u16::from_le_bytes([length[0], length[1]])));
    if bytes.get(30..).and_then(|rest| rest.get(..length)).is_some_and(|name| name.ends_with(EXTENSION.as_bytes())) {
        return true;
    }
    let archive = ZipArchive::new(Cursor::new(bytes));
    archive.is_ok_and(|archive| archive.file_names_raw().any(|name| name.ends_with(EXTENSION.as_bytes())))
}

/// The bytes of an array.
struct Member {
    name: String,
    bytes: Vec<u8>,
}

/// Reads all arrays.
pub(crate) fn read(bytes: &[u8]) -> Result<Table, String> {
    let mut table = Table::new("NumPy .npz");
    let members = unpack(bytes)?;
    let mut arrays: Vec<(&str, Array<'_>)> = Vec::new();
    for member in &members {
        match Array::parse(&member.bytes) {
            Ok(array) => arrays.push((&member.name, array)),
            Err(what) if what.contains("pickled") => {
                table.notes.push(format!("\"{}\" is not read: {what}", member.name));
            }
            Err(what) => return Err(format!("\"{}\": {what}", member.name)),
        }
    }
    let stated = Stated::find(&arrays);
    let mut steps = Vec::new();
    for (name, array) in &arrays {
        let of_field = |field: &str| if field.is_empty() { (*name).to_owned() } else { format!("{name}.{field}") };
        let titles = stated.titles(array.columns());
        let titled = |field: &str, column: usize| match &titles {
            // If the column name has a path separator, the name of the table is omitted.
            Some(titles) if field.is_empty() && titles[column].contains(['/', '!']) => titles[column].clone(),
            Some(titles) if field.is_empty() => format!("{name}/{}", titles[column]),
            _ => numbered(&of_field(field), array, column),
        };
        let unit = |column: usize| stated.unit(name, array.columns(), column);
        add(&mut table, name, array, titled, unit);
        steps.resize(table.heads.len(), stated.steps.get(folder(name)).copied());
    }
    // A rate applies to the longest columns. Shorter columns have another rate or are not signals.
    let longest = table.values.iter().map(Vec::len).max().unwrap_or(0);
    for ((head, values), step) in table.heads.iter_mut().zip(&table.values).zip(steps) {
        if let Some(step) = step.filter(|_| values.len() == longest) {
            head.axis = Axis::Even { start: 0.0, step };
        }
    }
    Ok(table)
}

/// Unpacks the arrays of an archive, with a limit on their total size.
fn unpack(bytes: &[u8]) -> Result<Vec<Member>, String> {
    const AGAIN: &str = "the file may be cut off: copy it again";
    let mut archive = ZipArchive::new(Cursor::new(bytes))
        .map_err(|error| format!("the archive cannot be read ({error}); {AGAIN}"))?;
    let mut allowed = ALWAYS_UNPACKED.max(MAX_EXPANSION.saturating_mul(bytes.len() as u64));
    let mut members = Vec::new();
    for at in 0..archive.len() {
        let name = archive
            .name_for_index(at)
            .and_then(Result::ok)
            .map_or_else(|| format!("number {}", at + 1), |name| name.into_owned());
        let Some(array) = name.strip_suffix(EXTENSION) else { continue };
        let entry =
            archive.by_index(at).map_err(|error| format!("\"{array}\" cannot be unpacked ({error}); {AGAIN}"))?;
        let mut unpacked = Vec::new();
        let read = entry.take(allowed.saturating_add(1)).read_to_end(&mut unpacked);
        read.map_err(|error| format!("\"{array}\" cannot be unpacked ({error}); {AGAIN}"))?;
        let Some(rest) = allowed.checked_sub(unpacked.len() as u64) else {
            return Err(format!(
                "\"{array}\" expands to more than {MAX_EXPANSION} times the size of the file; save only the arrays of the record"
            ));
        };
        allowed = rest;
        if !unpacked.starts_with(TAG) {
            return Err(format!("\"{array}\" is not a NumPy array; save the archive with numpy.savez"));
        }
        members.push(Member { name: array.to_owned(), bytes: unpacked });
    }
    Ok(members)
}

/// Names, units and sample periods that text arrays and scalars state for other arrays.
struct Stated {
    /// Text arrays: one text, or one text per column of a table.
    texts: Vec<(String, Vec<String>)>,
    /// Sample periods \[s\] by the folder of the scalar.
    steps: HashMap<String, f64>,
    /// Units by the name of the array.
    units: HashMap<String, String>,
}

impl Stated {
    fn find(arrays: &[(&str, Array<'_>)]) -> Self {
        let mut stated = Self { texts: Vec::new(), steps: HashMap::new(), units: HashMap::new() };
        for (name, array) in arrays {
            let [field] = array.fields.as_slice() else { continue };
            if array.columns() != 1 {
                continue;
            }
            if let Some(texts) = array.texts(field) {
                if let ([unit], Some(of)) = (texts.as_slice(), unit_of(name)) {
                    stated.units.insert(of.to_owned(), unit.clone());
                }
                stated.texts.push(((*name).to_owned(), texts));
            } else if array.shape == Shape::Scalar
                && let Some(&[number]) = array.numbers(field, 0).as_deref()
                && let Some(step) = step(leaf(name), number)
            {
                stated.steps.entry(folder(name).to_owned()).or_insert(step);
            }
        }
        stated
    }

    /// Returns the column names of a table: a text array with one text per column and a name from [`TITLES`], or else
    /// the only such array.
    fn titles(&self, columns: usize) -> Option<Vec<String>> {
        let is_whole = |texts: &[String]| texts.len() == columns && texts.iter().all(|text| !text.is_empty());
        let is_title = |(name, texts): &&(String, Vec<String>)| {
            let are_different = || texts.iter().collect::<HashSet<_>>().len() == columns;
            columns > 1 && is_whole(texts) && !name.to_lowercase().contains(UNITS) && are_different()
        };
        let mut found = self.texts.iter().filter(is_title);
        let named = found.clone().find(|(name, _)| TITLES.contains(&leaf(name).to_lowercase().as_str()));
        let only = found.next().filter(|_| found.next().is_none());
        named.or(only).map(|(_, texts)| texts.clone())
    }

    fn unit(&self, name: &str, columns: usize, column: usize) -> Option<String> {
        let is_unit = |(own, texts): &&(String, Vec<String>)| {
            columns > 1 && texts.len() == columns && own.to_lowercase().contains(UNITS)
        };
        let unit =
            self.units.get(name).or_else(|| self.texts.iter().find(is_unit).and_then(|(_, texts)| texts.get(column)));
        unit.filter(|unit| !unit.is_empty()).cloned()
    }
}

/// Returns the array whose unit `name` states: `voltage` for `voltage_unit`.
fn unit_of(name: &str) -> Option<&str> {
    [".unit", ".units", "_unit", "_units", "/unit", "/units"].iter().find_map(|end| name.strip_suffix(end))
}

/// Returns the sample period \[s\] that a scalar states.
fn step(name: &str, number: f64) -> Option<f64> {
    let step = if RATES.contains(&name) {
        1.0 / number
    } else if PERIODS.contains(&name) {
        number
    } else {
        return None;
    };
    Some(step).filter(|step| step.is_finite() && *step > 0.0)
}

fn folder(name: &str) -> &str {
    name.rfind('/').map_or("", |at| &name[..at])
}

fn leaf(name: &str) -> &str {
    name.rfind('/').map_or(name, |at| &name[at + 1..])
}
