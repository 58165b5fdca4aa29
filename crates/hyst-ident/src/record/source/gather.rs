//! Common code of MATLAB and HDF5: conversion of a tree of arrays to a table.
//!
//! It gives columns unique names, finds shared times and names of matrix columns, joins groups as segments, and limits
//! the memory.

mod lists;
mod rates;
mod segments;

use std::collections::HashMap;

use super::{Axis, Head, Table};
pub(crate) use lists::{TextList, of_matrix};
pub(crate) use rates::{Rate, step_of};
pub(crate) use segments::{Part, join, number_of};

/// Size up to which a file may always expand \[bytes\].
const ALWAYS_UNPACKED: u64 = 64 << 20;
/// Largest ratio of the expanded size to the size of larger files.
const MAX_EXPANSION: u64 = 200;

/// The memory that the arrays of a file may still take \[bytes\].
#[derive(Debug)]
pub(crate) struct Budget(u64);

impl Budget {
    /// Returns the limit of a file of this size.
    pub(crate) fn of(file_bytes: usize) -> Self {
        Self(ALWAYS_UNPACKED.max(MAX_EXPANSION.saturating_mul(file_bytes as u64)))
    }

    /// Returns the remaining memory \[bytes\].
    pub(crate) fn remaining(&self) -> u64 {
        self.0
    }

    /// Reserves `bytes`. The error is the message if the limit is exceeded.
    pub(crate) fn take(&mut self, bytes: u64) -> Result<(), String> {
        self.0 = self.0.checked_sub(bytes).ok_or_else(Self::exceeded)?;
        Ok(())
    }

    /// Returns the message for a file that exceeds the limit.
    pub(crate) fn exceeded() -> String {
        format!(
            "expands to more than {MAX_EXPANSION} times the size of the file, which measured data do not; export only the needed columns, as CSV"
        )
    }
}

/// The times of the rows of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clock {
    Unknown,
    /// Even times \[s\].
    Even {
        start: f64,
        step: f64,
    },
    /// The column with this identity.
    Column(u64),
}

/// A column and its metadata.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    /// The place in the file: `/run/data[2]`, `rig.run.voltage`.
    pub(crate) path: String,
    /// The array, struct or group that the label belongs to: `/run/data`.
    pub(crate) owner: String,
    /// The name that the file gives to the column, if it differs from the place.
    pub(crate) label: Option<String>,
    pub(crate) unit: Option<String>,
    pub(crate) clock: Clock,
    /// The identity with which other columns refer to this one as their clock.
    pub(crate) identity: Option<u64>,
    pub(crate) values: Vec<f64>,
}

impl Column {
    pub(crate) fn new(path: impl Into<String>, values: Vec<f64>) -> Self {
        let path = path.into();
        Self { owner: path.clone(), path, label: None, unit: None, clock: Clock::Unknown, identity: None, values }
    }

    /// Returns the name that is used if the label is not unique.
    fn long_name(&self) -> String {
        match &self.label {
            Some(label) if self.owner.is_empty() => label.clone(),
            Some(label) => format!("{}/{label}", self.owner),
            None => self.path.clone(),
        }
    }
}

/// Makes a table of the columns, with unique names.
///
/// # Errors
/// If there is no column. The message lists `notes`.
pub(crate) fn table(format: &str, columns: Vec<Column>, notes: Vec<String>) -> Result<Table, String> {
    if columns.is_empty() {
        let reasons = if notes.is_empty() { String::new() } else { format!(": {}", notes.join("; ")) };
        return Err(format!("no column of numbers was found{reasons}; save each signal as a vector of numbers"));
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

/// Returns unique names: the label if it is unique, else the path of the owner and the label, else the path.
fn names(columns: &[Column]) -> Vec<String> {
    fn repeated(names: &[String]) -> Vec<bool> {
        let mut count: HashMap<&str, usize> = HashMap::new();
        for name in names {
            *count.entry(name).or_default() += 1;
        }
        names.iter().map(|name| count[name.as_str()] > 1).collect()
    }
    let mut names: Vec<String> = columns.iter().map(|c| c.label.clone().unwrap_or_else(|| c.path.clone())).collect();
    for longer in [Column::long_name, |column: &Column| column.path.clone()] {
        let repeated = repeated(&names);
        for ((name, column), _) in names.iter_mut().zip(columns).zip(repeated).filter(|(_, repeated)| *repeated) {
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
    fn unique_labels_are_used_as_names() {
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
    fn a_file_without_columns_is_refused_with_the_reason() {
        let message = table("F", vec![], vec!["x is complex".into()]).unwrap_err();
        assert!(message.contains("no column") && message.contains("x is complex"), "{message}");
    }
}
