//! Fleets (`hyst_cli::fleet`) for `python/hyst/fleet.py`: rows and their journal. What goes to and fro is JSON, as tasks on other machines need it.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hyst_cli::fleet::journal::Journal;
use hyst_cli::fleet::{self, Entry, Options, Row, entries, one, page, table};
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::stop::Stop;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::errors;

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
pub(crate) fn _fleet_entries(path: PathBuf, output: PathBuf) -> PyResult<Vec<String>> {
    entries::of(&path, &output).map_err(PyValueError::new_err)?.iter().map(json).collect()
}

/// Refuses options that no actuator could be done with.
#[pyfunction]
pub(crate) fn _fleet_check(options: &str) -> PyResult<()> {
    of_json::<Options>(options)?.check().map_err(PyValueError::new_err)
}

/// What ends rows that are being computed.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct _Stop(Arc<AtomicBool>);

#[pymethods]
impl _Stop {
    #[new]
    fn new() -> Self {
        Self(Arc::default())
    }

    fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Fits and diagnoses one actuator on one thread: its row as JSON; ``None`` where it was stopped.
#[pyfunction]
#[pyo3(signature = (entry, options, reports, stop=None))]
pub(crate) fn _fleet_row(
    py: Python<'_>,
    entry: &str,
    options: &str,
    reports: Option<PathBuf>,
    stop: Option<&Bound<'_, _Stop>>,
) -> PyResult<Option<String>> {
    let entry: Entry = of_json(entry)?;
    let options = Options { reports, ..of_json(options)? };
    let stop = stop.map_or_else(Stop::default, |stop| Stop::from(Arc::clone(&stop.get().0)));
    let work = || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        Ok::<_, rayon::ThreadPoolBuildError>(pool.install(|| one::row(&entry, &options, &stop)))
    };
    let row = py.detach(work).map_err(|error| PyOSError::new_err(error.to_string()))?;
    row.as_ref().map(json).transpose()
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
    #[pyo3(signature = (output, *, read_only=false))]
    fn new(output: PathBuf, read_only: bool) -> PyResult<Self> {
        let place = fleet::journal_of(&output);
        let wrong = |error: std::io::Error| PyOSError::new_err(format!("{}: {error}", place.display()));
        let journal = if read_only { Journal::read(&place) } else { Journal::open(&place) };
        Ok(Self { journal: journal.map_err(wrong)?, place })
    }

    /// Those that are not done yet, or whose files have changed since, or that have no report where ``reports`` are wanted.
    fn due(&self, py: Python<'_>, entries: Vec<String>, options: &str, reports: bool) -> PyResult<Vec<String>> {
        let (entries, options) = (all_of(&entries)?, of_json::<Options>(options)?);
        let options = Options { reports: reports.then(PathBuf::new), ..options };
        // A look at a hundred files at a time, so that Ctrl-C is seen.
        let mut due = Vec::new();
        for some in entries.chunks(100) {
            due.extend(py.detach(|| fleet::due(some, &self.journal, &options, &mut |_| {})));
            py.check_signals()?;
        }
        due.iter().map(json).collect()
    }

    /// Adds a row.
    fn add(&mut self, row: &str) -> PyResult<()> {
        let row: Row = of_json(row)?;
        self.journal.add(&row).map_err(|error| PyOSError::new_err(format!("{}: {error}", self.place.display())))
    }

    /// Lets others add to it.
    fn unlock(&self) -> PyResult<()> {
        Ok(self.journal.unlock()?)
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
        self.journal.rows(&entries)?.map(|row| json(&row?.1)).collect()
    }
}
