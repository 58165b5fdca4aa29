//! The ZIP archive that a workbook is.

use std::io::{Cursor, Read};

use zip::ZipArchive;

use super::Fault;

/// First bytes of a ZIP archive, and of the files of Office before 2007.
const ZIP: &[u8] = b"PK\x03\x04";
const OLD_OFFICE: &[u8] = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1";
/// Bytes at either end of an archive in which the names of its parts are looked for.
const SEARCHED: usize = 1 << 16;
/// Bytes that a workbook may hold whatever its size.
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// How many times its size a workbook may hold beyond that; cells shrink to a tenth.
const MAX_EXPANSION: u64 = 200;

/// Kinds of workbooks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Xlsx,
    /// With sheets in binary.
    Xlsb,
    /// LibreOffice Calc and others.
    OpenDocument,
    /// Before 2007, or encrypted.
    Old,
}

impl Kind {
    /// What to do about a kind that is not read.
    pub(super) fn advice(self) -> Option<&'static str> {
        match self {
            Self::Xlsx => None,
            Self::Xlsb => Some("the workbook is .xlsb, which is not read; save it as .xlsx or CSV"),
            Self::OpenDocument => Some("the workbook is .ods, which is not read; save it as .xlsx or CSV"),
            Self::Old => Some(
                "the file is from Excel before 2007 or has a password, which is not read; save it without a password as .xlsx or CSV",
            ),
        }
    }
}

/// What kind of workbook these bytes are; `None` for other files.
pub(super) fn kind(bytes: &[u8]) -> Option<Kind> {
    if bytes.starts_with(OLD_OFFICE) {
        return Some(Kind::Old);
    }
    if !bytes.starts_with(ZIP) {
        return None;
    }
    // Names are not compressed: each is before its part, and all are at the end. A file that is cut off has the first alone.
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

/// Unpacks every part once, to know that it is whole and not larger than a workbook is.
///
/// The decoder reads parts into memory, and a part of a hundred kilobytes can unpack to a hundred megabytes.
///
/// # Errors
/// When it is not.
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
                "the workbook expands to more than {} MB; save the sheet with the record alone, as CSV",
                limit >> 20
            ))
        };
        free = free.checked_sub(size).ok_or_else(too_large)?;
    }
    Ok(())
}
