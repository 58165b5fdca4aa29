//! MATLAB 5 files: `load` returns a column vector per column (MAT-File Format, MathWorks, chapter 1).

use std::io::{self, Write};

use super::column::Column;

/// Types of data elements.
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
/// Class of arrays of doubles.
const CLASS_DOUBLE: u32 = 6;

pub(super) fn write(columns: &[Column<'_>], out: &mut impl Write) -> io::Result<()> {
    let mut header = [b' '; 128];
    let text = b"MATLAB 5.0 MAT-file, written by hystctl";
    header[..text.len()].copy_from_slice(text);
    header[116..124].fill(0);
    header[124..126].copy_from_slice(&0x0100_u16.to_le_bytes());
    header[126..].copy_from_slice(b"IM");
    out.write_all(&header)?;
    for column in columns {
        let rows = column.values.len();
        let name = column.name.as_bytes();
        let mut head = Vec::new();
        element(&mut head, UINT32, &[CLASS_DOUBLE.to_le_bytes(), [0; 4]].concat());
        element(&mut head, INT32, &[(rows as i32).to_le_bytes(), 1_i32.to_le_bytes()].concat());
        element(&mut head, INT8, name);
        let bytes = 8 * rows;
        out.write_all(&MATRIX.to_le_bytes())?;
        out.write_all(&size(head.len() + 8 + bytes)?)?;
        out.write_all(&head)?;
        out.write_all(&DOUBLE.to_le_bytes())?;
        out.write_all(&size(bytes)?)?;
        for value in column.values.iter() {
            out.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(())
}

/// Appends a data element, padded to 8 bytes.
fn element(out: &mut Vec<u8>, kind: u32, data: &[u8]) {
    out.extend(kind.to_le_bytes());
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(data);
    out.resize(out.len().next_multiple_of(8), 0);
}

fn size(bytes: usize) -> io::Result<[u8; 4]> {
    let size = u32::try_from(bytes)
        .map_err(|_| io::Error::other("a variable of a MATLAB 5 file must be smaller than 4 GB; write .npy or .tdms"));
    size.map(u32::to_le_bytes)
}
