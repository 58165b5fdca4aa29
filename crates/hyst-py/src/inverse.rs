//! The Python class of an inverse.

use numpy::PyArray1;
use pyo3::prelude::*;

use crate::operator::Operator;

/// The inverse of a model: maps a reference to the model's input.
///
/// With a ``lead``, the output of ``simulate`` and ``step`` belongs to ``lead`` samples before the reference that it was
/// given; the model's ``compensate`` aligns them.
#[pyclass(extends = Operator, frozen, module = "hyst")]
pub(crate) struct Inverse {
    pub(crate) of: Py<Operator>,
    /// Samples by which the reference must be known ahead.
    #[pyo3(get)]
    pub(crate) lead: usize,
    /// Band in which the inverse holds [Hz]; None if it holds at all frequencies.
    #[pyo3(get)]
    pub(crate) bandwidth_hz: Option<f64>,
    /// Largest relative error inside that band.
    #[pyo3(get)]
    pub(crate) band_error: f64,
}

#[pymethods]
impl Inverse {
    /// The model that is inverted.
    #[getter]
    fn of(&self, py: Python<'_>) -> Py<Operator> {
        self.of.clone_ref(py)
    }

    /// The model that is inverted: the inverse of the inverse.
    fn inverse(&self, py: Python<'_>) -> Py<Operator> {
        self.of.clone_ref(py)
    }

    /// The reference whose inverse is ``y_ref``: what the model answers to it.
    #[pyo3(signature = (y_ref, *, temperature=None, load=None, time=None))]
    fn compensate<'py>(
        &self,
        py: Python<'py>,
        y_ref: &Bound<'py, PyAny>,
        temperature: Option<&Bound<'py, PyAny>>,
        load: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.of.get().simulate(py, y_ref, temperature, load, time)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("{}.inverse()", self.of.bind(py).repr()?))
    }
}
