//! The columns of one dataset.

use hdf5_reader::dataset::Dataset;
use hdf5_reader::messages::datatype::Datatype;

use super::super::attributes::Attributes;
use super::super::{compound, values};
use super::{Scope, UNITS, Walk, instants};
use crate::record::source::elements::Storage;
use crate::record::source::gather::{Clock, Column, Rate, of_matrix, step_of};

const NAMES: [&str; 6] = ["names", "columns", "column_names", "labels", "headers", "channel_names"];
/// The text with which netCDF marks a dimension without values.
const NO_VALUES: &str = "This is a netCDF dimension but not a netCDF variable";

/// The metadata in the attributes of a dataset.
struct Stated {
    names: Option<Vec<String>>,
    units: Option<Vec<String>>,
    clock: Clock,
    /// Scale of stored codes: value = code · scale + offset (CF conventions of netCDF).
    scale: f64,
    offset: f64,
    missing: Option<f64>,
}

impl Walk<'_> {
    /// Adds the columns of a dataset.
    pub(super) fn dataset(
        &mut self,
        path: &str,
        dataset: &Dataset,
        scope: &Scope,
        columns: &mut Vec<Column>,
    ) -> Result<(), String> {
        if dataset.num_elements().is_ok_and(|count| count < 2) {
            return Ok(());
        }
        if let Datatype::Compound { fields, .. } = dataset.dtype() {
            let stated = Stated::of(&Attributes::of_dataset(dataset), scope, fields.len());
            let units = stated.units.filter(|units| units.len() == fields.len());
            let found = compound::columns(path, dataset, units.as_deref(), self.budget)?;
            columns.extend(found.into_iter().map(|column| Column { clock: stated.clock, ..column }));
            return Ok(());
        }
        let Some(storage) = values::storage(dataset.dtype()) else { return Ok(()) };
        let attributes = Attributes::of_dataset(dataset);
        if attributes.text(&["NAME"]).is_some_and(|name| name.starts_with(NO_VALUES)) {
            return Ok(());
        }
        let dims = values::dims(dataset).unwrap_or_default();
        let long: Vec<(usize, usize)> = dims.iter().copied().enumerate().filter(|(_, dim)| *dim != 1).collect();
        let (axis, rows, count) = match *long.as_slice() {
            [(axis, rows)] => (axis, rows, 1),
            [(axis, rows), (_, count)] if dims.len() == 2 && rows >= count => (axis, rows, count),
            _ => {
                self.not_a_table(path, &dims);
                return Ok(());
            }
        };
        let stated = Stated::of(&attributes, scope, count);
        let clock = clock_of(dataset, &attributes, axis).unwrap_or(stated.clock);
        let text = (count as u64).saturating_mul(2 * path.len() as u64);
        self.budget.take(text)?;
        let bytes = values::bytes(path, dataset, 1, self.budget)?;
        let (names, units) = of_matrix(&scope.lists, count);
        let names = stated.names.as_deref().or(names);
        let units = stated.units.as_deref().or(units);
        for k in 0..count {
            let place = if count == 1 { path.to_owned() } else { format!("{path}[{}]", k + 1) };
            let label = names.and_then(|names| names.get(k)).filter(|name| count > 1 && !name.is_empty()).cloned();
            let unit = units
                .and_then(|units| units.get(k).or(units.first().filter(|_| units.len() == 1)))
                .filter(|unit| !unit.is_empty());
            let mut values = stated.values(storage, &bytes, k, count, rows);
            let mut unit = unit.cloned();
            if let Some(date) = unit.as_deref().filter(|_| count == 1 && !stated.is_scaled())
                && let Some(seconds) = instants::seconds(date, &values, &bytes, storage)
            {
                (values, unit) = (seconds, Some("s".to_owned()));
            }
            let identity = (count == 1).then(|| dataset.address());
            let owner = path.to_owned();
            columns.push(Column { owner, label, unit, clock, identity, ..Column::new(place, values) });
        }
        if stated.is_scaled() {
            self.note(format!("{path}: values are scale_factor · code + add_offset, from its attributes"));
        }
        Ok(())
    }

    fn not_a_table(&mut self, path: &str, dims: &[usize]) {
        let size = dims.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
        let advice = if dims.len() == 2 { ": it has more columns than rows; transpose it" } else { "" };
        self.note(format!("dataset {path} of {size} numbers is not a table of columns{advice}"));
    }
}

impl Stated {
    fn of(attributes: &Attributes, scope: &Scope, columns: usize) -> Self {
        // One text may be a list: "s, V, um".
        let list = |names: &[&str]| {
            let texts = attributes.texts(names)?;
            let [text] = texts.as_slice() else { return Some(texts) };
            let split: Vec<String> = text.split([',', ';']).map(|part| part.trim().to_owned()).collect();
            Some(if columns > 1 && split.len() == columns { split } else { texts })
        };
        let rate = attributes.numbers().filter_map(|(name, value)| step_of(name, value, None)).reduce(Rate::or_better);
        Self {
            names: list(&NAMES).filter(|names| names.len() == columns),
            units: list(&UNITS).filter(|units| units.len() == columns || units.len() == 1),
            clock: rate.map_or(scope.clock, |rate| Clock::Even { start: 0.0, step: rate.step }),
            scale: attributes.number("scale_factor").unwrap_or(1.0),
            offset: attributes.number("add_offset").unwrap_or(0.0),
            missing: attributes.number("_FillValue"),
        }
    }

    fn is_scaled(&self) -> bool {
        self.scale != 1.0 || self.offset != 0.0
    }

    /// Returns the values of a column of a table that is stored row by row.
    fn values(&self, storage: Storage, bytes: &[u8], column: usize, columns: usize, rows: usize) -> Vec<f64> {
        let size = storage.kind.size();
        let mut values = storage.column(bytes, column * size, columns * size, rows);
        if let Some(missing) = self.missing {
            values.iter_mut().filter(|value| **value == missing).for_each(|value| *value = f64::NAN);
        }
        if self.is_scaled() {
            values.iter_mut().for_each(|value| *value = *value * self.scale + self.offset);
        }
        values
    }
}

/// Returns the dimension scale of the rows.
fn clock_of(dataset: &Dataset, attributes: &Attributes, axis: usize) -> Option<Clock> {
    let list = attributes.get("DIMENSION_LIST")?;
    let size = dataset.vlen_reference_size();
    let reference = list.raw_data.get(axis * size..(axis + 1) * size)?;
    let address = *dataset.resolve_vlen_reference_bytes(reference, 8).ok()?.first_chunk()?;
    Some(Clock::Column(u64::from_le_bytes(address)))
}
