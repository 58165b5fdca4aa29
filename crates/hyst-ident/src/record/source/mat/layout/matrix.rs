//! Columns of one array of numbers.

use super::super::tree::{Array, Value};
use super::Layout;
use super::about::About;
use crate::record::source::gather::{Column, of_matrix};

/// The places of columns in an array \[numbers\].
struct Columns {
    rows: usize,
    count: usize,
    /// Distance from one column to the next.
    across: usize,
    /// Distance from one row to the next.
    down: usize,
}

impl Columns {
    /// Returns the columns of an array with these dimensions.
    ///
    /// A vector is one column. A table is read if it does not have more columns than rows.
    fn of(dims: &[usize], clock_rows: Option<usize>) -> Option<Self> {
        let total = super::super::tree::count(dims)?;
        let long: Vec<usize> = dims.iter().copied().filter(|dim| *dim != 1).collect();
        match *long.as_slice() {
            [rows] => Some(Self { rows, count: 1, across: 0, down: 1 }),
            [rows, count] if dims[0] == rows && rows >= count => Some(Self { rows, count, across: rows, down: 1 }),
            // In matrix signals of Simulink the last dimension is the time.
            [.., rows] if Some(rows) == clock_rows && rows > 0 && total / rows <= rows => {
                Some(Self { rows, count: total / rows, across: 1, down: total / rows })
            }
            _ => None,
        }
    }
}

impl Layout<'_> {
    /// Adds the columns of an array of numbers.
    pub(super) fn numbers(
        &mut self,
        path: &str,
        array: &Array<'_>,
        about: &About<'_>,
        columns: &mut Vec<Column>,
    ) -> Result<(), String> {
        let Value::Numbers { bytes, storage } = &array.value else { return Ok(()) };
        if !array.is_numbers() {
            return Ok(());
        }
        let Some(shape) = Columns::of(&array.dims, about.clock_rows) else {
            self.not_a_table(path, &array.dims);
            return Ok(());
        };
        let (names, units) = of_matrix(about.lists, shape.count);
        let size = storage.kind.size();
        for k in 0..shape.count {
            let place = if shape.count == 1 { path.to_owned() } else { format!("{path}[{}]", k + 1) };
            let own = names.and_then(|names| names.get(k)).filter(|name| !name.is_empty()).cloned();
            let label = match about.label {
                Some((label, _)) if shape.count == 1 => Some(label.to_owned()),
                Some((label, _)) => Some(format!("{label}[{}]", k + 1)),
                None => own,
            };
            let unit = units
                .and_then(|units| units.get(k))
                .filter(|unit| !unit.is_empty())
                .cloned()
                .or_else(|| about.unit.clone());
            let text =
                place.len() + path.len() + label.as_ref().map_or(0, String::len) + unit.as_ref().map_or(0, String::len);
            self.budget.take((shape.rows as u64).saturating_mul(8).saturating_add(text as u64))?;
            let values = storage.column(bytes, k * shape.across * size, shape.down * size, shape.rows);
            let owner = about.label.map_or(path, |(_, owner)| owner).to_owned();
            columns.push(Column { owner, label, unit, clock: about.clock, ..Column::new(place, values) });
        }
        Ok(())
    }

    fn not_a_table(&mut self, path: &str, dims: &[usize]) {
        let size = dims.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
        let advice = if dims.len() == 2 {
            format!(": it has more columns than rows; transpose it ({path} = {path}.')")
        } else {
            String::new()
        };
        self.note(format!("\"{path}\" of {size} numbers is not a table of columns{advice}"));
    }
}
