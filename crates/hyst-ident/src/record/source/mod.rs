//! Reading of file formats: columns and values, without roles.
//!
//! The format is detected from the content of a file, never from its name. Each format has one file here and implements
//! [`Contents`].

#[cfg(feature = "arrow")]
mod arrow;
#[cfg(feature = "arrow")]
mod columnar;
mod contents;
#[cfg(any(feature = "mat", feature = "hdf5"))]
mod elements;
#[cfg(feature = "mcap-messages")]
mod foreign_mcap;
#[cfg(any(feature = "mat", feature = "hdf5"))]
mod gather;
#[cfg(feature = "hdf5")]
mod hdf5;
#[cfg(feature = "lvm")]
mod lvm;
#[cfg(any(feature = "mat", feature = "hdf5"))]
mod mat;
#[cfg(feature = "npy")]
mod npy;
mod numbers;
#[cfg(feature = "parquet")]
mod parquet;
mod table;
#[cfg(feature = "tdms")]
mod tdms;
mod text;
#[cfg(feature = "xlsx")]
mod xlsx;

pub(crate) use contents::{Axis, Contents, Head, Values, Wanted};
pub(crate) use table::Table;
pub(crate) use text::LargeText;

use std::borrow::Cow;
use std::io::Read;

use super::error::RecordError;

/// A binary format: the test for its files and the function that reads them.
#[cfg(feature = "binary")]
struct Binary {
    is: fn(&[u8]) -> bool,
    read: fn(&str, &[u8]) -> Result<Table, RecordError>,
}

/// The binary formats that are built in. A file of no binary format is read as text.
#[cfg(feature = "binary")]
const BINARY: &[Binary] = &[
    #[cfg(feature = "hdf5")]
    Binary { is: hdf5::is, read: hdf5::read },
    #[cfg(feature = "mat")]
    Binary { is: mat::is, read: mat::read },
    #[cfg(feature = "tdms")]
    Binary { is: tdms::is, read: tdms::read },
    #[cfg(feature = "lvm")]
    Binary { is: lvm::is, read: lvm::read },
    #[cfg(feature = "npy")]
    Binary { is: npy::is, read: npy::read },
    #[cfg(feature = "parquet")]
    Binary { is: parquet::is, read: parquet::read },
    #[cfg(feature = "arrow")]
    Binary { is: arrow::is, read: arrow::read },
    #[cfg(feature = "xlsx")]
    Binary { is: xlsx::is, read: xlsx::read },
    // Logs of runs are read elsewhere.
    #[cfg(feature = "mcap-messages")]
    Binary { is: foreign_mcap::is, read: foreign_mcap::read },
];

/// Opens the contents of a file. `name` is the file name in messages.
///
/// # Errors
/// If the format is not supported, or the file is damaged.
pub(crate) fn open<'a>(name: &str, bytes: &'a [u8]) -> Result<Box<dyn Contents + 'a>, RecordError> {
    #[cfg(feature = "binary")]
    if let Some(binary) = BINARY.iter().find(|binary| (binary.is)(bytes)) {
        return Ok(Box::new((binary.read)(name, bytes)?));
    }
    Ok(Box::new(text::Text::open(name, bytes)?))
}

/// Size up to which a compressed file may always unpack \[bytes\].
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// Largest ratio of unpacked to packed size of larger files. Numbers as text compress by a factor of 3 to 10.
const MAX_EXPANSION: u64 = 200;

/// Unpacks a file compressed by gzip or Zstandard; returns other files unchanged.
///
/// # Errors
/// If the file is damaged, or unpacks to far more bytes than a table of numbers would.
pub(crate) fn unpack<'a>(name: &str, bytes: &'a [u8]) -> Result<Cow<'a, [u8]>, RecordError> {
    let damaged = |format, what: String| RecordError::Damaged { file: name.to_owned(), format, what };
    let (format, reader): (_, Box<dyn Read + 'a>) = if bytes.starts_with(b"\x1f\x8b") {
        ("gzip", Box::new(flate2::read::MultiGzDecoder::new(bytes)))
    } else if bytes.starts_with(b"\x28\xb5\x2f\xfd") {
        let decoder = zstd::stream::read::Decoder::new(bytes);
        ("Zstandard", Box::new(decoder.map_err(|error| damaged("Zstandard", error.to_string()))?))
    } else {
        return Ok(Cow::Borrowed(bytes));
    };
    let limit = ALWAYS_UNPACKED.max(MAX_EXPANSION.saturating_mul(bytes.len() as u64));
    let mut unpacked = Vec::new();
    let read = reader.take(limit + 1).read_to_end(&mut unpacked);
    read.map_err(|error| {
        damaged(format, format!("cannot be unpacked ({error}); the file may be cut off: copy it again"))
    })?;
    if unpacked.len() as u64 > limit {
        return Err(damaged(
            format,
            format!(
                "it unpacks to more than {MAX_EXPANSION} times its size, which tables of numbers do not; \
                 if you trust it, unpack it with gzip -d or zstd -d and read the unpacked file"
            ),
        ));
    }
    Ok(Cow::Owned(unpacked))
}
