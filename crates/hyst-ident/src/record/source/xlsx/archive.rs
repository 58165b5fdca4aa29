//! The ZIP archive of a workbook.

use std::io::{Cursor, Read};

use zip::ZipArchive;

use super::fault::Fault;

/// First bytes of a ZIP archive, and of the files of Office before 2007.
const ZIP: &[u8] = b"PK\x03\x04";
const OLD_OFFICE: &[u8] = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1";
/// Bytes at either end of an archive that are searched for the names of its parts.
const SEARCHED: usize = 1 << 16;
/// Size up to which a workbook may always unpack \[bytes\].
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// Largest ratio of unpacked to packed size of larger workbooks. Cells compress by a factor of about 10.
const MAX_EXPANSION: u64 = 200;

/// Kinds of workbooks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Xlsx,
    /// Binary sheets.
    Xlsb,
    /// OpenDocument, of LibreOffice Calc and other programs.
    OpenDocument,
    /// Excel before 2007, or encrypted.
    Old,
}

impl Kind {
    /// Returns what to do about a kind that is not supported.
    pub(super) fn advice(self) -> Option<&'static str> {
        match self {
            Self::Xlsx => None,
            Self::Xlsb => Some("the workbook is .xlsb, which is not supported; save it as .xlsx or CSV"),
            Self::OpenDocument => Some("the workbook is .ods, which is not supported; save it as .xlsx or CSV"),
            Self::Old => Some(
                "the file is from Excel before 2007 or has a password, which is not supported; save it without a password as .xlsx or CSV",
            ),
        }
    }
}

/// Returns the kind of workbook; `None` for other files.
pub(super) fn kind(bytes: &[u8]) -> Option<Kind> {
    if bytes.starts_with(OLD_OFFICE) {
        return Some(Kind::Old);
    }
    if !bytes.starts_with(ZIP) {
        return None;
    }
    // Names are not compressed. Each name is before its part, and all names are at the end. A truncated file has only
    // the first ones.
    let ends = [&bytes[..bytes.len().min(SEARCHED)], &bytes[bytes.len().saturating_sub(SEARCHED)..]];
    let has = |name: &[u8]| ends.iter().any(|end| end.windows(name.len()).any(|window| window == name));
    if has(b"xl/workbook.bin") {
        Some(Kind::Xlsb)
    } else if has(b"xl/workbook.xml") || has(b"xl/worksheets/") || has(b"xl/theme/") {
        Some(Kind::Xlsx)
    } else if bytes.len() > 30 && bytes[30..].starts_with(b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet") {
        Some(Kind::OpenDocument)
    } else {
        None
    }
}

/// Unpacks every part once and checks that it is complete and not too large.
///
/// The decoder reads parts into memory, and a part of 100 kB can unpack to 100 MB.
///
/// # Errors
/// If a part is damaged, or the parts together are too large.
pub(super) fn check(bytes: &[u8]) -> Result<(), Fault> {
    let limit = ALWAYS_UNPACKED.max(MAX_EXPANSION.saturating_mul(bytes.len() as u64));
    let mut free = limit;
    let mut archive = ZipArchive::new(Cursor::new(bytes))
        .map_err(|_| Fault::damaged("the list of parts at the end of the file is missing"))?;
    for part in 0..archive.len() {
        let part =
            archive.by_index(part).map_err(|error| Fault::damaged(format!("a part cannot be read ({error})")))?;
        let name =
            part.name().map_err(|error| Fault::damaged(format!("a part has no readable name ({error})")))?.into_owned();
        let copied = std::io::copy(&mut part.take(free + 1), &mut std::io::sink());
        let size = copied.map_err(|error| Fault::damaged(format!("the part {name} cannot be unpacked ({error})")))?;
        let too_large = || {
            Fault::new(format!(
                "the workbook expands to more than {} MB; save only the sheet with the record, as CSV",
                limit >> 20
            ))
        };
        free = free.checked_sub(size).ok_or_else(too_large)?;
    }
    Ok(())
}
