//! Progress of long work, shown by `python/hyst/_progress.py`.

use pyo3::prelude::*;

/// A progress bar. It is created at the first report.
pub(crate) struct Bar {
    what: &'static str,
    /// Argument `progress=` of the caller.
    progress: Option<Py<PyAny>>,
    bar: Option<Option<Py<PyAny>>>,
}

impl Bar {
    pub(crate) fn new(what: &'static str, progress: Option<Py<PyAny>>) -> Self {
        Self { what, progress, bar: None }
    }

    /// Returns the bar, with `total` steps if known; `None` if no progress is shown.
    fn shown<'py>(&mut self, py: Python<'py>, total: Option<u64>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let bar = match &self.bar {
            Some(bar) => bar,
            None => {
                let bar = py.import("hyst._progress")?.call_method1("bar", (self.what, total, &self.progress))?;
                self.bar.insert((!bar.is_none()).then(|| bar.unbind()))
            }
        };
        Ok(bar.as_ref().map(|bar| bar.bind(py).clone()))
    }

    /// Shows the present step.
    pub(crate) fn say(&mut self, py: Python<'_>, text: &str) -> PyResult<()> {
        self.shown(py, None)?.map_or(Ok(()), |bar| bar.call_method1("say", (text,)).map(|_| ()))
    }

    /// Sets the bar to `done` of `total` steps.
    pub(crate) fn at(&mut self, py: Python<'_>, done: u64, total: u64) -> PyResult<()> {
        self.shown(py, Some(total))?.map_or(Ok(()), |bar| bar.call_method1("at", (done,)).map(|_| ()))
    }

    pub(crate) fn close(self, py: Python<'_>) -> PyResult<()> {
        self.bar.flatten().map_or(Ok(()), |bar| bar.call_method0(py, "close").map(|_| ()))
    }
}
