//! NumPy files: `numpy.load` returns a structured array (format version 1.0, NEP 1).

use std::io::{self, Write};

use super::column::Column;

/// The size of the header is a multiple of this \[bytes\].
const ALIGNMENT: usize = 64;

pub(super) fn write(columns: &[Column<'_>], out: &mut impl Write) -> io::Result<()> {
    let rows = columns.first().map_or(0, |column| column.values.len());
    let fields: Vec<String> = columns.iter().map(|column| format!("('{}', '<f8')", column.name)).collect();
    let mut header = format!("{{'descr': [{}], 'fortran_order': False, 'shape': ({rows},), }}", fields.join(", "));
    // Magic, version and length of the header take 10 bytes; a line feed ends it.
    let length = (10 + header.len() + 1).next_multiple_of(ALIGNMENT);
    header.extend(std::iter::repeat_n(' ', length - 11 - header.len()));
    header.push('\n');
    out.write_all(b"\x93NUMPY\x01\x00")?;
    out.write_all(&(header.len() as u16).to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    for row in 0..rows {
        for column in columns {
            out.write_all(&column.values[row].to_le_bytes())?;
        }
    }
    Ok(())
}
