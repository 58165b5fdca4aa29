//! Columns of a tree of arrays, on their way into a table.
//!
//! Files of MATLAB and HDF5 hold arrays in structs and groups. What is common to them is here: unique names, times shared by columns,
//! the names of a matrix's columns, groups that are segments, and the limit on memory.

mod lists;
mod rates;
mod segments;

use std::collections::HashMap;

use super::{Axis, Head, Table};
pub(crate) use lists::{TextList, of_matrix};
pub(crate) use rates::{Rate, step_of};
pub(crate) use segments::{Part, join, number_of};

/// Bytes that a file may expand to whatever its size.
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// How many times its size a file may expand to beyond that.
const MAX_EXPANSION: u64 = 200;

/// Bytes that may still be allocated for a file's arrays.
#[derive(Debug)]
pub(crate) struct Room(u64);

impl Room {
    /// What a file of this size justifies.
    pub(crate) fn of(file_bytes: usize) -> Self {
        Self(ALWAYS_UNPACKED.max(MAX_EXPANSION.saturating_mul(file_bytes as u64)))
    }

    /// Bytes left.
    pub(crate) fn left(&self) -> u64 {
        self.0
    }

    /// Takes `bytes`, or says that there are too many.
    pub(crate) fn take(&mut self, bytes: u64) -> Result<(), String> {
        self.0 = self.0.checked_sub(bytes).ok_or_else(Self::exceeded)?;
        Ok(())
    }

    /// What is wrong with a file that needs more.
    pub(crate) fn exceeded() -> String {
        format!(
            "expands to more than {MAX_EXPANSION} times the size of the file, as no measurement does; export the columns that are needed as CSV"
        )
    }
}

/// Where the times of a column's rows are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clock {
    Unknown,
    /// Even \[s\].
    Even {
        start: f64,
        step: f64,
    },
    /// In the column with this identity.
    Column(u64),
}

/// A column and all that the file says of it.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    /// Where it is: `/run/data[2]`, `rig.run.voltage`.
    pub(crate) path: String,
    /// The array, struct or group that a label belongs to: `/run/data`.
    pub(crate) owner: String,
    /// What the file calls it, where that is more than its place.
    pub(crate) label: Option<String>,
    pub(crate) unit: Option<String>,
    pub(crate) clock: Clock,
    /// By which others name it as their clock.
    pub(crate) identity: Option<u64>,
    pub(crate) values: Vec<f64>,
}

impl Column {
    pub(crate) fn new(path: impl Into<String>, values: Vec<f64>) -> Self {
        let path = path.into();
        Self { owner: path.clone(), path, label: None, unit: None, clock: Clock::Unknown, identity: None, values }
    }

    /// The name where the label is not the only one of its kind.
    fn long_name(&self) -> String {
        match &self.label {
            Some(label) if self.owner.is_empty() => label.clone(),
            Some(label) => format!("{}/{label}", self.owner),
            None => self.path.clone(),
        }
    }
}

/// A table of the columns, each with a name of its own.
///
/// # Errors
/// When there is no column; what was left out is then listed.
pub(crate) fn table(format: &str, columns: Vec<Column>, notes: Vec<String>) -> Result<Table, String> {
    if columns.is_empty() {
        let reasons = if notes.is_empty() { String::new() } else { format!(": {}", notes.join("; ")) };
        return Err(format!("holds no column of numbers{reasons}; save each signal as a vector of numbers"));
    }
    let names = names(&columns);
    let by_identity: HashMap<u64, usize> =
        columns.iter().enumerate().rev().filter_map(|(at, column)| Some((column.identity?, at))).collect();
    let axes: Vec<Axis> = columns
        .iter()
        .enumerate()
        .map(|(at, column)| match column.clock {
            Clock::Unknown => Axis::Unknown,
            Clock::Even { start, step } => Axis::Even { start, step },
            Clock::Column(identity) => {
                let clock = by_identity.get(&identity).filter(|clock| **clock != at);
                let clock = clock.filter(|clock| columns[**clock].values.len() == column.values.len());
                clock.map_or(Axis::Unknown, |clock| Axis::Column(*clock))
            }
        })
        .collect();
    let mut table = Table::new(format);
    table.notes = notes;
    for ((column, name), axis) in columns.into_iter().zip(names).zip(axes) {
        let path = Some(column.path).filter(|path| *path != name);
        table.push(Head { unit: column.unit, axis, path, ..Head::new(name) }, column.values);
    }
    Ok(table)
}

/// The label where no other column has it, the label behind its owner's path where that helps, else the path.
fn names(columns: &[Column]) -> Vec<String> {
    fn twice(names: &[String]) -> Vec<bool> {
        let mut count: HashMap<&str, usize> = HashMap::new();
        for name in names {
            *count.entry(name).or_default() += 1;
        }
        names.iter().map(|name| count[name.as_str()] > 1).collect()
    }
    let mut names: Vec<String> = columns.iter().map(|c| c.label.clone().unwrap_or_else(|| c.path.clone())).collect();
    for longer in [Column::long_name, |column: &Column| column.path.clone()] {
        let twice = twice(&names);
        for ((name, column), _) in names.iter_mut().zip(columns).zip(twice).filter(|(_, twice)| *twice) {
            *name = longer(column);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(path: &str, owner: &str, label: Option<&str>) -> Column {
        Column { owner: owner.into(), label: label.map(Into::into), ..Column::new(path, vec![0.0, 1.0]) }
    }

    #[test]
    fn labels_are_names_where_they_are_unique() {
        let columns = [
            column("a[1]", "a", Some("time")),
            column("a[2]", "a", Some("x")),
            column("b[1]", "b", Some("time")),
            column("c", "c", None),
            column("a[3]", "a", Some("y")),
            column("a[4]", "a", Some("y")),
        ];
        assert_eq!(names(&columns), ["a/time", "x", "b/time", "c", "a[3]", "a[4]"]);
    }

    #[test]
    fn clocks_are_found_by_identity() {
        let time = Column { identity: Some(7), ..column("t", "t", None) };
        let signal = Column { clock: Clock::Column(7), ..column("x", "x", None) };
        let lost = Column { clock: Clock::Column(8), ..column("y", "y", None) };
        let table = table("F", vec![signal, time, lost], vec![]).unwrap();
        assert_eq!(
            table.heads.iter().map(|h| h.axis).collect::<Vec<_>>(),
            [Axis::Column(1), Axis::Unknown, Axis::Unknown]
        );
    }

    #[test]
    fn a_file_without_columns_says_why() {
        let message = table("F", vec![], vec!["x is complex".into()]).unwrap_err();
        assert!(message.contains("no column") && message.contains("x is complex"), "{message}");
    }
}
