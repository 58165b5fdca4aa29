//! Plots of objects, drawn by `python/hyst/_plot.py` with matplotlib.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// Calls a plot function of `_plot` with the object, further arguments, the axes and the options of the line, and
/// returns the axes.
pub(crate) fn drawn<'py>(
    function: &str,
    object: &Bound<'py, PyAny>,
    further: &[Bound<'py, PyAny>],
    ax: Option<&Bound<'py, PyAny>>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = object.py();
    let ax = ax.map_or_else(|| py.None().into_bound(py), Clone::clone);
    let options = options.map_or_else(|| PyDict::new(py), Clone::clone);
    let arguments = [object.clone()].into_iter().chain(further.iter().cloned()).chain([ax, options.into_any()]);
    py.import("hyst._plot")?.getattr(function)?.call1(PyTuple::new(py, arguments.collect::<Vec<_>>())?)
}
