//! Raw data of a segment: either chunks with all values of one channel after the other, or rows with one value per
//! channel.

use super::bytes::{Kind, moment};
use super::objects::{Index, Object, Scaler, Values};

/// Largest number of values of DAQmx scalers per byte of raw data. A byte has eight digital lines.
const SCALED_PER_BYTE: usize = 8;

/// The layout of the raw data of a segment.
#[derive(Clone, Copy)]
pub(crate) struct Layout {
    /// Whether the data are stored row by row.
    pub(crate) is_interleaved: bool,
    /// Whether the file ends before the segment.
    pub(crate) is_cut: bool,
    pub(crate) big_endian: bool,
}

/// Adds the values in `raw` to the objects that are `active` in the segment.
pub(crate) fn read(raw: &[u8], layout: Layout, active: &[usize], objects: &mut [Object]) -> Result<(), String> {
    let Some(first) = active.first().and_then(|object| objects[*object].index.as_ref()) else { return Ok(()) };
    if !first.widths.is_empty() {
        return daqmx(raw, layout, active, objects);
    }
    let mut is_text = false;
    for object in active {
        let Some(index) = &objects[*object].index else { continue };
        if !index.widths.is_empty() || index.kind == Kind::Scalers {
            return Err(named(&objects[*object], "DAQmx data are among other data; copy the file again"));
        }
        is_text |= index.kind == Kind::Text;
    }
    match is_text {
        // Some programs also set the flag for a single channel of text.
        true if layout.is_interleaved && active.len() > 1 => {
            Err("texts cannot be interleaved; copy the file again".into())
        }
        false if layout.is_interleaved => interleaved(raw, layout, active, objects),
        _ => contiguous(raw, layout, active, objects),
    }
}

fn named(object: &Object, what: &str) -> String {
    format!("\"{}\": {what}", object.name())
}

fn contiguous(raw: &[u8], layout: Layout, active: &[usize], objects: &mut [Object]) -> Result<(), String> {
    let sizes = || active.iter().filter_map(|object| objects[*object].index.as_ref()).map(|index| index.bytes);
    let chunk =
        sizes().try_fold(0_u64, u64::checked_add).ok_or("a chunk has an impossible size; copy the file again")?;
    let last = sizes().rfind(|bytes| *bytes > 0).unwrap_or(0);
    if chunk == 0 {
        return Ok(());
    }
    let mut rest = raw;
    while !rest.is_empty() {
        let taken = usize::try_from(chunk).map_or(rest.len(), |chunk| chunk.min(rest.len()));
        let (bytes, after) = rest.split_at(taken);
        rest = after;
        let missing = chunk - taken as u64;
        // In a truncated chunk, the rows that the last channel has are complete. A short chunk that is not truncated
        // has the same share of every channel.
        let (part, whole) = match missing {
            0 => (1, 1),
            _ if layout.is_cut => (last.saturating_sub(missing), last),
            _ => (taken as u64, chunk),
        };
        let is_packed = missing > 0 && !layout.is_cut;
        let mut at = 0_usize;
        for object in active {
            let object = &mut objects[*object];
            let Some(index) = &object.index else { continue };
            let (kind, size) = (index.kind, index.kind.size().unwrap_or(1).max(1) as u64);
            let share = |of: u64| u64::try_from(u128::from(of) * u128::from(part) / u128::from(whole)).unwrap_or(0);
            let used = if kind == Kind::Text { share(index.bytes) } else { share(index.count) * size };
            if is_packed && u128::from(used) * u128::from(whole) != u128::from(index.bytes) * u128::from(part) {
                let what =
                    format!("the raw data of {} bytes are not a whole number of rows; copy the file again", raw.len());
                return Err(named(object, &what));
            }
            let end = at.saturating_add(usize::try_from(used).unwrap_or(usize::MAX)).min(bytes.len());
            append(object, kind, bytes[at.min(end)..end].chunks_exact(size as usize), layout.big_endian)?;
            let step = if is_packed { used } else { index_bytes(object) };
            at = at.saturating_add(usize::try_from(step).unwrap_or(usize::MAX)).min(bytes.len());
        }
    }
    Ok(())
}

fn index_bytes(object: &Object) -> u64 {
    object.index.as_ref().map_or(0, |index| index.bytes)
}

fn interleaved(raw: &[u8], layout: Layout, active: &[usize], objects: &mut [Object]) -> Result<(), String> {
    let sizes: Vec<(usize, Kind, usize)> = active
        .iter()
        .filter_map(|object| {
            objects[*object].index.as_ref().map(|index| (*object, index.kind, index.kind.size().unwrap_or(0)))
        })
        .collect();
    let row: usize = sizes.iter().map(|(_, _, size)| size).sum();
    if row == 0 {
        return Ok(());
    }
    let mut offset = 0;
    for (object, kind, size) in sizes {
        let items = raw.chunks_exact(row).map(|row| &row[offset..offset + size]);
        append(&mut objects[object], kind, items, layout.big_endian)?;
        offset += size;
    }
    Ok(())
}

/// Adds values to a channel. Texts and complex numbers are skipped.
fn append<'a>(
    object: &mut Object,
    kind: Kind,
    items: impl Iterator<Item = &'a [u8]>,
    big_endian: bool,
) -> Result<(), String> {
    if !kind.is_number() && kind != Kind::Time {
        return Ok(());
    }
    if matches!(object.values, Values::None) {
        object.values = if kind == Kind::Time { Values::Times(Vec::new()) } else { Values::Numbers(Vec::new()) };
    }
    match (&mut object.values, kind == Kind::Time) {
        (Values::Numbers(values), false) => values.extend(items.map(|item| kind.number(item, big_endian))),
        (Values::Times(values), true) => values.extend(items.map(|item| moment(item, big_endian))),
        _ => {
            return Err(named(
                object,
                "the type of its values changes (numbers, times, DAQmx data); write them to separate channels",
            ));
        }
    }
    Ok(())
}

/// Reads DAQmx data: each chunk has one buffer per card, each buffer has rows, and scalers state the place of a value
/// in a row.
fn daqmx(raw: &[u8], layout: Layout, active: &[usize], objects: &mut [Object]) -> Result<(), String> {
    let indices: Vec<(usize, Index)> =
        active.iter().filter_map(|object| objects[*object].index.clone().map(|index| (*object, index))).collect();
    let buffers = buffers(&indices, objects)?;
    let chunk = buffers.last().map_or(0, |last| last.start + last.bytes);
    let is_several = buffers.iter().filter(|buffer| buffer.bytes > 0).count() > 1;
    let mut allowed = raw.len().saturating_mul(SCALED_PER_BYTE);
    let mut rest = if chunk == 0 { &[] } else { raw };
    while !rest.is_empty() {
        let (bytes, after) = rest.split_at(chunk.min(rest.len()));
        rest = after;
        // In a truncated file, the buffers of a chunk do not end at the same row.
        if bytes.len() < chunk && layout.is_cut && is_several {
            break;
        }
        for (object, index) in &indices {
            for scaler in &index.scalers {
                let Some(buffer) = buffers.get(scaler.buffer).filter(|buffer| buffer.width > 0) else { continue };
                let end = (buffer.start + buffer.bytes).min(bytes.len());
                let rows = &bytes[buffer.start.min(end)..end];
                let count = (rows.len() / buffer.width).min(usize::try_from(index.count).unwrap_or(usize::MAX));
                let Some(remaining) = allowed.checked_sub(count) else {
                    return Err("DAQmx channels have more values than there are bytes for; copy the file again".into());
                };
                allowed = remaining;
                let rows = rows.chunks_exact(buffer.width).take(count);
                if scaler.kind == Kind::Time {
                    let items = rows.filter_map(|row| row.get(scaler.offset..)?.get(..16));
                    append(&mut objects[*object], Kind::Time, items, layout.big_endian)?;
                    continue;
                }
                let numbers = rows.map(|row| value(scaler, row, layout.big_endian));
                scaled(&mut objects[*object], scaler.id, numbers)?;
            }
        }
    }
    Ok(())
}

/// A DAQmx buffer in a chunk.
struct Buffer {
    start: usize,
    bytes: usize,
    /// Size of a row \[bytes\].
    width: usize,
}

/// Returns the buffers of a chunk. A buffer is as long as the longest channel in it.
fn buffers(indices: &[(usize, Index)], objects: &[Object]) -> Result<Vec<Buffer>, String> {
    let widths = indices.first().map_or(&[][..], |(_, index)| &index.widths);
    let mut rows = vec![0_u64; widths.len()];
    for (object, index) in indices {
        if index.widths != widths {
            return Err(named(
                &objects[*object],
                "its DAQmx rows have another width than other channels; copy the file again",
            ));
        }
        for scaler in &index.scalers {
            let Some(rows) = rows.get_mut(scaler.buffer) else {
                return Err(named(&objects[*object], "its DAQmx buffer does not exist; copy the file again"));
            };
            *rows = (*rows).max(index.count);
        }
    }
    let mut start = 0_usize;
    let buffers = rows.iter().zip(widths).map(|(rows, width)| {
        let bytes = usize::try_from(*rows).ok()?.checked_mul(*width)?;
        let buffer = Buffer { start, bytes, width: *width };
        start = start.checked_add(bytes)?;
        Some(buffer)
    });
    let buffers: Option<Vec<Buffer>> = buffers.collect();
    buffers.ok_or_else(|| "DAQmx buffers have an impossible size; copy the file again".into())
}

/// Returns the value of a scaler in a row.
fn value(scaler: &Scaler, row: &[u8], big_endian: bool) -> f64 {
    let byte = if scaler.is_digital { scaler.offset / 8 } else { scaler.offset };
    let item = row.get(byte..).filter(|item| item.len() >= scaler.kind.size().unwrap_or(0));
    let number = item.map_or(f64::NAN, |item| scaler.kind.number(item, big_endian));
    if scaler.is_digital { f64::from((number as u64 >> (scaler.offset % 8)) as u8 & 1) } else { number }
}

fn scaled(object: &mut Object, id: u32, numbers: impl Iterator<Item = f64>) -> Result<(), String> {
    if matches!(object.values, Values::None) {
        object.values = Values::Scalers(Vec::new());
    }
    let Values::Scalers(scalers) = &mut object.values else {
        return Err(named(
            object,
            "the type of its values changes (DAQmx and other data); write them to separate channels",
        ));
    };
    match scalers.iter_mut().find(|(own, _)| *own == id) {
        Some((_, values)) => values.extend(numbers),
        None => scalers.push((id, numbers.collect())),
    }
    Ok(())
}
