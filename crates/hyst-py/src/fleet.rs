//! Fleets (`hyst_cli::fleet`) for `python/hyst/fleet.py`: rows and their journal. Data are passed as JSON, because
//! tasks may run on other machines.

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

/// Returns the actuators of a folder or a list, as JSON.
#[pyfunction]
pub(crate) fn _fleet_entries(path: PathBuf, output: PathBuf) -> PyResult<Vec<String>> {
    entries::of(&path, &output).map_err(PyValueError::new_err)?.iter().map(json).collect()
}

/// Rejects invalid options.
#[pyfunction]
pub(crate) fn _fleet_check(options: &str) -> PyResult<()> {
    of_json::<Options>(options)?.check().map_err(PyValueError::new_err)
}

/// Flag that stops the rows in progress.
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

/// Fits and diagnoses one actuator on one thread. Returns its row as JSON; ``None`` if it was stopped.
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
    path: PathBuf,
}

#[pymethods]
impl _FleetJournal {
    /// Opens the journal of the table ``output``, or creates it.
    #[new]
    #[pyo3(signature = (output, *, read_only=false))]
    fn new(output: PathBuf, read_only: bool) -> PyResult<Self> {
        let path = fleet::journal_of(&output);
        let failed = |error: std::io::Error| PyOSError::new_err(format!("{}: {error}", path.display()));
        let journal = if read_only { Journal::read(&path) } else { Journal::open(&path) };
        Ok(Self { journal: journal.map_err(failed)?, path })
    }

    /// Returns the actuators that are not done, whose files have changed, or that have no report if ``reports`` is
    /// true.
    fn due(&self, py: Python<'_>, entries: Vec<String>, options: &str, reports: bool) -> PyResult<Vec<String>> {
        let (entries, options) = (all_of(&entries)?, of_json::<Options>(options)?);
        let options = Options { reports: reports.then(PathBuf::new), ..options };
        // Check for Ctrl-C after every 100 files.
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
        self.journal.add(&row).map_err(|error| PyOSError::new_err(format!("{}: {error}", self.path.display())))
    }

    /// Releases the lock of the journal.
    fn unlock(&self) -> PyResult<()> {
        Ok(self.journal.unlock()?)
    }

    /// Returns the number of done actuators, and how many of them failed.
    fn count(&self, entries: Vec<String>) -> PyResult<(usize, usize)> {
        Ok(self.journal.count(&all_of(&entries)?))
    }

    /// Writes the table.
    fn write(&self, py: Python<'_>, entries: Vec<String>, output: PathBuf) -> PyResult<()> {
        let entries = all_of(&entries)?;
        py.detach(|| write_atomic(&output, |out| table::write(out, &self.journal, &entries))).map_err(errors::written)
    }

    /// Returns the page as HTML; its links are relative to ``folder``.
    fn page(&self, py: Python<'_>, entries: Vec<String>, title: &str, folder: PathBuf) -> PyResult<String> {
        let entries = all_of(&entries)?;
        Ok(py.detach(|| page::page(title, &self.journal, &entries, &folder))?)
    }

    /// Returns the rows, as JSON.
    fn rows(&self, entries: Vec<String>) -> PyResult<Vec<String>> {
        let entries = all_of(&entries)?;
        self.journal.rows(&entries)?.map(|row| json(&row?.1)).collect()
    }
}
