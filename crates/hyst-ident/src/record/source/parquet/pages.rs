//! Check of page sizes in a Parquet file. The decoder allocates the stated size of a page before it reads the page.

use parquet::basic::Compression;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};

use super::Fault;

/// Deepest nesting of structs in a page header. The format has three levels.
const MAX_DEPTH: u32 = 8;
/// Largest number of elements of a list in a page header. The format has no lists there.
const MAX_ELEMENTS: u64 = 65_536;

/// The kind of a dictionary page.
const DICTIONARY_PAGE: i64 = 2;
/// The encodings of pages that need a dictionary.
const DICTIONARY_ENCODINGS: [i64; 2] = [2, 8];

/// Checks that the pages of `columns` are inside the file and together unpack to at most `limit` bytes.
///
/// # Errors
/// If they are not, or if their compression is not supported.
pub(super) fn check(bytes: &[u8], metadata: &ParquetMetaData, columns: &[usize], limit: usize) -> Result<(), Fault> {
    let mut free = Free { unpacked: limit as u64, values: (limit / size_of::<f64>()) as u64 };
    for group in metadata.row_groups() {
        for column in columns.iter().filter_map(|at| group.columns().get(*at)) {
            check_chunk(bytes, column, &mut free)
                .map_err(|Fault(what)| Fault(format!("column \"{}\": {what}", column.column_path().string())))?;
        }
    }
    Ok(())
}

/// The limits for further pages.
struct Free {
    unpacked: u64,
    values: u64,
}

fn check_chunk(bytes: &[u8], column: &ColumnChunkMetaData, free: &mut Free) -> Result<(), Fault> {
    let codec = match column.compression() {
        Compression::BROTLI(_) => Some("Brotli"),
        Compression::LZO => Some("LZO"),
        _ => None,
    };
    if let Some(codec) = codec {
        return Err(Fault::new(format!(
            "{codec} compression is not supported; write the file again with compression=\"zstd\""
        )));
    }
    let outside = || Fault::damaged("its values are outside the file");
    let start = column.dictionary_page_offset().unwrap_or_else(|| column.data_page_offset());
    let start = usize::try_from(start).map_err(|_| outside())?;
    let length = usize::try_from(column.compressed_size()).map_err(|_| outside())?;
    let chunk = start.checked_add(length).and_then(|end| bytes.get(start..end)).ok_or_else(outside)?;
    let (mut at, mut seen, mut has_dictionary) = (0, 0, false);
    while at < chunk.len() && seen < column.num_values() {
        let mut header = Compact { bytes: chunk, at };
        let page = Page::read(&mut header).ok_or_else(|| Fault::damaged("a page has no header"))?;
        let rest = chunk.len() - header.at;
        page.check(rest as u64, free)?;
        has_dictionary |= page.kind == DICTIONARY_PAGE;
        if DICTIONARY_ENCODINGS.contains(&page.encoding) && !has_dictionary {
            return Err(Fault::damaged("its dictionary is missing"));
        }
        seen = seen.saturating_add(page.values);
        at = header.at + page.packed as usize;
    }
    Ok(())
}

/// The sizes in the header of a page.
#[derive(Default)]
struct Page {
    kind: i64,
    /// The encoding of the values of a data page.
    encoding: i64,
    unpacked: i64,
    packed: i64,
    /// Number of values of a data page.
    values: i64,
    /// Number of values of a dictionary.
    dictionary: i64,
    /// Size of the levels of a version 2 page, which are not compressed \[bytes\].
    levels: [i64; 2],
}

impl Page {
    fn read(header: &mut Compact<'_>) -> Option<Self> {
        let mut page = Self { unpacked: -1, packed: -1, ..Self::default() };
        // The fields of `PageHeader` (0) and of its structs for data (5), dictionary (7) and data of version 2 (8).
        header.read_struct(0, MAX_DEPTH, &mut |outer, field, value| match (outer, field) {
            (0, 1) => page.kind = value,
            (5, 2) | (8, 4) => page.encoding = value,
            (0, 2) => page.unpacked = value,
            (0, 3) => page.packed = value,
            (5 | 8, 1) => page.values = value,
            (7, 1) => page.dictionary = value,
            (8, 5) => page.levels[0] = value,
            (8, 6) => page.levels[1] = value,
            _ => {}
        })?;
        Some(page)
    }

    /// Checks a page. `rest` is the number of bytes of the column after its header.
    fn check(&self, rest: u64, free: &mut Free) -> Result<(), Fault> {
        let all = [self.unpacked, self.packed, self.values, self.dictionary, self.levels[0], self.levels[1]];
        let size = |value: i64| u64::try_from(value).ok();
        let (Some(unpacked), Some(packed), Some(values)) = (size(self.unpacked), size(self.packed), size(self.values))
        else {
            return Err(Fault::damaged("a page has a negative size"));
        };
        if all.iter().any(|value| *value < 0 || *value > i64::from(i32::MAX)) || packed > rest {
            return Err(Fault::damaged("a page is longer than the column"));
        }
        if self.levels[0] + self.levels[1] > self.packed.min(self.unpacked) {
            return Err(Fault::damaged("a page is shorter than its stated size"));
        }
        // A value of a dictionary takes at least one bit.
        if self.dictionary > self.unpacked.saturating_mul(8) {
            return Err(Fault::damaged("a dictionary is shorter than its stated size"));
        }
        let fits = free.unpacked.checked_sub(unpacked).zip(free.values.checked_sub(values));
        let (unpacked, values) = fits.ok_or_else(|| {
            Fault::new("the numbers unpack to more than 200 times the size of the file; write only the columns of the record, as CSV")
        })?;
        *free = Free { unpacked, values };
        Ok(())
    }
}

/// The part of Thrift's compact protocol that page headers use.
struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Compact<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn unsigned(&mut self) -> Option<u64> {
        let (mut value, mut shift) = (0, 0);
        while shift < 64 {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
            shift += 7;
        }
        None
    }

    fn integer(&mut self) -> Option<i64> {
        let value = self.unsigned()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    fn skip(&mut self, bytes: u64) -> Option<()> {
        self.at = self.at.checked_add(usize::try_from(bytes).ok()?).filter(|at| *at <= self.bytes.len())?;
        Some(())
    }

    /// Reads a struct and calls `field` for each integer: number of the struct, number of the field, value.
    fn read_struct(&mut self, number: i16, depth: u32, field: &mut dyn FnMut(i16, i16, i64)) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        let mut own = 0_i16;
        loop {
            let header = self.byte()?;
            if header == 0 {
                return Some(());
            }
            own = match header >> 4 {
                0 => i16::try_from(self.integer()?).ok()?,
                difference => own.checked_add(i16::from(difference))?,
            };
            self.read_value(header & 15, (number, own), depth, field)?;
        }
    }

    fn read_value(
        &mut self,
        kind: u8,
        (outer, own): (i16, i16),
        depth: u32,
        field: &mut dyn FnMut(i16, i16, i64),
    ) -> Option<()> {
        match kind {
            // Booleans are in the header.
            1 | 2 => Some(()),
            3 => self.skip(1),
            4..=6 => {
                let value = self.integer()?;
                field(outer, own, value);
                Some(())
            }
            7 => self.skip(8),
            8 => {
                let length = self.unsigned()?;
                self.skip(length)
            }
            9 | 10 => {
                let header = self.byte()?;
                let count = if header >> 4 == 15 { self.unsigned()? } else { u64::from(header >> 4) };
                let depth = depth.checked_sub(1).filter(|_| count <= MAX_ELEMENTS)?;
                (0..count).try_for_each(|_| match header & 15 {
                    1 | 2 => self.skip(1),
                    kind => self.read_value(kind, (-1, -1), depth, field),
                })
            }
            12 => self.read_struct(own, depth, field),
            _ => None,
        }
    }
}
