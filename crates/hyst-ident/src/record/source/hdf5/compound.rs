//! Tables of compound types: one column per field.

use hdf5_reader::dataset::Dataset;
use hdf5_reader::messages::datatype::Datatype;

use super::values;
use crate::record::source::elements::Storage;
use crate::record::source::gather::{Budget, Column};

/// Largest number of columns of one field.
const MAX_PARTS: u64 = 4096;

/// Returns the columns of a dataset of a compound type. Fields that are not numbers are not read.
pub(super) fn columns(
    path: &str,
    dataset: &Dataset,
    units: Option<&[String]>,
    budget: &mut Budget,
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
    budget.take(text as u64)?;
    let bytes = values::bytes(path, dataset, found.len() as u64, budget)?;
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

/// Returns the storage of the numbers of a field, and their number per row.
fn parts(datatype: &Datatype) -> Option<(Storage, usize)> {
    match datatype {
        Datatype::Array { base, dims } => {
            let count = dims
                .iter()
                .try_fold(1_u64, |count, dim| count.checked_mul(*dim))
                .filter(|count| *count <= MAX_PARTS)?;
            Some((values::storage(base)?, count as usize))
        }
        datatype => Some((values::storage(datatype)?, 1)),
    }
}
