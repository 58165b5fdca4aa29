//! Detection of the dialect of a table of text.

use super::super::numbers::{Cell, cell};
use super::super::{Axis, Head};
use super::{axis_of_remarks, fields};
use crate::record::columns::Role;
use crate::record::heading::Unit;

/// The separator of fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Delimiter {
    One(u8),
    /// Any number of blanks.
    Blanks,
}

/// Bytes at the beginning of a file from which the dialect is detected.
const SAMPLE_BYTES: usize = 1 << 18;
/// Smallest share of cells with a number or a missing value in a column of numbers.
const MIN_NUMERIC_SHARE: f64 = 0.5;

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
    names: Option<usize>,
    /// Byte at which the line with the units begins.
    units: Option<usize>,
    /// Fields that are columns of numbers.
    columns: Vec<usize>,
    /// Columns with dates or times of day.
    dates: Vec<usize>,
    /// Columns with times of day, with or without a date.
    clocks: Vec<usize>,
    /// The lines with names and units. Concatenated files repeat them.
    headings: Vec<String>,
}

/// A line, and the byte at which it begins.
type Line<'a> = (usize, &'a str);

/// Returns the lines that are not blank.
pub(super) fn lines(text: &str, start: usize) -> impl Iterator<Item = Line<'_>> {
    let mut at = start;
    text[start..].split_inclusive('\n').filter_map(move |whole| {
        let begins = at;
        at += whole.len();
        let line = whole.trim_end_matches(['\n', '\r']);
        (!line.trim().is_empty()).then_some((begins, line))
    })
}

/// Returns a remark without its leading sign; `None` if the line is not a remark.
pub(super) fn remark(line: &str) -> Option<&str> {
    let line = line.trim_start();
    ["#", "%", "//", "!"]
        .iter()
        .find_map(|sign| line.strip_prefix(sign))
        .map(|rest| rest.trim_start_matches(['#', '%']))
}

impl Dialect {
    /// Finds the dialect with the most numbers in the first rows; `None` if there is no row of numbers.
    pub(super) fn find(text: &str) -> Option<Self> {
        let mut end = text.len();
        if end > SAMPLE_BYTES {
            // Complete lines only. A line feed is never part of another UTF-8 character.
            end = text.as_bytes()[..SAMPLE_BYTES].iter().rposition(|byte| *byte == b'\n')? + 1;
        }
        let sample: Vec<Line<'_>> = lines(&text[..end], 0).collect();
        if let Some(own) = Self::of_records(&sample) {
            return Some(own);
        }
        let delimiters = [b'\t', b';', b',', b'|'].map(Delimiter::One).into_iter().chain([Delimiter::Blanks]);
        let mut best: Option<(i64, Self)> = None;
        for (delimiter, decimal) in delimiters.flat_map(|delimiter| [(delimiter, b'.'), (delimiter, b',')]) {
            let Some((score, dialect)) = Self::scored(&sample, delimiter, decimal) else { continue };
            if best.as_ref().is_none_or(|(most, _)| score > *most) {
                best = Some((score, dialect));
            }
        }
        best.map(|(_, dialect)| dialect)
    }

    /// Returns the dialect of a file whose first line has names of the record format and whose second line has numbers.
    fn of_records(sample: &[Line<'_>]) -> Option<Self> {
        let [(at, header), (first, row), ..] = *sample else { return None };
        let header = remark(header).unwrap_or(header);
        let is_header = |delimiter: &Delimiter| {
            let names = fields(header, *delimiter);
            names.len() > 1 && names.iter().any(|name| Role::of_column(name).is_some())
        };
        let delimiter =
            [b',', b';', b'\t'].map(Delimiter::One).into_iter().chain([Delimiter::Blanks]).find(is_header)?;
        let decimal_comma = delimiter != Delimiter::One(b',') && row.contains(',');
        let cells: Vec<Cell> = fields(row, delimiter).iter().map(|field| cell(field.as_bytes(), b'.')).collect();
        if decimal_comma || !cells.iter().any(is_number) {
            return None;
        }
        let names = fields(header, delimiter);
        let trailing = usize::from(names.last().is_some_and(|name| name.is_empty()));
        let columns = (0..names.len() - trailing).collect();
        let dates = (0..cells.len()).filter(|field| matches!(cells[*field], Cell::Time(_))).collect();
        let clocks = (0..cells.len()).filter(|field| is_clock(&cells[*field])).collect();
        Some(Self {
            delimiter,
            decimal: b'.',
            fields: names.len(),
            start: first,
            names: Some(at),
            units: None,
            columns,
            dates,
            clocks,
            headings: vec![sample[0].1.to_owned()],
        })
    }

    /// Returns the number of cells with a number minus that of other cells, and the dialect.
    fn scored(sample: &[Line<'_>], delimiter: Delimiter, decimal: u8) -> Option<(i64, Self)> {
        let quoted = || sample.iter().any(|(_, line)| line.contains('"'));
        if delimiter == Delimiter::One(b',') && decimal == b',' && !quoted() {
            return None;
        }
        let cells_of = |line: &str| fields(line, delimiter).iter().map(|f| cell(f.as_bytes(), decimal)).collect();
        let cells: Vec<Vec<Cell>> = sample.iter().map(|(_, line)| cells_of(line)).collect();
        let numbers_in = |row: &[Cell]| row.iter().filter(|cell| is_number(cell)).count();
        // The most frequent number of fields, weighted by the number of fields because remarks are short.
        let mut counts: Vec<(usize, usize)> = Vec::new();
        for row in cells.iter().filter(|row| numbers_in(row) > 0) {
            match counts.iter_mut().find(|(fields, _)| *fields == row.len()) {
                Some((_, rows)) => *rows += 1,
                None => counts.push((row.len(), 1)),
            }
        }
        let (count, _) = counts.into_iter().max_by_key(|(fields, rows)| (rows * fields, *fields))?;
        let like_row = |k: usize| {
            let row = &cells[k];
            let filled = row.iter().filter(|cell| **cell != Cell::Missing).count();
            row.len() == count && numbers_in(row) > 0 && 2 * numbers_in(row) >= filled
        };
        let alike: Vec<usize> = (0..cells.len()).filter(|k| like_row(*k)).collect();
        // Fields that have a number in most rows must have one in the first row too. Remarks begin with a word.
        let numbers = |field: &usize| alike.iter().filter(|k| is_number(&cells[**k][*field])).count();
        let usual: Vec<usize> = (0..count).filter(|field| 2 * numbers(field) >= alike.len()).collect();
        let is_row = |k: usize| like_row(k) && usual.iter().all(|field| cells[k][*field] != Cell::Other);
        // One line of remarks may look like a row. Two such lines in sequence are rows.
        let begins = |k: &usize| is_row(*k) && (alike.len() < 3 || *k + 1 == cells.len() || is_row(*k + 1));
        let first = (0..cells.len()).find(begins)?;
        let rows: Vec<&Vec<Cell>> = cells[first..].iter().filter(|row| row.len() == count).collect();
        let share = |field: usize, counts: fn(&Cell) -> bool| {
            rows.iter().filter(|row| counts(&row[field])).count() as f64 / rows.len() as f64
        };
        let numeric = |field: &usize| {
            share(*field, |cell| *cell != Cell::Other) >= MIN_NUMERIC_SHARE && share(*field, is_number) > 0.0
        };
        let columns: Vec<usize> = (0..count).filter(numeric).collect();
        // Grouped thousands count less, so that a decimal sign that explains the cells without groups is preferred.
        let grouped = |row: &[Cell]| row.iter().filter(|cell| matches!(cell, Cell::Grouped(_))).count();
        let surplus = |row: &Vec<Cell>| 2 * numbers_in(row) as i64 - count as i64 - grouped(row) as i64;
        if delimiter != Delimiter::One(b',') && hides_thousands(&sample[first..], delimiter, decimal, &columns) {
            return None;
        }
        let score = rows.into_iter().map(surplus).sum();
        let start = sample[first].0;
        let is_date = |field: &usize| matches!(cells[first][*field], Cell::Time(_));
        let dates = columns.iter().copied().filter(is_date).collect();
        let clocks = columns.iter().copied().filter(|field| is_clock(&cells[first][*field])).collect();
        let mut dialect = Self {
            delimiter,
            decimal,
            fields: count,
            start,
            names: None,
            units: None,
            columns,
            dates,
            clocks,
            headings: Vec::new(),
        };
        dialect.find_names(&sample[..first]);
        let is_heading = |line: &&Line<'_>| Some(line.0) == dialect.names || Some(line.0) == dialect.units;
        dialect.headings = sample[..first].iter().filter(is_heading).map(|line| line.1.to_owned()).collect();
        Some((score, dialect))
    }

    /// Returns the fields of a line above the rows, if it has as many fields as a row.
    fn titles<'a>(&self, line: &'a str) -> Option<Vec<&'a str>> {
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

    /// Finds the lines with names and units above the first row.
    fn find_names(&mut self, above: &[Line<'_>]) {
        let mut titled = above.iter().rev().take(6).filter(|line| self.titles(line.1).is_some());
        let (last, before) = (titled.next().copied(), titled.next().copied());
        drop(titled);
        let Some(last) = last else { return };
        let units = self.titles(last.1).is_some_and(|titles| {
            let known = titles.iter().filter(|title| unit_in(title).is_some()).count();
            let none = titles.iter().filter(|title| is_dimensionless(title)).count();
            // One unknown unit such as "counts/s" is allowed if at least two units are known.
            known > 0 && known + none + usize::from(known > 1) >= titles.len()
        });
        match before.filter(|_| units) {
            Some(before) => (self.names, self.units) = (Some(before.0), Some(last.0)),
            None => self.names = Some(last.0),
        }
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
        self.names.map(|at| super::rows::line_at(text, at))
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

fn is_clock(cell: &Cell) -> bool {
    matches!(cell, Cell::Time(moment) if moment.timed)
}

fn is_number(cell: &Cell) -> bool {
    matches!(cell, Cell::Number(_) | Cell::Grouped(_) | Cell::Time(_))
}

/// Returns whether the decimal sign is a thousands separator (`998`, `999`, `1.000`).
///
/// This is the case if a column has numbers of three digits without the sign, and all numbers with it have exactly
/// three digits after it, at least one of them with a trailing zero.
fn hides_thousands(rows: &[Line<'_>], delimiter: Delimiter, decimal: u8, columns: &[usize]) -> bool {
    let sign = char::from(decimal);
    let rows: Vec<Vec<&str>> = rows.iter().map(|(_, line)| fields(line, delimiter)).collect();
    columns.iter().any(|field| {
        let cells = || rows.iter().filter_map(|row| row.get(*field)).map(|cell| cell.trim_start_matches(['-', '+']));
        let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        let mut signed = cells().filter_map(|cell| cell.split_once(sign)).peekable();
        signed.peek().is_some()
            && cells().any(|cell| cell.len() == 3 && digits(cell))
            && cells().filter_map(|cell| cell.split_once(sign)).any(|(_, behind)| behind.ends_with('0'))
            && signed.all(|(before, behind)| {
                behind.len() == 3 && digits(behind) && before.len() <= 3 && !before.starts_with('0')
            })
    })
}

/// Returns the unit in a cell of a row of units, without brackets.
fn unit_in(title: &str) -> Option<&str> {
    let inner = title.trim_matches(['(', ')', '[', ']', '{', '}', ' ']);
    Unit::parse(inner).map(|_| inner)
}

fn is_dimensionless(title: &str) -> bool {
    let inner = title.trim_matches(['(', ')', '[', ']']);
    ["", "-", "1", "%", "n/a", "a.u.", "counts", "sequence"].contains(&inner.to_lowercase().as_str())
}

/// Returns the units that an oscilloscope states above its table, by column: `Horizontal Units,s`, `Vertical
/// Units,V,um`.
fn units_of_axes<'a>(remarks: impl Iterator<Item = &'a str>, delimiter: Delimiter) -> Vec<(usize, &'a str)> {
    let of = |line: &'a str| {
        let parts = fields(line, delimiter);
        let first = match parts.first()?.to_lowercase().as_str() {
            "horizontal units" | "x units" | "x_unit" => 0,
            "vertical units" | "y units" | "y_unit" => 1,
            _ => return None,
        };
        Some((first..).zip(parts.into_iter().skip(1).filter(|unit| Unit::parse(unit).is_some())))
    };
    remarks.filter_map(of).flatten().collect()
}

/// Returns the times from the columns `Start` and `Increment` of an oscilloscope, whose values are in the row of units.
fn start_and_increment(names: &[&str], units: &[&str]) -> Option<Axis> {
    let value = |name: &str| {
        let at = names.iter().position(|own| own.eq_ignore_ascii_case(name))?;
        units.get(at)?.parse::<f64>().ok().filter(|value| value.is_finite())
    };
    let step = value("increment").filter(|step| *step > 0.0)?;
    Some(Axis::Even { start: value("start").unwrap_or(0.0), step })
}
