//! Excel workbooks (`.xlsx`).
//!
//! The crate `calamine` decodes the cells, one after the other. Its ready-made table of a sheet is not used: a single cell in the last row
//! and column would make it reserve 400 GB.

mod archive;
mod cells;
mod layout;
mod rate;

use std::io::Cursor;

use calamine::{Reader, SheetType, Xlsx, XlsxError};

use super::{Head, Table};
use crate::record::error::RecordError;
use cells::Sheet;
use layout::Layout;

const FORMAT: &str = "Excel";
/// Cells of all sheets, and numbers of all columns.
const MAX_CELLS: usize = 20_000_000;
/// Columns of numbers that a table has at least; a list of settings has one.
const TABLE_COLUMNS: usize = 2;

/// What is wrong with a file, and what to do.
#[derive(Debug, PartialEq)]
struct Fault(String);

impl Fault {
    fn new(what: impl Into<String>) -> Self {
        Self(what.into())
    }

    /// What only a damaged file has.
    fn damaged(what: impl std::fmt::Display) -> Self {
        Self(format!(
            "{what}; the file is damaged: copy it again, or open it in a spreadsheet program and save it again"
        ))
    }

    fn too_large() -> Self {
        let million = MAX_CELLS / 1_000_000;
        Self(format!(
            "the workbook has more than {million} million cells; save the sheet with the record alone, as CSV"
        ))
    }
}

/// Whether these are the bytes of an Excel workbook, or of another workbook that can be saved as one.
pub(crate) fn is(bytes: &[u8]) -> bool {
    archive::kind(bytes).is_some()
}

/// The columns of all sheets of a workbook; `file` names it in messages.
///
/// # Errors
/// When the file is damaged or not `.xlsx`, or has no column of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    // The decoder computes with the positions of cells before it looks at them.
    let table =
        std::panic::catch_unwind(|| table(bytes)).unwrap_or_else(|_| Err(Fault::damaged("a cell cannot be decoded")));
    table.map_err(|Fault(what)| RecordError::Damaged { file: file.to_owned(), format: FORMAT, what })
}

fn table(bytes: &[u8]) -> Result<Table, Fault> {
    if let Some(advice) = archive::kind(bytes).and_then(archive::Kind::advice) {
        return Err(Fault::new(advice));
    }
    archive::check(bytes)?;
    let unreadable = |error: XlsxError| Fault::damaged(format!("the workbook cannot be read ({error})"));
    let mut workbook = Xlsx::new(Cursor::new(bytes)).map_err(unreadable)?;
    // Charts have no cells.
    let sheets = workbook.sheets_metadata().iter().filter(|sheet| sheet.typ == SheetType::WorkSheet);
    let names: Vec<String> = sheets.map(|sheet| sheet.name.clone()).collect();
    let (mut free_cells, mut free_numbers) = (MAX_CELLS, MAX_CELLS);
    let mut tables = Vec::new();
    for name in names {
        let of_sheet = |fault: Fault| Fault(format!("sheet \"{name}\": {}", fault.0));
        let sheet = Sheet::read(&mut workbook, &name, &mut free_cells).map_err(of_sheet)?;
        let Some(layout) = Layout::find(&sheet) else { continue };
        let columns = layout.columns(sheet, &mut free_numbers)?;
        tables.push((name, columns));
    }
    arrange(tables)
}

/// A column of a sheet.
struct Column {
    head: Head,
    values: Vec<f64>,
    /// Cells with text, which count as empty.
    texts: usize,
}

/// One table of the columns of all sheets. The first sheet with a table has plain names.
fn arrange(sheets: Vec<(String, Vec<Column>)>) -> Result<Table, Fault> {
    let plain = sheets.iter().position(|(_, columns)| columns.len() >= TABLE_COLUMNS);
    let plain = plain.or_else(|| sheets.iter().position(|(_, columns)| !columns.is_empty()));
    let Some(plain) = plain else {
        return Err(Fault::new(
            "no sheet has a column of two or more numbers; a record has a row for each sample, with a column each for time, voltage and displacement",
        ));
    };
    let mut table = Table::new("Excel workbook");
    let mut texts = Vec::new();
    for (number, (sheet, columns)) in sheets.into_iter().enumerate() {
        for mut column in columns {
            if number != plain {
                column.head.name = format!("{sheet}!{}", column.head.name);
            }
            if column.texts > 0 {
                texts.push(format!("\"{}\" ({})", column.head.name, column.texts));
            }
            table.push(column.head, column.values);
        }
    }
    if !texts.is_empty() {
        const SHOWN: usize = 3;
        let more = if texts.len() > SHOWN { format!(" and {} more", texts.len() - SHOWN) } else { String::new() };
        texts.truncate(SHOWN);
        table.notes.push(format!("cells with text among numbers count as empty: column {}{more}", texts.join(", ")));
    }
    Ok(table)
}

#[cfg(test)]
mod tests;
