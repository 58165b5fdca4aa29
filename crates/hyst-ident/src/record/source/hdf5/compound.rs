//! Tables of records: a column a field.

use hdf5_reader::dataset::Dataset;
use hdf5_reader::messages::datatype::Datatype;

use super::values;
use crate::record::source::elements::Storage;
use crate::record::source::gather::{Column, Room};

/// Columns of one field.
const MOST_PARTS: u64 = 4096;

/// Columns of a dataset of records with these units; fields that are no numbers are left out.
pub(super) fn columns(
    path: &str,
    dataset: &Dataset,
    units: Option<&[String]>,
    room: &mut Room,
) -> Result<Vec<Column>, String> {
    let Datatype::Compound { size, fields } = dataset.dtype() else { return Ok(Vec::new()) };
    let (step, rows) = (*size as usize, dataset.num_elements().unwrap_or(u64::MAX));
    let long = dataset.shape().iter().filter(|dim| **dim != 1).count();
    let is_complex =
        fields.len() == 2 && fields.iter().all(|field| matches!(field.name.as_str(), "r" | "i" | "real" | "imag"));
    if step == 0 || long != 1 || is_complex {
        return Ok(Vec::new());
    }
    let mut found: Vec<(String, usize, Storage, Option<String>)> = Vec::new();
    for (at, field) in fields.iter().enumerate() {
        let unit = units.and_then(|units| units.get(at)).filter(|unit| !unit.is_empty()).cloned();
        let Some((storage, parts)) = parts(&field.datatype) else { continue };
        for part in 0..parts {
            let name = if parts == 1 { field.name.clone() } else { format!("{}[{}]", field.name, part + 1) };
            found.push((name, field.byte_offset as usize + part * storage.kind.size(), storage, unit.clone()));
        }
    }
    let text: usize = found.iter().map(|(name, ..)| 2 * (path.len() + name.len())).sum();
    room.take(text as u64)?;
    let bytes = values::bytes(path, dataset, found.len() as u64, room)?;
    let column = |(name, first, storage, unit): (String, usize, Storage, Option<String>)| {
        let values = storage.column(&bytes, first, step, rows as usize);
        Column {
            owner: path.to_owned(),
            label: Some(name.clone()),
            unit,
            ..Column::new(format!("{path}/{name}"), values)
        }
    };
    Ok(found.into_iter().map(column).collect())
}

/// How the numbers of a field are stored, and how many there are a row.
fn parts(datatype: &Datatype) -> Option<(Storage, usize)> {
    match datatype {
        Datatype::Array { base, dims } => {
            let count = dims
                .iter()
                .try_fold(1_u64, |count, dim| count.checked_mul(*dim))
                .filter(|count| *count <= MOST_PARTS)?;
            Some((values::storage(base)?, count as usize))
        }
        datatype => Some((values::storage(datatype)?, 1)),
    }
}
