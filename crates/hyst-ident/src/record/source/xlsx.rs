//! Excel workbooks (`.xlsx`).
//!
//! The crate `calamine` decodes the cells one by one. Its table of a whole sheet is not used, because a single cell in
//! the last row and column would reserve 400 GB.

mod archive;
mod cells;
mod fault;
mod layout;
mod rate;

use std::io::Cursor;

use calamine::{Reader, SheetType, Xlsx, XlsxError};

use super::Table;
use crate::record::error::RecordError;
use cells::Sheet;
use fault::{Fault, MAX_CELLS};
use layout::{Column, Layout};

const FORMAT: &str = "Excel";
/// Fewest columns of numbers of a table. A list of settings has one.
const TABLE_COLUMNS: usize = 2;

/// Returns whether `bytes` are an Excel workbook, or another workbook that can be saved as one.
pub(crate) fn is(bytes: &[u8]) -> bool {
    archive::kind(bytes).is_some()
}

/// Reads the columns of all sheets of a workbook. `file` is the file name in messages.
///
/// # Errors
/// If the file is damaged or not `.xlsx`, or has no column of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    // The decoder may panic at invalid positions of cells.
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

/// Makes one table of the columns of all sheets. In the first sheet with a table the names have no prefix.
fn arrange(sheets: Vec<(String, Vec<Column>)>) -> Result<Table, Fault> {
    let plain = sheets.iter().position(|(_, columns)| columns.len() >= TABLE_COLUMNS);
    let plain = plain.or_else(|| sheets.iter().position(|(_, columns)| !columns.is_empty()));
    let Some(plain) = plain else {
        return Err(Fault::new(
            "no sheet has a column of two or more numbers; a record has one row per sample, with one column each for time, voltage and displacement",
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
        const MAX_SHOWN: usize = 3;
        let more =
            if texts.len() > MAX_SHOWN { format!(" and {} more", texts.len() - MAX_SHOWN) } else { String::new() };
        texts.truncate(MAX_SHOWN);
        table
            .notes
            .push(format!("cells with text between numbers are read as empty: column {}{more}", texts.join(", ")));
    }
    Ok(table)
}

#[cfg(test)]
mod tests;
