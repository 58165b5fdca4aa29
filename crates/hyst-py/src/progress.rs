//! Progress of long work, shown by `python/hyst/_progress.py`.

use pyo3::prelude::*;

/// A bar, made when there is something to show.
pub(crate) struct Bar {
    what: &'static str,
    /// What the caller gave as `progress=`.
    wanted: Option<Py<PyAny>>,
    made: Option<Option<Py<PyAny>>>,
}

impl Bar {
    pub(crate) fn new(what: &'static str, wanted: Option<Py<PyAny>>) -> Self {
        Self { what, wanted, made: None }
    }

    /// The bar, of `total` steps if that is known; none where nobody looks.
    fn shown<'py>(&mut self, py: Python<'py>, total: Option<u64>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let made = match &self.made {
            Some(made) => made,
            None => {
                let bar = py.import("hyst._progress")?.call_method1("bar", (self.what, total, &self.wanted))?;
                self.made.insert((!bar.is_none()).then(|| bar.unbind()))
            }
        };
        Ok(made.as_ref().map(|bar| bar.bind(py).clone()))
    }

    /// Says what is being done.
    pub(crate) fn say(&mut self, py: Python<'_>, text: &str) -> PyResult<()> {
        self.shown(py, None)?.map_or(Ok(()), |bar| bar.call_method1("say", (text,)).map(|_| ()))
    }

    /// Moves it to `done` of `total` steps.
    pub(crate) fn at(&mut self, py: Python<'_>, done: u64, total: u64) -> PyResult<()> {
        self.shown(py, Some(total))?.map_or(Ok(()), |bar| bar.call_method1("at", (done,)).map(|_| ()))
    }

    pub(crate) fn close(self, py: Python<'_>) -> PyResult<()> {
        self.made.flatten().map_or(Ok(()), |bar| bar.call_method0(py, "close").map(|_| ()))
    }
}
