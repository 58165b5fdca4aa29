//! HDF5, including MATLAB version 7.3, which is HDF5 after a MATLAB header.

mod attributes;
mod compound;
mod filters;
mod matlab;
mod values;
mod walk;

use hdf5_reader::{Hdf5File, OpenOptions};

use super::Table;
use super::gather::{self, Budget};
use super::mat::layout::Layout;
use crate::record::error::RecordError;

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
const MATLAB: &[u8] = b"MATLAB 7.3 MAT-file";
/// Smallest user block before an HDF5 file \[bytes\]. Its size may be doubled several times.
const FIRST_USER_BLOCK: usize = 512;
const MAX_USER_BLOCKS: usize = 8;

/// Returns whether `bytes` are an HDF5 file.
pub(crate) fn is(bytes: &[u8]) -> bool {
    let mut starts = std::iter::once(0).chain((0..MAX_USER_BLOCKS).map(|doubled| FIRST_USER_BLOCK << doubled));
    bytes.starts_with(MATLAB) || starts.any(|start| bytes.get(start..).is_some_and(|rest| rest.starts_with(SIGNATURE)))
}

/// Reads the columns of a file. `file` is the file name in messages.
///
/// # Errors
/// If the file is damaged, or has no column of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let format = if bytes.starts_with(MATLAB) { "MATLAB 7.3" } else { "HDF5" };
    columns(format, bytes).map_err(|what| RecordError::Damaged { file: file.to_owned(), format, what })
}

fn columns(format: &str, bytes: &[u8]) -> Result<Table, String> {
    let mut budget = Budget::of(bytes.len());
    let most = usize::try_from(budget.remaining()).unwrap_or(usize::MAX);
    let options = OpenOptions::default()
        .with_filter_registry(filters::registry(most))
        .with_max_chunk_bytes(most)
        .with_max_read_bytes(most)
        // Each dataset is read once.
        .with_chunk_cache_bytes(1 << 20);
    let damaged = |error: hdf5_reader::error::Error| {
        format!("cannot be opened ({error}); the file may be cut off: copy it again")
    };
    let file = Hdf5File::from_bytes_with_options(bytes, options).map_err(damaged)?;
    let end = file.superblock().eof_address;
    if end > bytes.len() as u64 {
        return Err(format!(
            "the header states {end} bytes, but the file has {}; the file is cut off: copy it again",
            bytes.len()
        ));
    }
    let root = file.root_group().map_err(damaged)?;
    if format == "MATLAB 7.3" {
        let variables = matlab::variables(&root, &mut budget)?;
        let mut layout = Layout::new(&mut budget);
        let columns = layout.file(&variables)?;
        return gather::table(format, columns, layout.notes());
    }
    let mut walk = walk::Walk::new(&mut budget);
    let columns = walk.file(&root)?;
    gather::table(format, columns, walk.notes())
}

#[cfg(test)]
mod tests;
