//! The signals in a tree of MATLAB arrays, however a program laid them out.
//!
//! Vectors and tables of numbers become columns wherever they are. Structs that dSPACE ControlDesk, Simulink and `timeseries` write are
//! known: there a column gets its name, its unit and its times from fields beside it.

mod matrix;
mod programs;

use std::collections::{HashMap, HashSet};

use super::tree::{Array, Fields, Structs, Value};
use crate::record::source::gather::{Clock, Column, Part, Rate, Room, TextList, join, step_of};
use matrix::About;

/// Reasons that are listed for arrays that are not read.
const MOST_NOTES: usize = 8;

/// Finds columns; one for a file.
pub(crate) struct Layout<'r> {
    room: &'r mut Room,
    notes: Vec<String>,
    /// The identity of the next column that others may name as their clock.
    next_identity: u64,
    /// Clocks by a hash of their values.
    clocks: HashMap<u64, u64>,
}

/// What holds for all arrays of a struct.
#[derive(Clone, Copy)]
struct Scope<'t> {
    /// Path of the struct; empty for the workspace.
    path: &'t str,
    /// The sample period that it, or a struct around it, states.
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
    pub(crate) fn new(room: &'r mut Room) -> Self {
        Self { room, notes: Vec::new(), next_identity: 0, clocks: HashMap::new() }
    }

    /// What was left out, and why.
    pub(crate) fn notes(self) -> Vec<String> {
        self.notes
    }

    /// The columns of a file with these variables.
    pub(crate) fn file(&mut self, variables: &Structs<'_>) -> Result<Vec<Column>, String> {
        let mut columns = Vec::new();
        for fields in variables.iter() {
            self.fields(Scope { path: "", rate: None }, fields, &mut columns)?;
        }
        Ok(columns)
    }

    /// Columns of one struct.
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

    /// Columns of an array that is not numbers of a struct.
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

    /// Columns of a struct or an array of them.
    fn structs(&mut self, scope: Scope<'_>, structs: &Structs<'_>, columns: &mut Vec<Column>) -> Result<(), String> {
        if let [values] = structs.elements.as_slice() {
            return self.fields(scope, Fields { names: &structs.names, values }, columns);
        }
        // Structs of the same signals are segments, as measured one after the other.
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
        if self.notes.len() < MOST_NOTES {
            self.notes.push(what);
        }
    }
}

/// Lists of texts among the fields of a struct.
fn lists(fields: Fields<'_, '_>) -> Vec<TextList> {
    fields.iter().filter_map(|(name, value)| Some(TextList { name: name.to_owned(), texts: value.texts()? })).collect()
}

/// The units that a struct states of its fields, by their names in small letters: in a field `voltage_unit`, or in the struct `units` under the same
/// name.
struct Units {
    beside: HashMap<String, String>,
    inside: HashMap<String, String>,
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
        let inside = fields.get(&["units", "unit"]).and_then(|(_, units)| units.structs()?.iter().next());
        Self {
            beside: texts(fields, &["unit", "units"]),
            inside: inside.map(|units| texts(units, &[""])).unwrap_or_default(),
        }
    }

    fn of_field(&self, name: &str) -> Option<String> {
        let name = name.to_lowercase();
        let beside =
            || ["_unit", "_units", "unit", "units"].iter().find_map(|e| self.beside.get(&format!("{name}{e}")));
        beside().or_else(|| self.inside.get(&name)).cloned()
    }
}
