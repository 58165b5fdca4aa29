//! The dialect of a table of text: delimiter, decimal sign, header, and the fields of a row.

use super::super::Head;
use super::super::numbers::{Cell, cell};
use super::fields::{Delimiter, fields};
use super::lines::{Line, line_at, lines, remark};
use super::remarks::{axis_of_remarks, start_and_increment, units_of_axes};
use crate::record::heading::Unit;

/// Largest number of titles in a header in addition to the fields of a row.
const MAX_FURTHER_TITLES: usize = 3;

/// Bytes at the end of a file that are searched for lines below the rows.
const FOOTER_BYTES: usize = 1 << 12;
/// First words of a row of statistics.
const STATISTICS: [&str; 11] =
    ["mean", "average", "avg", "min", "max", "std", "stdev", "rms", "sum", "total", "median"];

/// The dialect of a table, and the place of its rows.
#[derive(Clone, Debug)]
pub(super) struct Dialect {
    pub(super) delimiter: Delimiter,
    pub(super) decimal: u8,
    /// Number of fields of a row, including an empty one at the end.
    pub(super) fields: usize,
    /// Byte at which the first row begins.
    pub(super) start: usize,
    /// Byte at which the line with the names begins.
    pub(super) names: Option<usize>,
    /// Byte at which the line with the units begins.
    pub(super) units: Option<usize>,
    /// Fields that are columns of numbers.
    pub(super) columns: Vec<usize>,
    /// Columns with dates or times of day.
    pub(super) dates: Vec<usize>,
    /// Columns with times of day, with or without a date.
    pub(super) clocks: Vec<usize>,
    /// The lines with names and units. Concatenated files repeat them.
    pub(super) headings: Vec<String>,
}

impl Dialect {
    /// Returns the fields of a line above the rows, if it has as many fields as a row.
    pub(super) fn titles<'a>(&self, line: &'a str) -> Option<Vec<&'a str>> {
        let line = remark(line).unwrap_or(line);
        let mut titles = fields(line, self.delimiter);
        if self.delimiter == Delimiter::Blanks && titles.len() != self.fields {
            titles = line.split("  ").map(str::trim).filter(|title| !title.is_empty()).collect();
        }
        // Further titles, for example for remarks or the times of an oscilloscope, have no cells in the rows.
        let more = titles.len().saturating_sub(self.fields);
        if self.fields > 1 && more <= MAX_FURTHER_TITLES {
            titles.truncate(self.fields);
        }
        let named =
            self.columns.iter().filter(|field| titles.get(**field).is_some_and(|title| !title.is_empty())).count();
        (titles.len() == self.fields && 2 * named >= self.columns.len().max(1)).then_some(titles)
    }

    /// Returns the columns.
    pub(super) fn heads(&self, text: &str) -> Vec<Head> {
        let line = |at: Option<usize>| at.and_then(|at| self.titles(lines(text, at).next()?.1));
        let (names, units) = (line(self.names), line(self.units));
        let remarks = || lines(&text[..self.start], 0).map(|(_, line)| line);
        let whole = |at: Option<usize>| Some(fields(lines(text, at?).next()?.1, self.delimiter));
        let stated =
            whole(self.names).zip(whole(self.units)).and_then(|(names, units)| start_and_increment(&names, &units));
        let axis = stated.unwrap_or_else(|| axis_of_remarks(remarks()));
        let head = |field: &usize| {
            let name = names.as_ref().map(|names| names[*field]).filter(|name| !name.is_empty());
            let unit = units.as_ref().and_then(|units| unit_in(units[*field]));
            let name = name.map_or_else(|| (field + 1).to_string(), str::to_owned);
            // Times of day are converted to seconds.
            let unit = unit.or_else(|| self.clocks.contains(field).then_some("s"));
            Head { unit: unit.map(str::to_owned), axis, ..Head::new(name) }
        };
        let mut heads: Vec<Head> = self.columns.iter().map(head).collect();
        if self.units.is_none() {
            for (column, unit) in units_of_axes(remarks(), self.delimiter) {
                let Some(head) = heads.get_mut(column).filter(|head| head.unit.is_none()) else { continue };
                head.unit = Some(unit.to_owned());
            }
        }
        if self.names.is_none() {
            // Remarks may state one name each: `# NAME0 = Target position`.
            for (key, name) in remarks().filter_map(|line| remark(line)?.split_once('=')) {
                let number = key.trim().strip_prefix("NAME").and_then(|number| number.parse::<usize>().ok());
                if let Some(head) = number.and_then(|number| heads.get_mut(number)) {
                    name.trim().clone_into(&mut head.name);
                }
            }
        }
        heads
    }

    /// Returns the named fields with text in the first row, and this text.
    pub(super) fn texts(&self, text: &str) -> Vec<(String, String)> {
        let line = |at: usize| lines(text, at).next().map(|(_, line)| line);
        let names = self.names.and_then(line).and_then(|line| self.titles(line)).unwrap_or_default();
        let row = line(self.start).map(|line| fields(line, self.delimiter)).unwrap_or_default();
        let is_text = |field: &usize| {
            let filled = row.get(*field).is_some_and(|cell| !cell.is_empty());
            filled && !names[*field].is_empty() && !self.columns.contains(field)
        };
        (0..names.len()).filter(is_text).map(|field| (names[field].to_owned(), row[field].to_owned())).collect()
    }

    /// Returns whether a line between the rows repeats the header.
    pub(super) fn repeats_heading(&self, line: &str) -> bool {
        // Most lines begin with a digit, a sign or a blank and need no comparison.
        line.starts_with(|c: char| c.is_alphabetic() || c == '"') && self.headings.iter().any(|heading| heading == line)
    }

    /// Finds lines below the last row that are not rows, such as `Mean;…` or `END`. Returns their first byte and first
    /// line.
    pub(super) fn footer<'a>(&self, text: &'a str) -> Option<Line<'a>> {
        let from = text.len().saturating_sub(FOOTER_BYTES);
        // Skip the incomplete line at the beginning.
        let from = if from > self.start {
            from + text.as_bytes()[from..].iter().position(|b| *b == b'\n')? + 1
        } else {
            self.start
        };
        let last: Vec<Line<'a>> = lines(text, from).collect();
        let is_row =
            |line: &Line<'_>| remark(line.1).is_some() || self.repeats_heading(line.1) || !self.is_below_rows(line.1);
        let first = last.iter().rposition(is_row).map_or(0, |row| row + 1);
        // The first row is always a row.
        last.get(first).copied().filter(|line| line.0 > self.start)
    }

    /// Returns whether a line is text or statistics below the rows.
    fn is_below_rows(&self, line: &str) -> bool {
        let found = fields(line, self.delimiter);
        let what = |field: &usize| found.get(*field).map(|text| cell(text.as_bytes(), self.decimal));
        let begins = what(self.columns.first().unwrap_or(&0)).or_else(|| what(&0));
        let first = found.iter().find(|text| !text.is_empty()).copied().unwrap_or_default();
        if begins != Some(Cell::Other) || !first.starts_with(char::is_alphabetic) {
            return false;
        }
        // A row whose first number is damaged is still a row, which an error reports.
        let is_row = found.len() == self.fields && self.columns.iter().filter_map(what).any(|cell| is_number(&cell));
        !is_row || STATISTICS.iter().any(|word| first.to_lowercase().starts_with(word))
    }

    /// Returns the dialect for a text whose rows begin at byte `start`.
    pub(super) fn starting_at(&self, start: usize) -> Self {
        Self { start, ..self.clone() }
    }

    /// Returns the midnight before the first row, in seconds since 1970. Times with a date are counted from it.
    pub(super) fn midnight(&self, text: &str) -> i64 {
        let Some((_, row)) = lines(text, self.start).next() else { return 0 };
        let row = fields(row, self.delimiter);
        let first = self.dates.iter().find_map(|field| match cell(row.get(*field)?.as_bytes(), self.decimal) {
            Cell::Time(moment) => Some(moment.midnight()),
            _ => None,
        });
        first.unwrap_or(0)
    }

    /// Returns the field of a column.
    pub(super) fn field_of(&self, column: usize) -> usize {
        self.columns[column]
    }

    /// Returns the column of a field.
    pub(super) fn column_of(&self, field: usize) -> Option<usize> {
        self.columns.iter().position(|own| *own == field)
    }

    /// Returns the number of the line with the names.
    pub(super) fn header_line(&self, text: &str) -> Option<u64> {
        self.names.map(|at| line_at(text, at))
    }

    /// Returns whether the table is written like the record format: comma-separated, with only a header above the first
    /// row.
    pub(super) fn is_plain(&self, text: &str) -> bool {
        let mut above = text[..self.start].lines().filter(|line| !line.is_empty());
        let is_header = above.next().is_some_and(|line| remark(line).is_none());
        is_header && above.next().is_none() && self.names.is_some() && self.is_comma()
    }

    fn is_comma(&self) -> bool {
        let comma = self.delimiter == Delimiter::One(b',') && self.decimal == b'.';
        comma && self.names.is_some() && self.units.is_none() && self.columns.len() == self.fields
    }

    /// Returns a note on the dialect if it is not that of the record format.
    pub(super) fn note(&self) -> Option<String> {
        let plain = self.delimiter == Delimiter::One(b',') && self.decimal == b'.';
        (!plain).then(|| format!("read with {}", self.words()))
    }

    /// Returns the dialect in words.
    pub(super) fn words(&self) -> String {
        let between = match self.delimiter {
            Delimiter::Blanks => "blanks".to_owned(),
            Delimiter::One(b'\t') => "tabs".to_owned(),
            Delimiter::One(byte) => format!("'{}'", char::from(byte)),
        };
        let decimal = if self.decimal == b',' { " and a decimal comma" } else { "" };
        format!("{between} between columns{decimal}")
    }
}

pub(super) fn is_number(cell: &Cell) -> bool {
    matches!(cell, Cell::Number(_) | Cell::Grouped(_) | Cell::Time(_))
}

/// Returns the unit in a cell of a row of units, without brackets.
pub(super) fn unit_in(title: &str) -> Option<&str> {
    let inner = title.trim_matches(['(', ')', '[', ']', '{', '}', ' ']);
    Unit::parse(inner).map(|_| inner)
}
