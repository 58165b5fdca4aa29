//! Parallel reading of the rows of a table of text.

use std::ops::Range;

use memchr::memchr;
use rayon::prelude::*;

use super::super::Values;
use super::super::numbers::{Cell, cell, scan, take_digits};
use super::dialect::Dialect;
use super::fields::{Delimiter, fields};
use super::lines::{line_at, lines, remark, shortened};
use crate::record::error::{Place, RecordError};
use crate::record::grid::Printed;

/// Bytes per parallel task.
const PIECE_BYTES: usize = 1 << 20;

/// A fault in a row.
#[derive(Debug)]
pub(super) struct Fault {
    /// Byte at which the line begins.
    at: usize,
    /// Number of lines of the file before the text.
    before: u64,
    kind: FaultKind,
}

#[derive(Debug)]
enum FaultKind {
    /// A wrong number of fields.
    Fields { found: usize, expected: usize, open_quote: bool },
    /// A cell that is not a number.
    Cell { field: usize, text: String },
}

impl Fault {
    /// Returns the fault for a text that begins at `line` of its file.
    pub(super) fn after(self, line: u64) -> Self {
        Self { before: line - 1, ..self }
    }

    /// Returns the error. `column` returns the column name of a field.
    pub(super) fn error(self, file: &str, text: &str, column: impl Fn(usize) -> String) -> RecordError {
        let (file, line) = (file.to_owned(), self.before + line_at(text, self.at));
        match self.kind {
            FaultKind::Fields { found, expected, open_quote } => RecordError::RaggedRow {
                file,
                line,
                found,
                expected,
                column: column(expected - 1),
                hint: if open_quote { "; a closing quotation mark may be missing in this line" } else { "" },
            },
            FaultKind::Cell { field, text } => {
                RecordError::NotANumber { file, place: Place::Line(line), column: column(field), text }
            }
        }
    }
}

/// The rows of a text.
#[derive(Debug, Default)]
pub(super) struct Read {
    /// The requested fields.
    pub(super) columns: Vec<Values>,
    /// Number of lines that repeat the header.
    pub(super) headings: usize,
    /// Number of lines with remarks or blanks.
    pub(super) others: usize,
}

/// Reads the fields `wanted` of all rows.
pub(super) fn read(text: &str, dialect: &Dialect, wanted: &[usize]) -> Result<Read, Fault> {
    read_from(text, dialect, dialect.midnight(text), wanted)
}

/// Reads as [`read`] does, with dates counted from `midnight` \[s\].
pub(super) fn read_from(text: &str, dialect: &Dialect, midnight: i64, wanted: &[usize]) -> Result<Read, Fault> {
    let read = |piece| piece_of(text, piece, dialect, midnight, wanted);
    // The first fault in the text is reported, in whatever order the threads find faults.
    let pieces: Vec<Result<Read, Fault>> = pieces(text, dialect.start).into_par_iter().map(read).collect();
    let pieces: Vec<Read> = pieces.into_iter().collect::<Result<_, _>>()?;
    let rows: usize = pieces.iter().map(|piece| piece.columns.first().map_or(0, |column| column.numbers.len())).sum();
    let mut all = Read { columns: wanted.iter().map(|_| with_capacity(rows)).collect(), headings: 0, others: 0 };
    for piece in pieces {
        all.headings += piece.headings;
        all.others += piece.others;
        for (column, part) in all.columns.iter_mut().zip(piece.columns) {
            column.numbers.extend(part.numbers);
            column.printed.join(part.printed);
        }
    }
    Ok(all)
}

fn with_capacity(rows: usize) -> Values {
    Values { numbers: Vec::with_capacity(rows), printed: Printed::default() }
}

/// Splits a text into pieces of complete lines.
fn pieces(text: &str, start: usize) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let mut pieces = Vec::new();
    let mut from = start;
    while from < bytes.len() {
        let until = (from + PIECE_BYTES).min(bytes.len());
        let end = memchr(b'\n', &bytes[until..]).map_or(bytes.len(), |more| until + more + 1);
        pieces.push(from..end);
        from = end;
    }
    pieces
}

fn piece_of(
    text: &str,
    piece: Range<usize>,
    dialect: &Dialect,
    midnight: i64,
    wanted: &[usize],
) -> Result<Read, Fault> {
    let capacity = piece.len() / (4 * dialect.fields);
    let mut columns: Vec<Values> = wanted.iter().map(|_| with_capacity(capacity)).collect();
    // For each field the columns that receive its value.
    let mut goals: Vec<Vec<usize>> = vec![Vec::new(); dialect.fields];
    for (column, field) in wanted.iter().enumerate() {
        goals[*field].push(column);
    }
    let mut rows = Rows { dialect, midnight, goals: &goals, columns: &mut columns, headings: 0, others: 0 };
    let mut at = piece.start;
    while at < piece.end {
        let end = memchr(b'\n', &text.as_bytes()[at..piece.end]).map_or(piece.end, |length| at + length);
        rows.take(at, text[at..end].trim_end_matches('\r'))?;
        at = end + 1;
    }
    let Rows { headings, others, .. } = rows;
    Ok(Read { columns, headings, others })
}

/// The values of the rows that were read.
struct Rows<'a> {
    dialect: &'a Dialect,
    /// The time from which dates are counted \[s\].
    midnight: i64,
    /// For each field the columns that receive its value.
    goals: &'a [Vec<usize>],
    columns: &'a mut [Values],
    /// Number of lines that repeat the header.
    headings: usize,
    /// Number of lines with remarks or blanks.
    others: usize,
}

impl Rows<'_> {
    fn take(&mut self, at: usize, line: &str) -> Result<(), Fault> {
        // Fast path: most lines consist of numbers only.
        if let (Some(b'0'..=b'9' | b'-' | b'+' | b'.'), Delimiter::One(delimiter)) =
            (line.as_bytes().first(), self.dialect.delimiter)
            && self.take_numbers(line.as_bytes(), delimiter)
        {
            return Ok(());
        }
        if line.trim().is_empty() {
            self.others += usize::from(!line.is_empty());
            return Ok(());
        }
        if remark(line).is_some() {
            self.others += 1;
            return Ok(());
        }
        if self.dialect.repeats_heading(line) {
            self.headings += 1;
            return Ok(());
        }
        match self.dialect.delimiter {
            Delimiter::Blanks => self.take_fields(at, line.split_whitespace(), false),
            Delimiter::One(_) if line.contains('"') => {
                let open_quote = line.bytes().filter(|byte| *byte == b'"').count() % 2 == 1;
                self.take_fields(at, fields(line, self.dialect.delimiter).into_iter(), open_quote)
            }
            Delimiter::One(delimiter) => self.take_fields(at, line.split(char::from(delimiter)), false),
        }
    }

    /// Reads a line that consists of the numbers of a row without blanks. Returns false for any other line.
    fn take_numbers(&mut self, line: &[u8], delimiter: u8) -> bool {
        let mut at = 0;
        for (field, goals) in self.goals.iter().enumerate() {
            let Some(scanned) = scan(&line[at..], self.dialect.decimal).filter(|scanned| scanned.value.is_finite())
            else {
                return self.undo(field);
            };
            at += scanned.bytes;
            let is_last = field + 1 == self.goals.len();
            match line.get(at) {
                Some(byte) if *byte == delimiter && !is_last => at += 1,
                None if is_last => {}
                _ => return self.undo(field),
            }
            for goal in goals {
                let column = &mut self.columns[*goal];
                column.numbers.push(scanned.value);
                // Only the digits of times are needed, and the time is the first column.
                if *goal == 0 {
                    column.printed.join(scanned.printed);
                }
            }
        }
        true
    }

    /// Removes the numbers of a line up to `field`. Returns false.
    fn undo(&mut self, field: usize) -> bool {
        for goal in self.goals[..field].iter().flatten() {
            self.columns[*goal].numbers.pop();
        }
        false
    }

    fn take_fields<'t>(
        &mut self,
        at: usize,
        fields: impl Iterator<Item = &'t str>,
        open_quote: bool,
    ) -> Result<(), Fault> {
        let (mut found, mut ends_empty) = (0, false);
        for field in fields {
            let text = field.as_bytes().trim_ascii();
            if let Some(goals) = self.goals.get(found).filter(|goals| !goals.is_empty()) {
                let cell = cell(text, self.dialect.decimal);
                let is_moment = matches!(cell, Cell::Time(_));
                let value = match cell {
                    Cell::Number(value) | Cell::Grouped(value) => value,
                    Cell::Time(moment) => {
                        // The seconds of a day have five digits before the decimal point.
                        let printed = Printed { decimals: moment.decimals, digits: 5 + moment.decimals };
                        goals.iter().for_each(|goal| self.columns[*goal].printed.join(printed));
                        moment.since(self.midnight)
                    }
                    Cell::Missing => f64::NAN,
                    Cell::Other if open_quote => break,
                    Cell::Other => {
                        return Err(Fault {
                            at,
                            before: 0,
                            kind: FaultKind::Cell { field: found, text: shortened(field) },
                        });
                    }
                };
                for goal in goals {
                    let column = &mut self.columns[*goal];
                    column.numbers.push(value);
                    // Only the digits of times are needed, and the time is the first column.
                    if *goal == 0 && !is_moment {
                        take_digits(&mut column.printed, text, self.dialect.decimal);
                    }
                }
            }
            ends_empty = text.is_empty();
            found += 1;
        }
        let expected = self.dialect.fields;
        let one_more = found == expected + 1 && ends_empty;
        if !open_quote && (found == expected || one_more) {
            return Ok(());
        }
        Err(Fault { at, before: 0, kind: FaultKind::Fields { found, expected, open_quote } })
    }
}

/// Returns the line number of a row, which is counted from 0.
pub(super) fn line_of_row(text: &str, dialect: &Dialect, row: usize) -> u64 {
    let is_row = |line: &str| remark(line).is_none() && !dialect.repeats_heading(line);
    let mut rows = lines(text, dialect.start).filter(|(_, line)| is_row(line));
    line_at(text, rows.nth(row).map_or(text.len(), |(at, _)| at))
}
