//! The cells of a sheet, read one by one.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use calamine::{DataRef, Xlsx, XlsxError};

use super::fault::Fault;
use crate::record::source::numbers::{Cell, cell};

/// Largest number of non-empty rows that are searched for the beginning of the table.
const TOP_ROWS: usize = 1000;
/// Largest number of cells in these rows.
const TOP_CELLS: usize = 1_000_000;
/// Longest title \[bytes\].
const MAX_TITLE: usize = 200;
/// Largest number of rows of a sheet.
const MAX_ROWS: u32 = 1 << 20;
/// Largest number of columns of a sheet.
const MAX_COLUMNS: u32 = 1 << 14;
/// Date of 1970-01-01 in Excel \[days since 1900\].
const DAYS_TO_1970: f64 = 25_569.0;
const SECONDS_PER_DAY: f64 = 86_400.0;

/// The content of a cell.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Item {
    Number(f64),
    /// A date and time \[days\].
    Date(f64),
    Text(String),
    /// An error such as `#N/A`.
    Missing,
}

impl Item {
    pub(super) fn is_number(&self) -> bool {
        matches!(self, Self::Number(_) | Self::Date(_))
    }
}

/// A row and the number in it.
pub(super) type Value = (u32, f64);

/// The cells of a column.
#[derive(Debug, Default)]
pub(super) struct Cells {
    pub(super) numbers: Vec<Value>,
    pub(super) dates: Vec<Value>,
    /// Number of cells with text.
    pub(super) texts: usize,
}

/// The cells of a sheet.
#[derive(Debug, Default)]
pub(super) struct Sheet {
    /// All cells of the first rows, by row and column.
    pub(super) top: BTreeMap<u32, BTreeMap<u32, Item>>,
    /// All columns, by number.
    pub(super) columns: BTreeMap<u32, Cells>,
}

impl Sheet {
    /// Reads a sheet. `free` is the number of further cells that may be read.
    pub(super) fn read<R: Read + Seek>(workbook: &mut Xlsx<R>, name: &str, free: &mut usize) -> Result<Self, Fault> {
        let unreadable = |error: XlsxError| Fault::damaged(format!("the cells cannot be read ({error})"));
        let mut sheet = Self::default();
        let mut top_cells = 0;
        let mut cells = workbook.worksheet_cells_reader(name).map_err(unreadable)?;
        while let Some(cell) = cells.next_cell().map_err(unreadable)? {
            *free = free.checked_sub(1).ok_or_else(Fault::too_large)?;
            let (row, column) = cell.get_position();
            if row >= MAX_ROWS || column >= MAX_COLUMNS {
                return Err(Fault::damaged("it has a cell outside the sheet"));
            }
            let Some(item) = item(cell.get_value()) else { continue };
            let cells = sheet.columns.entry(column).or_default();
            match &item {
                Item::Number(number) => cells.numbers.push((row, *number)),
                Item::Date(days) => cells.dates.push((row, *days)),
                Item::Text(_) => cells.texts += 1,
                Item::Missing => {}
            }
            let rows = sheet.top.len();
            if top_cells < TOP_CELLS && (rows < TOP_ROWS || sheet.top.contains_key(&row)) {
                top_cells += 1;
                sheet.top.entry(row).or_default().insert(column, item);
            }
        }
        Ok(sheet)
    }
}

/// Returns the content of a cell; `None` if it is empty.
fn item(value: &DataRef<'_>) -> Option<Item> {
    Some(match value {
        DataRef::Empty => return None,
        DataRef::Int(number) => Item::Number(*number as f64),
        DataRef::Float(number) => finite(*number, Item::Number),
        DataRef::Bool(flag) => Item::Number(f64::from(u8::from(*flag))),
        DataRef::DateTime(date) => finite(date.as_f64(), Item::Date),
        DataRef::String(text) | DataRef::DateTimeIso(text) => return self::text(text),
        DataRef::SharedString(text) => return self::text(text),
        DataRef::DurationIso(_) | DataRef::Error(_) => Item::Missing,
    })
}

fn finite(number: f64, item: fn(f64) -> Item) -> Item {
    if number.is_finite() { item(number) } else { Item::Missing }
}

/// Returns the content of a cell with text. Some programs write numbers as text, some of them with a decimal comma.
fn text(text: &str) -> Option<Item> {
    let text = text.trim();
    if text.is_empty() {
        return None;
    }
    // Only the beginning of a long text is kept.
    let end = (0..=text.len().min(MAX_TITLE)).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
    let short = &text[..end];
    let read = |decimal| cell(short.as_bytes(), decimal);
    Some(match (read(b'.'), read(b',')) {
        (Cell::Number(number), _) | (Cell::Other | Cell::Grouped(_), Cell::Number(number)) => Item::Number(number),
        (Cell::Grouped(number), _) | (Cell::Other, Cell::Grouped(number)) => Item::Number(number),
        (Cell::Time(moment), _) => {
            let midnight = moment.midnight();
            let day = moment.since(midnight) / SECONDS_PER_DAY;
            Item::Date(midnight as f64 / SECONDS_PER_DAY + DAYS_TO_1970 + day)
        }
        (Cell::Missing, _) => Item::Missing,
        _ => Item::Text(short.to_owned()),
    })
}
