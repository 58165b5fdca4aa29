//! LabVIEW TDMS files: one segment, a channel per column in the group `record` (TDMS File Format Internal Structure,
//! NI).

use std::io::{self, Write};

use super::column::Column;

/// Table of contents of a segment: metadata, a new list of objects, and raw data.
const CONTENTS: u32 = 1 << 1 | 1 << 2 | 1 << 3;
/// Version 2.0 of the format.
const VERSION: u32 = 4713;
/// Types of data.
const DOUBLE: u32 = 10;
const TEXT: u32 = 0x20;

pub(super) fn write(columns: &[Column<'_>], period: Option<f64>, out: &mut impl Write) -> io::Result<()> {
    let mut metadata = Vec::new();
    metadata.extend((columns.len() as u32 + 2).to_le_bytes());
    for group in ["/", "/'record'"] {
        text(&mut metadata, group);
        // No raw data, no properties.
        metadata.extend(u32::MAX.to_le_bytes());
        metadata.extend(0_u32.to_le_bytes());
    }
    let start = columns.iter().find(|column| column.name == "time_s").and_then(|column| column.values.first().copied());
    for column in columns {
        text(&mut metadata, &format!("/'record'/'{}'", column.name));
        // The index of the raw data: its length, type, dimension and number of values.
        metadata.extend(20_u32.to_le_bytes());
        metadata.extend(DOUBLE.to_le_bytes());
        metadata.extend(1_u32.to_le_bytes());
        metadata.extend((column.values.len() as u64).to_le_bytes());
        metadata.extend(if period.is_some() { 3_u32 } else { 1 }.to_le_bytes());
        text(&mut metadata, "unit_string");
        metadata.extend(TEXT.to_le_bytes());
        text(&mut metadata, column.unit);
        // A record with several segments has no common increment.
        let even = period.map(|period| [("wf_start_offset", start.unwrap_or(0.0)), ("wf_increment", period)]);
        for (name, value) in even.into_iter().flatten() {
            text(&mut metadata, name);
            metadata.extend(DOUBLE.to_le_bytes());
            metadata.extend(value.to_le_bytes());
        }
    }
    let data: usize = columns.iter().map(|column| 8 * column.values.len()).sum();
    out.write_all(b"TDSm")?;
    out.write_all(&CONTENTS.to_le_bytes())?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&((metadata.len() + data) as u64).to_le_bytes())?;
    out.write_all(&(metadata.len() as u64).to_le_bytes())?;
    out.write_all(&metadata)?;
    for value in columns.iter().flat_map(|column| column.values.iter()) {
        out.write_all(&value.to_le_bytes())?;
    }
    Ok(())
}

fn text(out: &mut Vec<u8>, text: &str) {
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}
