//! Diagnoses of many actuators: one row each, whatever their number.
//!
//! A row is written to a journal as soon as its actuator is done, so that what is done is never done again ([`journal`]). The table of all
//! rows is made from the journal ([`table`]), and a page that shows them together ([`page`]). In memory there are some hundred bytes for each actuator.

pub mod entries;
pub mod journal;
pub mod one;
pub mod page;
pub mod table;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hyst_ident::record::ColumnMap;
use serde::{Deserialize, Serialize};

/// An actuator of the fleet.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// The file of its record, as it was given: the name of its row.
    pub file: String,
    /// Another record, on which errors are shown; it is never fitted.
    #[serde(default)]
    pub test: Option<String>,
    /// Its serial number.
    #[serde(default)]
    pub serial: Option<String>,
    /// When it was measured, as the list says it.
    #[serde(default)]
    pub date: Option<String>,
}

/// What is done with each actuator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Kind of the model that is fitted; `auto` takes pi or preisach.
    pub model: String,
    /// Whether each file has a sensor zero of its own.
    pub zero_per_record: bool,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Columns, as `--map` names them.
    pub map: Vec<String>,
    /// Sample rate of files without times \[Hz\].
    pub rate: Option<f64>,
    /// Folder for a report of each actuator.
    #[serde(skip)]
    pub reports: Option<PathBuf>,
}

impl Options {
    /// Refuses what no actuator could be done with.
    ///
    /// # Errors
    /// In words.
    pub fn check(&self) -> Result<(), String> {
        crate::commands::diagnose::kind_of(&self.model).map_err(|error| error.text())?;
        ColumnMap::parse(&self.map).map(|_| ()).map_err(|error| error.to_string())
    }

    /// What a row depends on besides its files. Rows of other options are done anew.
    pub fn fingerprint(&self) -> String {
        // A structure of numbers and texts has JSON.
        format!("{} {}", env!("CARGO_PKG_VERSION"), serde_json::to_string(self).unwrap_or_default())
    }
}

/// A parameter of an effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its value.
    pub value: f64,
    /// Its standard error, where it was estimated.
    pub std_error: Option<f64>,
    /// Its unit.
    pub unit: String,
}

/// An effect that was named.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedEffect {
    /// Its name.
    pub name: String,
    /// Probability that the name is right.
    pub probability: f64,
    /// Its parameters.
    pub parameters: BTreeMap<String, Parameter>,
}

/// What a diagnosis has found of an actuator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Rows of its record.
    pub rows: usize,
    /// Kind of the model that was fitted.
    pub model: String,
    /// Unit of the errors.
    pub unit: String,
    /// `explained`, `nothing-missing`, `base-too-coarse` or `unexplained`.
    pub verdict: String,
    /// White noise of the output, standard deviation \[unit\].
    pub noise: f64,
    /// Errors of the model on its record before and after its extension \[unit\].
    pub rmse_before: Option<f64>,
    /// After it.
    pub rmse_after: Option<f64>,
    /// The same on the test record, where there is one.
    pub test_rmse_before: Option<f64>,
    /// After it.
    pub test_rmse_after: Option<f64>,
    /// What was named.
    pub effects: Vec<NamedEffect>,
    /// What may be there, with its probability.
    pub suspects: BTreeMap<String, f64>,
    /// The report, if one was written.
    pub report: Option<String>,
    /// Why none was, where one was wanted.
    #[serde(default)]
    pub report_error: Option<String>,
}

/// One actuator's row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The actuator.
    #[serde(flatten)]
    pub entry: Entry,
    /// SHA-256 of its files, in hexadecimal digits; none where one could not be read.
    pub sha256: Option<String>,
    /// What it depends on besides ([`Options::fingerprint`]).
    pub options: String,
    /// How long it took \[s\]: the one number that differs from run to run.
    pub took_s: f64,
    /// What was found, or why nothing could be.
    pub outcome: Result<Found, String>,
}

/// The journal beside a table of results.
pub fn journal_of(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".journal");
    name.into()
}

/// The actuators that are not done yet, or whose files have changed since; `watch` is given how many files were looked at.
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
