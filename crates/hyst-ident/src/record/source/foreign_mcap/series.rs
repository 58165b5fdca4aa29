//! The numbers of one topic: one row per message, one column per field.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;

use super::budget::Budget;

/// Largest number of columns of one topic. Further fields are not read.
const MAX_COLUMNS: usize = 1024;
/// Largest length of an array that is read as columns. Longer arrays are images and point clouds.
const MAX_ELEMENTS: usize = 256;
/// Longest path of a field \[bytes\]. Fields with longer paths are not read.
const MAX_PATH: usize = 256;
/// Memory of a column in addition to its values \[values\].
const COLUMN_COST: usize = 32;

/// A numeric field.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    /// The name after that of the topic, such as `.state.value` or `.data[2]`.
    pub(crate) path: String,
    pub(crate) unit: Option<String>,
    /// The values. They may have fewer rows than the topic until [`Series::complete`].
    pub(crate) values: Vec<f64>,
}

/// The lengths of an array in all messages.
#[derive(Clone, Copy, Debug)]
struct Lengths {
    shortest: usize,
    longest: usize,
}

impl Lengths {
    fn is_fixed(self) -> bool {
        self.shortest == self.longest && self.longest <= MAX_ELEMENTS
    }
}

/// The numbers of one topic. A decoder reports the path and value of every number of a message.
#[derive(Debug)]
pub(crate) struct Series {
    pub(crate) topic: String,
    pub(crate) columns: Vec<Column>,
    /// The log time of each message \[ns\].
    pub(crate) logged: Vec<u64>,
    /// Number of messages that cannot be read.
    pub(crate) unread: usize,
    /// The fault of the first of them.
    pub(crate) fault: Option<String>,
    arrays: BTreeMap<String, Lengths>,
    by_path: HashMap<String, usize>,
    /// Number of columns before the current message.
    before: usize,
    /// The expected column of the next number: fields have the same order in each message.
    next: usize,
    path: String,
    /// Whether fields exceed the limits.
    has_more: bool,
    budget: Budget,
}

impl Series {
    pub(crate) fn new(topic: String, budget: Budget) -> Self {
        Self {
            topic,
            columns: Vec::new(),
            logged: Vec::new(),
            unread: 0,
            fault: None,
            arrays: BTreeMap::new(),
            by_path: HashMap::new(),
            before: 0,
            next: 0,
            path: String::new(),
            has_more: false,
            budget,
        }
    }

    pub(crate) fn rows(&self) -> usize {
        self.logged.len()
    }

    /// Begins a message.
    pub(crate) fn begin(&mut self) {
        (self.before, self.next) = (self.columns.len(), 0);
        self.path.clear();
    }

    /// Ends a message that was read completely.
    pub(crate) fn keep(&mut self, logged: u64) {
        self.logged.push(logged);
    }

    /// Removes the numbers of a message that was not read completely.
    pub(crate) fn discard(&mut self) {
        for column in self.columns.drain(self.before..) {
            self.by_path.remove(&column.path);
        }
        let rows = self.logged.len();
        self.columns.iter_mut().for_each(|column| column.values.truncate(rows));
    }

    /// Counts a message that cannot be read.
    pub(crate) fn miss(&mut self, fault: String) {
        self.unread += 1;
        self.fault.get_or_insert(fault);
    }

    /// Enters a field. Returns the value for [`leave`](Self::leave).
    pub(crate) fn enter(&mut self, field: &str) -> usize {
        let back = self.path.len();
        self.path.push('.');
        self.path.push_str(field);
        back
    }

    /// Enters an element of an array, counted from 0. Returns the value for [`leave`](Self::leave).
    pub(crate) fn enter_element(&mut self, index: usize) -> usize {
        let back = self.path.len();
        // Writing to a String does not fail.
        let _ = write!(self.path, "[{}]", index + 1);
        back
    }

    /// Leaves a field or an element.
    pub(crate) fn leave(&mut self, back: usize) {
        self.path.truncate(back);
    }

    /// Reports the length of the array at the current path. Returns whether its values are wanted.
    pub(crate) fn array(&mut self, length: usize) -> bool {
        if let Some(lengths) = self.arrays.get_mut(&self.path) {
            lengths.shortest = lengths.shortest.min(length);
            lengths.longest = lengths.longest.max(length);
            return lengths.is_fixed();
        }
        let lengths = Lengths { shortest: length, longest: length };
        if self.path.len() <= MAX_PATH && self.arrays.len() < MAX_COLUMNS {
            self.arrays.insert(self.path.clone(), lengths);
            return lengths.is_fixed();
        }
        self.has_more = true;
        false
    }

    /// Returns the number of wanted elements of the array at the current path, whose length is not known yet.
    pub(crate) fn wanted_elements(&self) -> usize {
        if self.arrays.get(&self.path).is_none_or(|lengths| lengths.is_fixed()) { MAX_ELEMENTS } else { 0 }
    }

    /// Reports the number at the current path.
    pub(crate) fn number(&mut self, value: f64) {
        let Some(at) = self.column() else {
            self.has_more = true;
            return;
        };
        self.next = at + 1;
        let (row, column) = (self.logged.len(), &mut self.columns[at].values);
        if column.len() > row {
            // If a field occurs twice in a message, the last value applies.
            column[row] = value;
        } else if self.budget.take(row + 1 - column.len()) {
            column.resize(row, f64::NAN);
            column.push(value);
        }
    }

    /// Returns the column of the current path; `None` if there are too many columns.
    fn column(&mut self) -> Option<usize> {
        if self.columns.get(self.next).is_some_and(|column| column.path == self.path) {
            return Some(self.next);
        }
        if let Some(at) = self.by_path.get(&self.path) {
            return Some(*at);
        }
        if self.path.len() > MAX_PATH || self.columns.len() >= MAX_COLUMNS || !self.budget.take(COLUMN_COST) {
            return None;
        }
        let at = self.columns.len();
        self.by_path.insert(self.path.clone(), at);
        self.columns.push(Column { path: self.path.clone(), unit: None, values: Vec::new() });
        Some(at)
    }

    /// Sorts the rows by log time. The order in the file may differ.
    pub(crate) fn sort(&mut self) {
        if self.logged.is_sorted() {
            return;
        }
        let mut order: Vec<usize> = (0..self.rows()).collect();
        order.sort_by_key(|row| self.logged[*row]);
        self.logged = order.iter().map(|row| self.logged[*row]).collect();
        for column in &mut self.columns {
            let sorted = order.iter().map(|row| column.values.get(*row).copied().unwrap_or(f64::NAN));
            column.values = sorted.collect();
        }
    }

    /// Extends every column to all rows and removes arrays whose length changes.
    ///
    /// # Errors
    /// If this needs too much memory, for example because fields have another name in each message.
    pub(crate) fn complete(&mut self) -> Result<(), String> {
        let uneven: Vec<String> = self.uneven().map(|(path, _)| format!("{path}[")).collect();
        self.columns.retain(|column| !uneven.iter().any(|path| column.path.starts_with(path)));
        let rows = self.logged.len();
        let missing = self.columns.iter().map(|column| rows - column.values.len()).sum();
        if !self.budget.take(missing) {
            let topic = &self.topic;
            return Err(format!(
                "the messages of {topic} have too many different fields; log a topic with fixed fields"
            ));
        }
        for column in &mut self.columns {
            column.values.resize(rows, f64::NAN);
            column.values.shrink_to_fit();
        }
        Ok(())
    }

    fn uneven(&self) -> impl Iterator<Item = (&String, Lengths)> {
        self.arrays.iter().map(|(path, lengths)| (path, *lengths)).filter(|(_, lengths)| !lengths.is_fixed())
    }

    /// Removes and returns the column of a field; `None` if no column has a value in each row.
    pub(crate) fn take(&mut self, path: &str) -> Option<Vec<f64>> {
        let at = self.whole(path)?;
        Some(self.columns.remove(at).values)
    }

    /// Returns the number of the column of a field, if it has a value in each row.
    pub(crate) fn whole(&self, path: &str) -> Option<usize> {
        let at = self.columns.iter().position(|column| column.path == path)?;
        let values = &self.columns[at].values;
        (values.len() == self.rows() && !values.iter().any(|value| value.is_nan())).then_some(at)
    }

    /// Sets the units. `units` are by path, with `[]` for every index.
    pub(crate) fn set_units(&mut self, units: &HashMap<String, String>) {
        for column in &mut self.columns {
            column.unit = units.get(&any_index(&column.path)).cloned();
        }
    }

    /// Returns notes on what is not read.
    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let (topic, unread) = (&self.topic, self.unread);
        if let Some(fault) = self.fault.as_ref().filter(|_| self.rows() > 0) {
            let messages = if unread == 1 { "message is" } else { "messages are" };
            notes.push(format!("{topic}: {unread} {messages} not readable and left out ({fault})"));
        }
        let arrays: Vec<String> = self
            .uneven()
            .map(|(path, of)| match of {
                Lengths { shortest, longest } if shortest == longest => format!("{topic}{path} ({longest} values)"),
                Lengths { shortest, longest } => format!("{topic}{path} ({shortest} to {longest} values)"),
            })
            .collect();
        if !arrays.is_empty() {
            notes.push(format!(
                "arrays of changing length or more than {MAX_ELEMENTS} values are left out: {}",
                super::words::listed(&arrays)
            ));
        }
        if self.has_more {
            notes.push(format!(
                "{topic}: only the first {MAX_COLUMNS} fields with names up to {MAX_PATH} bytes are read"
            ));
        }
        notes
    }

    /// Returns why the topic gives no column.
    pub(crate) fn why_unused(&self) -> String {
        match (&self.fault, self.rows()) {
            (Some(fault), 0) => format!("{} messages cannot be read: {fault}", self.unread),
            (_, 0 | 1) => format!("{} message", self.rows()),
            (_, rows) => format!("{rows} messages without numbers"),
        }
    }
}

/// Returns the path with `[]` for every index.
fn any_index(path: &str) -> String {
    let mut any = String::new();
    for (k, part) in path.split('[').enumerate() {
        let index = part.split_once(']').filter(|(index, _)| k > 0 && index.bytes().all(|byte| byte.is_ascii_digit()));
        match index {
            Some((_, rest)) => any.extend(["[]", rest]),
            None if k == 0 => any.push_str(part),
            None => any.extend(["[", part]),
        }
    }
    any
}
