//! NumPy arrays: NPY files, and NPZ archives of NPY files.
//!
//! A vector is one column. A table has one column per table column, and a structured array one column per field.

mod archive;
mod array;
mod dtype;
mod literal;
#[cfg(test)]
mod tests;

use super::{Head, Table};
use crate::record::error::RecordError;
use array::{Array, Shape, TAG};
use dtype::Kind;

const FORMAT: &str = "NumPy";

/// Returns whether `bytes` are an NPY or NPZ file.
pub(crate) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(TAG) || archive::is(bytes)
}

/// Reads the arrays of a file. `file` is the file name in messages.
///
/// # Errors
/// If the file is damaged, or has no array of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let table = if bytes.starts_with(TAG) { single(bytes) } else { archive::read(bytes) };
    let table = table.and_then(|table| if table.heads.is_empty() { Err(nothing(&table)) } else { Ok(table) });
    table.map_err(|what| RecordError::Damaged { file: file.to_owned(), format: FORMAT, what })
}

/// Reads a file with one array.
fn single(bytes: &[u8]) -> Result<Table, String> {
    let array = Array::parse(bytes).map_err(|what| format!("the array cannot be read: {what}"))?;
    let mut table = Table::new("NumPy .npy");
    let name = |field: &str, column: usize| {
        // Columns without a name are numbered.
        if field.is_empty() { (column + 1).to_string() } else { numbered(field, &array, column) }
    };
    add(&mut table, "", &array, name, |_| None);
    Ok(table)
}

/// Adds the number of the column to a name, if the array is a table.
fn numbered(name: &str, array: &Array<'_>, column: usize) -> String {
    if matches!(array.shape, Shape::Table(..)) { format!("{name}[{}]", column + 1) } else { name.to_owned() }
}

/// Adds the columns of an array.
fn add(
    table: &mut Table,
    own: &str,
    array: &Array<'_>,
    name: impl Fn(&str, usize) -> String,
    unit: impl Fn(usize) -> Option<String>,
) {
    let own = if own.is_empty() { "the array".to_owned() } else { format!("\"{own}\"") };
    if array.surplus > 0 {
        table.notes.push(format!("{own}: {} bytes after the array are not read", array.surplus));
    }
    let rows = match array.shape {
        Shape::Vector(rows) | Shape::Table(rows, _) => rows,
        Shape::Scalar => return,
        Shape::Other => {
            if array.fields.iter().any(|field| matches!(field.kind, Kind::Float | Kind::Signed | Kind::Unsigned)) {
                table.notes.push(format!(
                    "{own} is not read: its shape is {:?}, but a record needs one row per sample",
                    array.lengths
                ));
            }
            return;
        }
    };
    if rows < 2 {
        return;
    }
    for field in &array.fields {
        if let Kind::Other(what) = field.kind {
            let of = if field.name.is_empty() { own.clone() } else { format!("\"{}\"", field.name) };
            table.notes.push(format!("{of} is not read: it holds {what}"));
        }
        for column in 0..array.columns() {
            let Some(values) = array.numbers(field, column) else { break };
            let unit = if matches!(field.kind, Kind::Time { .. }) { Some("s".to_owned()) } else { unit(column) };
            table.push(Head { unit, ..Head::new(name(&field.name, column)) }, values);
        }
    }
}

/// Returns why a file has no column, and what to do.
fn nothing(table: &Table) -> String {
    let why = if table.notes.is_empty() { String::new() } else { format!(" ({})", table.notes.join("; ")) };
    format!(
        "no array has columns of two or more numbers{why}; save one row per sample, for example numpy.column_stack([t, u, y])"
    )
}
