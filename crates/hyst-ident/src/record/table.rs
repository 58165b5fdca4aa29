//! Records of tables in memory.

use super::checked::Record;
use super::columns::{Need, Reading};
use super::contents::of_contents;
use super::error::RecordError;
use super::source::{Head, Table};

/// A column of a table in memory, for [`Record::from_table`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableColumn {
    /// The heading, with or without a unit: `Voltage [mV]`.
    pub name: String,
    /// The unit, if the heading does not state it.
    pub unit: Option<String>,
    /// The values; NaN where a value is missing.
    pub values: Vec<f64>,
}

impl Record {
    /// Makes a record from a table in memory.
    ///
    /// The columns are processed like those of a file: roles and units come from the headings or from `how`, missing
    /// values and uneven times are repaired.
    ///
    /// # Errors
    /// Those of [`read`](Self::read); messages name the row.
    pub fn from_table(
        name: &str,
        columns: Vec<TableColumn>,
        how: impl Into<Reading>,
        need: Need,
    ) -> Result<Self, RecordError> {
        let rows = columns.first().map_or(0, |column| column.values.len());
        if let Some(odd) = columns.iter().find(|column| column.values.len() != rows) {
            let (name, column) = (name.to_owned(), odd.name.clone());
            return Err(RecordError::Lengths { name, column, found: odd.values.len(), expected: rows });
        }
        let mut table = Table::new("table in memory");
        for TableColumn { name, unit, values } in columns {
            table.push(Head { unit, ..Head::new(name) }, values);
        }
        of_contents(name, &table, &how.into(), need)
    }
}
