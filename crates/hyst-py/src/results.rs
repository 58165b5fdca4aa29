//! Results of simulation and compensation as Python objects.

use hyst_ident::simulate::Extrapolated;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};
use serde::{Deserialize, Serialize};

use crate::{pickle, plot};

/// Returns the errors against a measurement as a dict.
fn errors_dict<'py>(py: Python<'py>, errors: &hyst_ident::metrics::Errors) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("rmse", errors.rmse)?;
    dict.set_item("nrmse_percent", errors.nrmse_percent)?;
    dict.set_item("max_abs", errors.max_abs)?;
    dict.set_item("rmse_all_rows", errors.rmse_all_rows)?;
    Ok(dict)
}

/// Result of the simulation of a record.
#[pyclass(frozen, module = "hyst")]
#[derive(PartialEq, Serialize, Deserialize)]
pub(crate) struct Simulation {
    pub(crate) timepts: Vec<f64>,
    pub(crate) inputs: Vec<f64>,
    pub(crate) simulated: hyst_ident::simulate::Simulation,
}

#[pymethods]
impl Simulation {
    /// Time [s], shape (n,).
    #[getter]
    fn timepts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.timepts)
    }

    /// Input, shape (n,).
    #[getter]
    fn inputs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.inputs)
    }

    /// Predicted output, shape (n,).
    #[getter]
    fn outputs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.simulated.predicted)
    }

    /// Start-up rows, with a transient from before the record, shape (n,), bool.
    #[getter]
    fn settling<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_slice(py, &self.simulated.settling)
    }

    /// Constants that were added, one per file; empty with ``zero="none"``.
    #[getter]
    fn zeros(&self) -> Vec<f64> {
        self.simulated.zeros.clone()
    }

    /// Phase lead [rad] of the tone against the clock of the model, one per file, estimated from the first rows.
    #[getter]
    fn tone_ahead(&self) -> Vec<f64> {
        self.simulated.tone_ahead.clone()
    }

    /// Distance of the earlier rest position from the start of each segment [output unit], estimated from the creep in
    /// the first rows; 0 if the segment starts from rest.
    #[getter]
    fn creep_away(&self) -> Vec<f64> {
        self.simulated.creep_away.clone()
    }

    /// Inputs outside ``input_range`` of the model: ``rows`` (number), ``largest`` (maximum distance), ``row`` (its
    /// row).
    #[getter]
    fn extrapolated<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Extrapolated { rows, largest, row } = self.simulated.extrapolated;
        let dict = PyDict::new(py);
        dict.set_item("rows", rows)?;
        dict.set_item("largest", largest)?;
        dict.set_item("row", row)?;
        Ok(dict)
    }

    /// ``rmse``, ``nrmse_percent``, ``max_abs`` and ``rmse_all_rows`` against the measured output; None without one.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.simulated.errors.as_ref().map(|e| errors_dict(py, e)).transpose()
    }

    /// Plots the predicted output over the input, or over time, without start-up rows; needs matplotlib.
    ///
    /// Parameters
    /// ----------
    /// kind : {"loop", "time"}
    ///     Output over the input, or over time.
    /// ax : matplotlib.axes.Axes, optional
    ///     Axes to plot in; by default a new figure.
    /// **options
    ///     Options of the line, as in ``matplotlib.axes.Axes.plot``.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    #[pyo3(signature = (*, kind="loop", ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        kind: &str,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let kind = PyString::new(slf.py(), kind).into_any();
        plot::drawn("simulation", slf.as_any(), &[kind], ax, options)
    }

    /// Returns whether all values are equal.
    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self == other.get())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        pickle::reduced(slf.as_any(), slf.get())
    }

    /// Restores the object from the state of `__reduce__`.
    #[staticmethod]
    fn _restore(state: &[u8]) -> PyResult<Self> {
        pickle::restored(state)
    }

    fn __repr__(&self) -> String {
        let errors = self.simulated.errors.as_ref().map_or(String::new(), |e| format!(", rmse {:?}", e.rmse));
        format!("<Simulation: {} rows{errors}>", self.timepts.len())
    }
}

/// Result of the compensation of a reference.
#[pyclass(frozen, module = "hyst")]
#[derive(PartialEq, Serialize, Deserialize)]
pub(crate) struct Drive {
    pub(crate) timepts: Vec<f64>,
    pub(crate) drive: hyst_ident::compensate::Drive,
}

#[pymethods]
impl Drive {
    /// Time [s], shape (n,).
    #[getter]
    fn timepts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.timepts)
    }

    /// Input of the actuator at the rows of the reference [V], shape (n,).
    #[getter]
    fn inputs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.drive.voltage)
    }

    /// Samples of preview.
    #[getter]
    fn lead(&self) -> usize {
        self.drive.lead
    }

    /// Band in which the dynamic stages are inverted [Hz]; None if there are none.
    #[getter]
    fn bandwidth_hz(&self) -> Option<f64> {
        self.drive.bandwidth_hz
    }

    /// Maximum relative error of that inversion in its band.
    #[getter]
    fn band_error(&self) -> f64 {
        self.drive.band_error
    }

    /// Rows at which the voltage limit acted.
    #[getter]
    fn voltage_limited(&self) -> Vec<usize> {
        self.drive.voltage_limited.clone()
    }

    /// Rows at which the slew-rate limit acted.
    #[getter]
    fn slew_limited(&self) -> Vec<usize> {
        self.drive.slew_limited.clone()
    }

    /// Plots the drive over time, with dots where a limit acted; needs matplotlib.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     Axes to plot in; by default a new figure.
    /// **options
    ///     Options of the line, as in ``matplotlib.axes.Axes.plot``.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    #[pyo3(signature = (*, ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        plot::drawn("drive", slf.as_any(), &[], ax, options)
    }

    /// Returns whether all values are equal.
    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self == other.get())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        pickle::reduced(slf.as_any(), slf.get())
    }

    /// Restores the object from the state of `__reduce__`.
    #[staticmethod]
    fn _restore(state: &[u8]) -> PyResult<Self> {
        pickle::restored(state)
    }

    fn __repr__(&self) -> String {
        let d = &self.drive;
        let limited = d.voltage_limited.len() + d.slew_limited.len();
        format!("<Drive: {} rows, lead {}, limited in {limited}>", d.voltage.len(), d.lead)
    }
}
