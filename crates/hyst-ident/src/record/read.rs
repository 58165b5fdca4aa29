//! Reading records from CSV.

use std::path::Path;
use std::sync::Arc;

use csv::ByteRecord;

use super::ABSOLUTE_ZERO;
use super::columns::{ColumnMap, Layout, Need};
use super::error::{Place, RecordError};
use super::grid::Printed;
use super::log::is_log;
use super::{Columns, Origin, Record};

impl Record {
    /// Reads and checks the file at `path`.
    ///
    /// # Errors
    /// When the file cannot be read or breaks a rule of the record format; the message names file, line and column
    /// and what to do.
    pub fn read(path: impl AsRef<Path>, map: &ColumnMap, need: Need) -> Result<Self, RecordError> {
        let path = path.as_ref();
        let file = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|source| RecordError::Io { file: file.clone(), source })?;
        Self::parse(&file, &bytes, map, need)
    }

    /// Checks `bytes` as [`read`](Self::read) does a file's; `name` stands for the file in messages.
    ///
    /// # Errors
    /// When the bytes break a rule of the record format.
    pub fn parse(name: &str, bytes: &[u8], map: &ColumnMap, need: Need) -> Result<Self, RecordError> {
        if is_log(bytes) {
            return Self::parse_log(name, bytes, map, need);
        }
        let text = decode(name, bytes)?;
        let mut reader = rows_of(text);
        let mut fields = ByteRecord::new();
        let more = reader.read_byte_record(&mut fields).map_err(|error| failed(name, error))?;
        if !more {
            return Err(RecordError::Empty { file: name.to_owned() });
        }
        let names: Vec<String> = fields.iter().map(|field| lossy(field.trim_ascii())).collect();
        if let ([_], Some(found)) = (names.as_slice(), foreign_delimiter(&fields)) {
            return Err(RecordError::Delimiter { file: name.to_owned(), found });
        }
        let layout = Layout::resolve(name, &names, map, need)?;
        let (samples, printed) = Table { name, text, names: &names }.rows(&mut reader, &layout)?;

        let place = |row: usize| Place::Line(line_of_row(text, row));
        let column = |at: usize| names.get(at).map_or("", String::as_str);
        let origin = Origin {
            time_column: column(layout.time.0),
            segment_column: layout.segment.map_or("", column),
            place: &place,
        };
        let mut record = Self::assemble(samples, printed, &origin)?.kept_as(bytes);
        record.text = Some(Arc::from(text));
        Ok(record)
    }
}

/// A file while its rows are read.
struct Table<'a> {
    name: &'a str,
    text: &'a [u8],
    names: &'a [String],
}

impl Table<'_> {
    fn rows(&self, reader: &mut csv::Reader<&[u8]>, layout: &Layout) -> Result<(Columns, Printed), RecordError> {
        let (time_at, time_unit) = layout.time;
        // A row has two bytes or more per column.
        let room = self.text.len() / (8 * self.names.len());
        let column = || Vec::<f64>::with_capacity(room);
        let mut segment = layout.segment.map(|at| (at, Vec::<i64>::with_capacity(room)));
        let mut time = column();
        let mut input = layout.input.as_ref().map(|(at, _)| (*at, column()));
        let mut output = layout.output.map(|(at, _)| (at, column()));
        let mut temperature = layout.temperature.map(|at| (at, column()));
        let mut load = layout.load.map(|at| (at, column()));
        let mut printed = Printed::default();

        let mut fields = ByteRecord::new();
        while reader.read_byte_record(&mut fields).map_err(|error| failed(self.name, error))? {
            if fields.len() != self.names.len() {
                return Err(self.ragged(&fields));
            }
            if let Some((at, labels)) = &mut segment {
                labels.push(self.label(&fields, *at)?);
            }
            time.push(self.number(&fields, time_at)? / time_unit.per_second());
            printed.take(fields[time_at].trim_ascii());
            if let Some((at, _)) = &temperature
                && self.number(&fields, *at)? < ABSOLUTE_ZERO
            {
                return Err(RecordError::TooCold {
                    file: self.name.to_owned(),
                    place: self.place(&fields),
                    column: self.names[*at].clone(),
                    value: shortened(fields[*at].trim_ascii()),
                });
            }
            for (at, values) in [&mut input, &mut output, &mut temperature, &mut load].into_iter().flatten() {
                let value = self.number(&fields, *at)?;
                values.push(if layout.turned.contains(at) { -value } else { value });
            }
        }
        printed.decimals += time_unit.per_second().log10() as i32;

        let values = |column: Option<(usize, Vec<f64>)>| column.map(|(_, values)| values);
        let samples = Columns {
            name: self.name.to_owned(),
            segment: segment.map(|(_, labels)| labels),
            time,
            input_column: layout.input.as_ref().map_or_else(String::new, |(_, column)| column.clone()),
            input: values(input),
            output: layout.output.map(|(_, unit)| unit).zip(values(output)),
            temperature: values(temperature),
            load: values(load),
        };
        Ok((samples, printed))
    }

    fn number(&self, fields: &ByteRecord, at: usize) -> Result<f64, RecordError> {
        let text = fields[at].trim_ascii();
        let value = std::str::from_utf8(text).ok().and_then(|text| text.parse::<f64>().ok());
        let (file, column) = (|| self.name.to_owned(), || self.names[at].clone());
        match value {
            Some(value) if value.is_finite() => Ok(value),
            Some(_) => Err(RecordError::NotFinite {
                file: file(),
                place: self.place(fields),
                column: column(),
                value: shortened(text),
            }),
            None => Err(RecordError::NotANumber {
                file: file(),
                place: self.place(fields),
                column: column(),
                text: shortened(text),
            }),
        }
    }

    fn label(&self, fields: &ByteRecord, at: usize) -> Result<i64, RecordError> {
        let text = fields[at].trim_ascii();
        std::str::from_utf8(text).ok().and_then(|text| text.parse().ok()).ok_or_else(|| {
            RecordError::SegmentNotInteger {
                file: self.name.to_owned(),
                place: self.place(fields),
                column: self.names[at].clone(),
                text: shortened(text),
            }
        })
    }

    fn ragged(&self, fields: &ByteRecord) -> RecordError {
        let quoted = fields.iter().any(|field| field.contains(&b'\n'));
        RecordError::RaggedRow {
            file: self.name.to_owned(),
            line: line_at(self.text, start(self.text, fields)),
            found: fields.len(),
            expected: self.names.len(),
            column: self.names.last().cloned().unwrap_or_default(),
            hint: if quoted { "; a quotation mark may be left open there" } else { "" },
        }
    }

    fn place(&self, fields: &ByteRecord) -> Place {
        Place::Line(line_at(self.text, start(self.text, fields)))
    }
}

/// A reader of all rows, the header among them, that leaves their lengths to us.
pub(super) fn rows_of(text: &[u8]) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text)
}

/// The text without a byte-order mark, if it is UTF-8.
fn decode<'a>(name: &str, bytes: &'a [u8]) -> Result<&'a [u8], RecordError> {
    let refuse = |at: usize, problem| {
        let line_start = bytes[..at].iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        RecordError::Encoding { file: name.to_owned(), line: line_at(bytes, at), byte: at - line_start + 1, problem }
    };
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(refuse(0, "the file is UTF-16"));
    }
    match std::str::from_utf8(bytes) {
        Ok(_) => Ok(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
        Err(error) => Err(refuse(error.valid_up_to(), "this is not UTF-8")),
    }
}

fn foreign_delimiter(header: &ByteRecord) -> Option<&'static str> {
    let text = header.as_slice();
    if text.contains(&b';') {
        Some("';'")
    } else if text.contains(&b'\t') {
        Some("tabs")
    } else {
        None
    }
}

fn failed(name: &str, error: csv::Error) -> RecordError {
    RecordError::Io { file: name.to_owned(), source: error.into() }
}

/// Where a row starts. The reader's position is where it began to look, which may be before blank lines.
fn start(text: &[u8], fields: &ByteRecord) -> usize {
    let looked = fields.position().map_or(0, |position| position.byte() as usize).min(text.len());
    let blank = text[looked..].iter().take_while(|byte| matches!(byte, b'\n' | b'\r')).count();
    looked + blank
}

/// The number of the line that holds byte `at`; lines end in `\n`, `\r\n` or `\r`. Only errors ask for it.
fn line_at(text: &[u8], at: usize) -> u64 {
    let ends = |i: usize| match text[i] {
        b'\n' => true,
        b'\r' => text.get(i + 1) != Some(&b'\n'),
        _ => false,
    };
    1 + (0..at.min(text.len())).filter(|i| ends(*i)).count() as u64
}

/// The line of a row below the header, counted from 0.
fn line_of_row(text: &[u8], row: usize) -> u64 {
    let mut reader = rows_of(text);
    let mut fields = ByteRecord::new();
    for _ in 0..row + 2 {
        if !matches!(reader.read_byte_record(&mut fields), Ok(true)) {
            break;
        }
    }
    line_at(text, start(text, &fields))
}

fn lossy(field: &[u8]) -> String {
    String::from_utf8_lossy(field).into_owned()
}

/// A field as a message shows it: one line, not too long.
fn shortened(field: &[u8]) -> String {
    const MOST: usize = 40;
    let text: String = String::from_utf8_lossy(field).chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().count() <= MOST { text } else { text.chars().take(MOST).chain("…".chars()).collect() }
}
