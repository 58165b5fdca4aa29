//! HDF5, and MATLAB's version 7.3, which is HDF5 behind a header of its own.

mod attributes;
mod compound;
mod filters;
mod matlab;
mod values;
mod walk;

use hdf5_reader::{Hdf5File, OpenOptions};

use super::Table;
use super::gather::{self, Room};
use super::mat::layout::Layout;
use crate::record::error::RecordError;

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
const MATLAB: &[u8] = b"MATLAB 7.3 MAT-file";
/// A file may begin behind a block of its user's: 512 bytes, or that doubled any number of times.
const FIRST_USER_BLOCK: usize = 512;
const MOST_USER_BLOCKS: usize = 8;

/// Whether the content is HDF5.
pub(crate) fn is(bytes: &[u8]) -> bool {
    let mut starts = std::iter::once(0).chain((0..MOST_USER_BLOCKS).map(|doubled| FIRST_USER_BLOCK << doubled));
    bytes.starts_with(MATLAB) || starts.any(|start| bytes.get(start..).is_some_and(|rest| rest.starts_with(SIGNATURE)))
}

/// Reads the columns of a file; `file` stands for it in messages.
///
/// # Errors
/// When the file is damaged, or holds no column of numbers.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Table, RecordError> {
    let format = if bytes.starts_with(MATLAB) { "MATLAB 7.3" } else { "HDF5" };
    columns(format, bytes).map_err(|what| RecordError::Damaged { file: file.to_owned(), format, what })
}

fn columns(format: &str, bytes: &[u8]) -> Result<Table, String> {
    let mut room = Room::of(bytes.len());
    let most = usize::try_from(room.left()).unwrap_or(usize::MAX);
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
            "{end} bytes are announced and {} are there; the file is cut off: copy it again",
            bytes.len()
        ));
    }
    let root = file.root_group().map_err(damaged)?;
    if format == "MATLAB 7.3" {
        let variables = matlab::variables(&root, &mut room)?;
        let mut layout = Layout::new(&mut room);
        let columns = layout.file(&variables)?;
        return gather::table(format, columns, layout.notes());
    }
    let mut walk = walk::Walk::new(&mut room);
    let columns = walk.file(&root)?;
    gather::table(format, columns, walk.notes())
}

#[cfg(test)]
mod tests;
