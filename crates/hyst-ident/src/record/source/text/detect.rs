//! Detection of the dialect of a table of text.

use super::super::numbers::{Cell, cell};
use super::dialect::{Dialect, is_number, unit_in};
use super::fields::{Delimiter, fields};
use super::lines::{Line, lines, remark};
use crate::record::columns::Role;

/// Bytes at the beginning of a file from which the dialect is detected.
const SAMPLE_BYTES: usize = 1 << 18;
/// Smallest share of cells with a number or a missing value in a column of numbers.
const MIN_NUMERIC_SHARE: f64 = 0.5;

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
}

fn is_clock(cell: &Cell) -> bool {
    matches!(cell, Cell::Time(moment) if moment.timed)
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

fn is_dimensionless(title: &str) -> bool {
    let inner = title.trim_matches(['(', ')', '[', ']']);
    ["", "-", "1", "%", "n/a", "a.u.", "counts", "sequence"].contains(&inner.to_lowercase().as_str())
}
