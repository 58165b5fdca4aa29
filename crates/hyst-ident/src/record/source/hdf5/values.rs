//! The numbers of a dataset.

use hdf5_reader::ByteOrder;
use hdf5_reader::dataset::Dataset;
use hdf5_reader::messages::datatype::Datatype;

use super::filters::unreadable;
use crate::record::source::elements::{Kind, Storage};
use crate::record::source::gather::Budget;

/// Returns the storage of numbers of this type; `None` if the type is not a number.
pub(super) fn storage(datatype: &Datatype) -> Option<Storage> {
    let (kind, order) = match datatype {
        Datatype::FloatingPoint { size, byte_order } => match size {
            2 => (Kind::F16, byte_order),
            4 => (Kind::F32, byte_order),
            8 => (Kind::F64, byte_order),
            _ => return None,
        },
        Datatype::FixedPoint { size, signed, byte_order } => match (size, signed) {
            (1, true) => (Kind::I8, byte_order),
            (2, true) => (Kind::I16, byte_order),
            (4, true) => (Kind::I32, byte_order),
            (8, true) => (Kind::I64, byte_order),
            _ => (unsigned(*size)?, byte_order),
        },
        Datatype::Bitfield { size, byte_order } => (unsigned(*size)?, byte_order),
        // Booleans are enumerations.
        Datatype::Enum { base, .. } if matches!(**base, Datatype::FixedPoint { .. }) => return storage(base),
        _ => return None,
    };
    Some(Storage { kind, big_endian: *order == ByteOrder::BigEndian })
}

fn unsigned(size: u8) -> Option<Kind> {
    Some(match size {
        1 => Kind::U8,
        2 => Kind::U16,
        4 => Kind::U32,
        8 => Kind::U64,
        _ => return None,
    })
}

/// Reads the bytes of a dataset. Reserves also the memory of `columns` doubles per element.
pub(super) fn bytes(path: &str, dataset: &Dataset, columns: u64, budget: &mut Budget) -> Result<Vec<u8>, String> {
    let elements = dataset.num_elements().unwrap_or(u64::MAX);
    let bytes = dataset.raw_element_size().map_or(u64::MAX, |size| elements.saturating_mul(size as u64));
    let widened = elements.saturating_mul(8).saturating_mul(columns);
    budget.take(bytes.saturating_add(widened)).map_err(|what| format!("dataset {path} {what}"))?;
    dataset.read_raw_bytes().map_err(|error| unreadable(path, &error))
}

/// Returns the dimensions of a dataset.
pub(super) fn dims(dataset: &Dataset) -> Option<Vec<usize>> {
    dataset.shape().iter().map(|dim| usize::try_from(*dim).ok()).collect()
}

/// Reads the texts of a dataset; `None` if it has no texts or too many.
pub(super) fn texts(dataset: &Dataset, budget: &mut Budget) -> Option<Vec<String>> {
    const MAX_TEXTS: u64 = 100_000;
    let is_text = matches!(dataset.dtype(), Datatype::String { .. } | Datatype::VarLen { .. });
    if !is_text || dataset.num_elements().ok()? > MAX_TEXTS {
        return None;
    }
    budget.take(dataset.raw_byte_len().ok()? as u64).ok()?;
    let texts = dataset.read_strings().ok()?;
    Some(texts.iter().map(|text| text.trim_matches(['\0', ' ']).to_owned()).collect())
}
