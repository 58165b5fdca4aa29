//! Fleets (`hyst_cli::fleet`) for `python/hyst/fleet.py`: rows and their journal. What goes to and fro is JSON, as tasks on other machines need it.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::Sender;

use hyst_cli::fleet::journal::Journal;
use hyst_cli::fleet::{self, Entry, Options, Row, entries, one, page, table};
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::stop::Stop;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::errors;
use crate::interrupt::interruptible;

fn of_json<T: DeserializeOwned>(text: &str) -> PyResult<T> {
    serde_json::from_str(text).map_err(|error| PyValueError::new_err(error.to_string()))
}

fn json(value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| PyValueError::new_err(error.to_string()))
}

fn all_of(texts: &[String]) -> PyResult<Vec<Entry>> {
    texts.iter().map(|text| of_json(text)).collect()
}

/// The actuators of a folder or a list, as JSON.
#[pyfunction]
pub(crate) fn _fleet_entries(path: PathBuf) -> PyResult<Vec<String>> {
    entries::of(&path).map_err(PyValueError::new_err)?.iter().map(json).collect()
}

/// Fits and diagnoses one actuator on one thread: its row as JSON.
#[pyfunction]
pub(crate) fn _fleet_row(py: Python<'_>, entry: &str, options: &str, reports: Option<PathBuf>) -> PyResult<String> {
    let entry: Entry = of_json(entry)?;
    let options = Options { reports, ..of_json(options)? };
    let work = |stop: &Arc<AtomicBool>, _: Sender<()>| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().ok()?;
        pool.install(|| one::row(&entry, &options, &Stop::from(Arc::clone(stop))))
    };
    let row = interruptible(py, work, |_, ()| Ok(()))?;
    json(&row.ok_or_else(|| PyOSError::new_err("no thread could be started"))?)
}

/// The journal of a table of results.
#[pyclass(module = "hyst")]
pub(crate) struct _FleetJournal {
    journal: Journal,
    place: PathBuf,
}

#[pymethods]
impl _FleetJournal {
    /// Opens the journal of the table ``output``, or begins it.
    #[new]
    fn new(output: PathBuf) -> PyResult<Self> {
        let place = fleet::journal_of(&output);
        let wrong = |error: std::io::Error| PyOSError::new_err(format!("{}: {error}", place.display()));
        Ok(Self { journal: Journal::open(&place).map_err(wrong)?, place })
    }

    /// Those that are not done yet, or whose files have changed since.
    fn due(&self, py: Python<'_>, entries: Vec<String>, options: &str) -> PyResult<Vec<String>> {
        let (entries, options) = (all_of(&entries)?, of_json::<Options>(options)?);
        let due = py.detach(|| fleet::due(&entries, &self.journal, &options.fingerprint(), &mut |_| {}));
        due.iter().map(json).collect()
    }

    /// Adds a row.
    fn add(&mut self, row: &str) -> PyResult<()> {
        let row: Row = of_json(row)?;
        self.journal.add(&row).map_err(|error| PyOSError::new_err(format!("{}: {error}", self.place.display())))
    }

    /// How many are done, and how many of these failed.
    fn count(&self, entries: Vec<String>) -> PyResult<(usize, usize)> {
        Ok(self.journal.count(&all_of(&entries)?))
    }

    /// Writes the table.
    fn write(&self, py: Python<'_>, entries: Vec<String>, output: PathBuf) -> PyResult<()> {
        let entries = all_of(&entries)?;
        py.detach(|| write_atomic(&output, |out| table::write(out, &self.journal, &entries))).map_err(errors::written)
    }

    /// The page.
    fn page(&self, py: Python<'_>, entries: Vec<String>, title: &str) -> PyResult<String> {
        let entries = all_of(&entries)?;
        Ok(py.detach(|| page::page(title, &self.journal, &entries))?)
    }

    /// The rows, as JSON.
    fn rows(&self, entries: Vec<String>) -> PyResult<Vec<String>> {
        let entries = all_of(&entries)?;
        self.journal.rows(&entries)?.map(|row| json(&row?)).collect()
    }
}
