//! MATLAB files of versions 4, 5 and 7. Version 7.3 is HDF5.
//!
//! Arrays are parsed into a tree of structs and cells. The HDF5 reader builds the same tree. [`layout`] finds the
//! signals in it.

pub(crate) mod layout;
mod text;
pub(crate) mod tree;
mod v4;
mod v5;

use super::Table;
use super::gather::{self, Budget};
use crate::record::error::RecordError;
use layout::Layout;
pub(crate) use text::from_codes;

/// Returns whether `bytes` are a MATLAB file of one of these versions.
pub(crate) fn is(bytes: &[u8]) -> bool {
    v5::is(bytes) || v4::is(bytes)
}

/// Reads the columns of a file. `file` is the file name in messages.
///
/// # Errors
/// If the file is damaged, or has no column of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let mut budget = Budget::of(bytes.len());
    let (format, table) = if v5::is(bytes) {
        ("MATLAB 5", version_5(bytes, &mut budget))
    } else {
        ("MATLAB 4", v4::variables(bytes).and_then(|all| columns("MATLAB 4", &all, &mut budget)))
    };
    table.map_err(|what| RecordError::Damaged { file: file.to_owned(), format, what })
}

fn version_5(bytes: &[u8], budget: &mut Budget) -> Result<Table, String> {
    let header = v5::header(bytes)?;
    let parts = v5::unpack(bytes, header, budget)?;
    let variables = v5::variables(&parts, header)?;
    columns("MATLAB 5", &variables, budget)
}

fn columns(format: &str, variables: &tree::Structs<'_>, budget: &mut Budget) -> Result<Table, String> {
    let mut layout = Layout::new(budget);
    let columns = layout.file(variables)?;
    gather::table(format, columns, layout.notes())
}

#[cfg(test)]
mod tests;
