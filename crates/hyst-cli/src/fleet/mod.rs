//! Diagnoses of many actuators, one row of results each.
//!
//! A row is written to a [`journal`] as soon as its actuator is finished, so that an interrupted fleet continues. The
//! results [`table`] and the HTML [`page`] are made from the journal. Memory: a few hundred bytes for each actuator.

pub mod entries;
pub mod journal;
pub mod one;
pub mod page;
mod row;
pub mod table;

use std::path::{Path, PathBuf};

pub use row::{Entry, Found, NamedEffect, Options, Parameter, Row};

/// Returns the path of the journal of a results file.
pub fn journal_of(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".journal");
    name.into()
}

/// Returns the actuators that are not finished or whose files have changed.
/// `watch` receives the number of checked actuators.
pub fn due(
    entries: &[Entry],
    journal: &journal::Journal,
    options: &Options,
    watch: &mut dyn FnMut(usize),
) -> Vec<Entry> {
    let (mut due, fingerprint, reports) = (Vec::new(), options.fingerprint(), options.reports.is_some());
    for (k, entry) in entries.iter().enumerate() {
        watch(k);
        if !journal.has(entry, one::sum_of(entry).as_deref(), &fingerprint, reports) {
            due.push(entry.clone());
        }
    }
    due
}
