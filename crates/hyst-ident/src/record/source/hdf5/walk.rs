//! The columns of an HDF5 file: every vector and table of numbers in every group.

mod dataset;
mod instants;

use std::collections::HashSet;

use hdf5_reader::dataset::Dataset;
use hdf5_reader::group::Group;

use super::attributes::Attributes;
use super::filters::{innermost, unreadable};
use super::values;
use crate::record::source::gather::{Budget, Clock, Column, Part, Rate, TextList, join, number_of, step_of};

/// Deepest nesting of groups.
const MAX_DEPTH: u32 = 32;
/// Largest number of groups and datasets of a file.
const MAX_OBJECTS: usize = 100_000;
/// Largest number of notes on datasets that are not read.
const MAX_NOTES: usize = 8;
const UNITS: [&str; 2] = ["units", "unit"];

/// Finds the columns of one file.
pub(super) struct Walk<'r> {
    budget: &'r mut Budget,
    notes: Vec<String>,
    /// Addresses of the groups that were read. A link may refer to one of them again.
    seen: HashSet<u64>,
    objects: usize,
}

/// The properties of a group that apply to all its datasets.
struct Scope {
    clock: Clock,
    /// Lists that may name the columns of a table.
    lists: Vec<TextList>,
}

impl<'r> Walk<'r> {
    pub(super) fn new(budget: &'r mut Budget) -> Self {
        Self { budget, notes: Vec::new(), seen: HashSet::new(), objects: 0 }
    }

    /// Returns notes on datasets that are not read.
    pub(super) fn notes(self) -> Vec<String> {
        self.notes
    }

    /// Returns all columns of a file.
    pub(super) fn file(&mut self, root: &Group) -> Result<Vec<Column>, String> {
        let mut columns = Vec::new();
        self.group("", root, MAX_DEPTH, None, &mut columns)?;
        Ok(columns)
    }

    fn group(
        &mut self,
        path: &str,
        group: &Group,
        depth: u32,
        outer: Option<Rate>,
        columns: &mut Vec<Column>,
    ) -> Result<(), String> {
        if !self.seen.insert(group.address()) {
            return Ok(());
        }
        let shown = if path.is_empty() { "/" } else { path };
        let (groups, names) = group.member_names().map_err(|error| unreadable(shown, &error))?;
        self.objects += groups.len() + names.len();
        if self.objects > MAX_OBJECTS {
            return Err(format!("more than {MAX_OBJECTS} groups and datasets; write only the signals to a file"));
        }
        let mut datasets = Vec::with_capacity(names.len());
        for name in names {
            let path = format!("{path}/{name}");
            match group.dataset(&name) {
                Ok(dataset) => datasets.push((name, path, dataset)),
                Err(error) if innermost(&error).to_string().starts_with("unsupported") => {
                    self.note(format!("dataset {path} is not read ({})", innermost(&error)));
                }
                Err(error) => return Err(unreadable(&path, &error)),
            }
        }
        let (scope, rate) = self.scope(&Attributes::of_group(group), &datasets, outer)?;
        for (_, path, dataset) in &datasets {
            self.dataset(path, dataset, &scope, columns)?;
        }
        drop(datasets);
        if groups.is_empty() {
            return Ok(());
        }
        let depth = depth.checked_sub(1).ok_or_else(|| {
            let start: String = path.chars().take(40).collect();
            format!("groups are nested more than {MAX_DEPTH} deep in {start}…; write the signals closer to the root")
        })?;
        let mut inner = Vec::with_capacity(groups.len());
        for name in groups {
            let path = format!("{path}/{name}");
            let mut own = Vec::new();
            match group.group(&name) {
                Ok(group) => self.group(&path, &group, depth, rate, &mut own)?,
                Err(error) => return Err(unreadable(&path, &error)),
            }
            inner.push((name, own));
        }
        self.join(path, inner, columns);
        Ok(())
    }

    /// Returns the properties of a group from its attributes, single numbers and lists of texts, and its sample rate.
    fn scope(
        &mut self,
        attributes: &Attributes,
        datasets: &[(String, String, Dataset)],
        outer: Option<Rate>,
    ) -> Result<(Scope, Option<Rate>), String> {
        let mut own =
            attributes.numbers().filter_map(|(name, value)| step_of(name, value, None)).reduce(Rate::or_better);
        let mut lists = Vec::new();
        for (name, path, dataset) in datasets {
            if let (Some(storage), Ok(1)) = (values::storage(dataset.dtype()), dataset.num_elements()) {
                // Only numbers with the name of a rate or period are read.
                if step_of(name, 1.0, None).is_some() {
                    let value = storage
                        .all(&values::bytes(path, dataset, 1, self.budget)?)
                        .first()
                        .copied()
                        .unwrap_or(f64::NAN);
                    let unit = Attributes::of_dataset(dataset).text(&UNITS);
                    let rate = step_of(name, value, unit.as_deref());
                    own = own.into_iter().chain(rate).reduce(Rate::or_better);
                }
            } else if let Some(texts) = values::texts(dataset, self.budget) {
                lists.push(TextList { name: name.clone(), texts });
            }
        }
        for name in ["names", "columns", "column_names", "units"] {
            lists.extend(attributes.texts(&[name]).map(|texts| TextList { name: name.to_owned(), texts }));
        }
        let rate = own.or(outer);
        let clock = rate.map_or(Clock::Unknown, |rate| Clock::Even { start: 0.0, step: rate.step });
        Ok((Scope { clock, lists }, rate))
    }

    /// Adds the columns of groups. Groups whose names differ only in a number are joined as segments.
    fn join(&mut self, path: &str, groups: Vec<(String, Vec<Column>)>, columns: &mut Vec<Column>) {
        let mut families: Vec<(String, Vec<(String, Part)>)> = Vec::new();
        for (name, own) in groups {
            let part = |number: u64, columns| Part { number, path: format!("{path}/{name}"), columns };
            match number_of(&name).filter(|_| !own.is_empty()) {
                Some((stem, number)) => {
                    let part = (name.clone(), part(number, own));
                    match families.iter_mut().find(|(other, _)| other == stem) {
                        Some((_, parts)) => parts.push(part),
                        None => families.push((stem.to_owned(), vec![part])),
                    }
                }
                None => columns.extend(own),
            }
        }
        for (stem, mut parts) in families {
            parts.sort_by_key(|(_, part)| part.number);
            let (first, last) = (parts[0].0.clone(), parts[parts.len() - 1].0.clone());
            let count = parts.len();
            let stem = if stem.is_empty() { path.to_owned() } else { format!("{path}/{stem}") };
            match join(&stem, '/', parts.into_iter().map(|(_, part)| part).collect()) {
                Ok(joined) => {
                    self.note(format!("{count} groups ({path}/{first} to {path}/{last}) are read as segments"));
                    columns.extend(joined);
                }
                Err(parts) => columns.extend(parts.into_iter().flat_map(|part| part.columns)),
            }
        }
    }

    fn note(&mut self, what: String) {
        if self.notes.len() < MAX_NOTES {
            self.notes.push(what);
        }
    }
}
