//! The Python class of an inverse.

use numpy::PyArray1;
use pyo3::prelude::*;

use crate::operator::Operator;

/// The inverse of a model: maps a reference to the input of the model.
///
/// With a ``lead``, the output of ``simulate`` and ``step`` belongs to the time ``lead`` samples before the given
/// reference. The method ``compensate`` of the model aligns them.
#[pyclass(extends = Operator, frozen, module = "hyst")]
pub(crate) struct Inverse {
    pub(crate) of: Py<Operator>,
    /// Samples of preview of the reference.
    #[pyo3(get)]
    pub(crate) lead: usize,
    /// Band in which the inverse is valid [Hz]; None if it is valid at all frequencies.
    #[pyo3(get)]
    pub(crate) bandwidth_hz: Option<f64>,
    /// Maximum relative error in that band.
    #[pyo3(get)]
    pub(crate) band_error: f64,
}

#[pymethods]
impl Inverse {
    /// The inverted model.
    #[getter]
    fn of(&self, py: Python<'_>) -> Py<Operator> {
        self.of.clone_ref(py)
    }

    /// Returns the inverted model: the inverse of the inverse.
    fn inverse(&self, py: Python<'_>) -> Py<Operator> {
        self.of.clone_ref(py)
    }

    /// Returns the output of the model for the input ``y_ref``.
    #[pyo3(signature = (y_ref, *, temperature=None, load=None, time=None))]
    fn compensate<'py>(
        &self,
        py: Python<'py>,
        y_ref: &Bound<'py, PyAny>,
        temperature: Option<&Bound<'py, PyAny>>,
        load: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.of.get().output(py, y_ref, [temperature, load, time])
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("{}.inverse()", self.of.bind(py).repr()?))
    }
}
