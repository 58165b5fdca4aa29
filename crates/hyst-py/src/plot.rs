//! Plots of objects, drawn by `python/hyst/_plot.py` with matplotlib.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// The axes on which `_plot` draws an object: the function of this name gets it, what else is said, the axes and the options of the line.
pub(crate) fn drawn<'py>(
    function: &str,
    object: &Bound<'py, PyAny>,
    said: &[Bound<'py, PyAny>],
    ax: Option<&Bound<'py, PyAny>>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = object.py();
    let ax = ax.map_or_else(|| py.None().into_bound(py), Clone::clone);
    let options = options.map_or_else(|| PyDict::new(py), Clone::clone);
    let arguments = [object.clone()].into_iter().chain(said.iter().cloned()).chain([ax, options.into_any()]);
    py.import("hyst._plot")?.getattr(function)?.call1(PyTuple::new(py, arguments.collect::<Vec<_>>())?)
}
