//! The signals in a tree of MATLAB arrays.
//!
//! Vectors and tables of numbers become columns wherever they are. In the structs of dSPACE ControlDesk, Simulink and
//! `timeseries`, other fields give the name, unit and times of a column.

mod about;
mod matrix;
mod programs;

use std::collections::{HashMap, HashSet};

use super::tree::{Array, Fields, Structs, Value};
use crate::record::source::gather::{Budget, Clock, Column, Part, Rate, TextList, join, step_of};
use about::About;

/// Largest number of notes on arrays that are not read.
const MAX_NOTES: usize = 8;

/// Finds the columns of one file.
pub(crate) struct Layout<'r> {
    budget: &'r mut Budget,
    notes: Vec<String>,
    /// The identity of the next column that others may use as their clock.
    next_identity: u64,
    /// The identities of clocks by a hash of their values.
    clocks: HashMap<u64, u64>,
}

/// The properties of a struct that apply to all its arrays.
#[derive(Clone, Copy)]
struct Scope<'t> {
    /// Path of the struct; empty for the workspace.
    path: &'t str,
    /// The sample period that the struct or an outer struct states.
    rate: Option<Rate>,
}

impl Scope<'_> {
    fn path_of(&self, field: &str) -> String {
        if self.path.is_empty() { field.to_owned() } else { format!("{}.{field}", self.path) }
    }

    fn clock(&self) -> Clock {
        self.rate.map_or(Clock::Unknown, |rate| Clock::Even { start: 0.0, step: rate.step })
    }
}

impl<'r> Layout<'r> {
    pub(crate) fn new(budget: &'r mut Budget) -> Self {
        Self { budget, notes: Vec::new(), next_identity: 0, clocks: HashMap::new() }
    }

    /// Returns notes on arrays that are not read.
    pub(crate) fn notes(self) -> Vec<String> {
        self.notes
    }

    /// Returns the columns of a file with these variables.
    pub(crate) fn file(&mut self, variables: &Structs<'_>) -> Result<Vec<Column>, String> {
        let mut columns = Vec::new();
        for fields in variables.iter() {
            self.fields(Scope { path: "", rate: None }, fields, &mut columns)?;
        }
        Ok(columns)
    }

    /// Adds the columns of one struct.
    fn fields(&mut self, outer: Scope<'_>, fields: Fields<'_, '_>, columns: &mut Vec<Column>) -> Result<(), String> {
        let own =
            fields.iter().filter_map(|(name, value)| step_of(name, value.scalar()?, None)).reduce(Rate::or_better);
        let scope = Scope { rate: own.or(outer.rate), ..outer };
        let done = self.programs(scope, fields, columns)?;
        let (lists, units) = (lists(fields), Units::of(fields));
        let done: HashSet<usize> = done.into_iter().collect();
        for (name, value) in fields.iter().enumerate().filter(|(at, _)| !done.contains(at)).map(|(_, field)| field) {
            let path = scope.path_of(name);
            if value.is_numbers() {
                let about = About { unit: units.of_field(name), lists: &lists, ..About::new(scope.clock()) };
                self.numbers(&path, value, &about, columns)?;
            } else {
                self.array(Scope { path: &path, ..scope }, value, columns)?;
            }
        }
        Ok(())
    }

    /// Adds the columns of an array that is not a numeric field of a struct.
    fn array(&mut self, scope: Scope<'_>, array: &Array<'_>, columns: &mut Vec<Column>) -> Result<(), String> {
        match &array.value {
            Value::Numbers { .. } => self.numbers(scope.path, array, &About::new(scope.clock()), columns),
            Value::Text(_) => Ok(()),
            Value::Cells(cells) => {
                for (k, cell) in cells.iter().enumerate() {
                    let path = format!("{}{{{}}}", scope.path, k + 1);
                    self.array(Scope { path: &path, ..scope }, cell, columns)?;
                }
                Ok(())
            }
            Value::Structs(structs) => self.structs(scope, structs, columns),
            Value::Unread(why) => {
                self.note(format!("\"{}\" {why}", scope.path));
                Ok(())
            }
        }
    }

    /// Adds the columns of a struct or an array of structs.
    fn structs(&mut self, scope: Scope<'_>, structs: &Structs<'_>, columns: &mut Vec<Column>) -> Result<(), String> {
        if let [values] = structs.elements.as_slice() {
            return self.fields(scope, Fields { names: &structs.names, values }, columns);
        }
        // Structs with the same signals are segments that were measured one after the other.
        let mut parts = Vec::with_capacity(structs.elements.len());
        for (k, fields) in structs.iter().enumerate() {
            let path = format!("{}({})", scope.path, k + 1);
            let mut own = Vec::new();
            self.fields(Scope { path: &path, ..scope }, fields, &mut own)?;
            parts.push(Part { number: k as u64 + 1, path, columns: own });
        }
        let named = parts.iter().flat_map(|part| &part.columns).any(|column| column.label.is_some());
        let count = parts.len();
        if named || count == 0 {
            columns.extend(parts.into_iter().flat_map(|part| part.columns));
            return Ok(());
        }
        match join(scope.path, '.', parts) {
            Ok(joined) => {
                self.note(format!("the {count} structs of \"{}\" are read as segments", scope.path));
                columns.extend(joined);
            }
            Err(parts) => columns.extend(parts.into_iter().flat_map(|part| part.columns)),
        }
        Ok(())
    }

    fn note(&mut self, what: String) {
        if self.notes.len() < MAX_NOTES {
            self.notes.push(what);
        }
    }
}

/// Returns the lists of texts among the fields of a struct.
fn lists(fields: Fields<'_, '_>) -> Vec<TextList> {
    fields.iter().filter_map(|(name, value)| Some(TextList { name: name.to_owned(), texts: value.texts()? })).collect()
}

/// The units of the fields of a struct, by name in lower case.
struct Units {
    /// Units in fields such as `voltage_unit`.
    fields: HashMap<String, String>,
    /// Units in a struct `units`, in a field with the name of the signal.
    struct_fields: HashMap<String, String>,
}

impl Units {
    fn of(fields: Fields<'_, '_>) -> Self {
        let texts = |fields: Fields<'_, '_>, endings: &[&str]| {
            let mut texts = HashMap::new();
            for (name, value) in fields.iter() {
                let name = name.to_lowercase();
                if endings.iter().any(|ending| name.ends_with(ending))
                    && let Some(text) = value.text()
                {
                    texts.entry(name).or_insert_with(|| text.to_owned());
                }
            }
            texts
        };
        let units = fields.get(&["units", "unit"]).and_then(|(_, units)| units.structs()?.iter().next());
        Self {
            fields: texts(fields, &["unit", "units"]),
            struct_fields: units.map(|units| texts(units, &[""])).unwrap_or_default(),
        }
    }

    fn of_field(&self, name: &str) -> Option<String> {
        let name = name.to_lowercase();
        let own = || ["_unit", "_units", "unit", "units"].iter().find_map(|e| self.fields.get(&format!("{name}{e}")));
        own().or_else(|| self.struct_fields.get(&name)).cloned()
    }
}
