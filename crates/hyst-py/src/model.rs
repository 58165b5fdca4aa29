//! Models of files, and what they predict and compensate (`hyst_ident::{model, simulate, compensate}`).

use std::path::PathBuf;
use std::sync::Arc;

use hyst_core::CompensatorOptions;
use hyst_ident::compensate::{CompensateOptions, compensate};
use hyst_ident::model::{self as core, Effect};
use hyst_ident::simulate::{Zero, simulate};
use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::Needs;
use crate::errors;
use crate::inverse::Inverted;
use crate::operator::Operator;
use crate::record::any_record;
use crate::runner::Runner;

/// The argument `zero`.
pub(crate) fn zero_of(word: &str) -> PyResult<Zero> {
    match word {
        "none" => Ok(Zero::None),
        "per-record" => Ok(Zero::PerRecord),
        other => Err(PyValueError::new_err(format!("zero is {other:?}; it must be \"none\" or \"per-record\""))),
    }
}

/// Text of JSON as Python's objects.
pub(crate) fn parse<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}

/// Errors against a measurement as a dict.
fn errors_dict<'py>(py: Python<'py>, errors: &hyst_ident::metrics::Errors) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("rmse", errors.rmse)?;
    dict.set_item("nrmse_percent", errors.nrmse_percent)?;
    dict.set_item("max_abs", errors.max_abs)?;
    dict.set_item("rmse_all_rows", errors.rmse_all_rows)?;
    Ok(dict)
}

/// A fitted model, as in ``model.json``: hysteresis and the effects around it, independent of the sample period.
///
/// From ``fit``, ``diagnose`` or ``Model.load``.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Model(pub(crate) core::Model);

#[pymethods]
impl Model {
    /// Reads a ``model.json``.
    ///
    /// Raises
    /// ------
    /// ModelFileError
    ///     If the file cannot be read, is no model, has a newer schema or a parameter out of range.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        core::Model::read(&path).map(Self).map_err(errors::model)
    }

    /// Reads a model from the text of a ``model.json``.
    #[staticmethod]
    fn loads(text: &str) -> PyResult<Self> {
        core::Model::parse("text", text).map(Self).map_err(errors::model)
    }

    /// Writes a ``model.json``; an interrupted write leaves no half of one.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let write = |out: &mut dyn std::io::Write| out.write_all(self.0.to_json().as_bytes());
        hyst_ident::atomic_file::write_atomic(&path, write).map_err(errors::model_file)
    }

    /// The text of the file.
    fn dumps(&self) -> String {
        self.0.to_json()
    }

    /// The contents of the file.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        parse(py, &self.0.to_json())
    }

    /// Kind of the hysteresis: ``pi``, ``preisach``, …
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.base.kind().name()
    }

    /// Names of the effects around it, in the chain's order.
    #[getter]
    fn effects(&self) -> Vec<&'static str> {
        self.0.effects.names().into_iter().map(Effect::name).collect()
    }

    /// What the sensor shows at rest [y].
    #[getter]
    fn zero(&self) -> f64 {
        self.0.zero
    }

    /// The input's column, unit included.
    #[getter]
    fn input_column(&self) -> &str {
        &self.0.input.column
    }

    /// Lowest and highest input of the record that the model was fitted to.
    #[getter]
    fn input_range(&self) -> (f64, f64) {
        (self.0.input.low, self.0.input.high)
    }

    /// The output's column, unit included.
    #[getter]
    fn output_column(&self) -> &str {
        &self.0.output.column
    }

    /// Lowest and highest output of the record that the model was fitted to.
    #[getter]
    fn output_range(&self) -> (f64, f64) {
        (self.0.output.low, self.0.output.high)
    }

    /// What the model says about a record; memory starts virgin in each segment.
    ///
    /// Parameters
    /// ----------
    /// record : Record, path, or list of them
    /// zero : {"none", "per-record"}
    ///     Whether one constant per file is taken from its measured output.
    ///
    /// Raises
    /// ------
    /// RecordError
    ///     If the record lacks a column that the model uses, or has other units.
    #[pyo3(signature = (record, *, zero="none"))]
    fn simulate(&self, py: Python<'_>, record: &Bound<'_, PyAny>, zero: &str) -> PyResult<Simulation> {
        let (record, zero) = (any_record(py, record, "input")?, zero_of(zero)?);
        let simulated = py.detach(|| simulate(&self.0, &record, zero)).map_err(errors::fit)?;
        Ok(Simulation { timepts: record.time().to_vec(), inputs: record.input().to_vec(), simulated })
    }

    /// The drive that makes the actuator follow a reference.
    ///
    /// Parameters
    /// ----------
    /// reference : Record, path, or list of them
    ///     Its output column is the reference; its ends are held for the preview.
    /// limit : (float, float), optional
    ///     Lowest and highest drive [V]; the range of the fitted record if not given.
    /// slew : float, optional
    ///     Steepest drive [V/s].
    /// bandwidth_hz : float, optional
    ///     Band in which lag, delay and resonances are inverted [Hz]; chosen if not given.
    /// temperature : float, optional
    ///     Temperature [°C], where the reference has no column of it.
    ///
    /// Raises
    /// ------
    /// ReachError
    ///     If the reference leaves what the actuator reaches.
    /// NotInvertibleError
    ///     If the model has no inverse.
    #[pyo3(signature = (reference, *, limit=None, slew=None, bandwidth_hz=None, temperature=None))]
    fn compensate(
        &self,
        py: Python<'_>,
        reference: &Bound<'_, PyAny>,
        limit: Option<(f64, f64)>,
        slew: Option<f64>,
        bandwidth_hz: Option<f64>,
        temperature: Option<f64>,
    ) -> PyResult<Drive> {
        let record = any_record(py, reference, "output")?;
        let slew = slew.unwrap_or(f64::INFINITY);
        let options = CompensateOptions { voltage: limit, slew, bandwidth_hz, temperature };
        let drive = py.detach(|| compensate(&self.0, &record, &options)).map_err(errors::compensate)?;
        Ok(Drive { timepts: record.time().to_vec(), drive })
    }

    /// The model as an operator on arrays at a sample period [s]: ``simulate``, ``step``, ``inverse``, ``compensate``.
    fn operator(&self, period: f64) -> PyResult<Operator> {
        let effects = &self.0.effects;
        let needs = Needs {
            temperature: self.0.needs_temperature(),
            load: false,
            time: effects.drift.is_some() || effects.interference.is_some(),
        };
        let mut name = self.0.base.kind().name().to_owned();
        for effect in effects.names() {
            name = format!("{name} + {effect}");
        }
        Operator::new(
            name,
            needs,
            &self.0,
            |model| model.build(period),
            move |model, _, options| {
                options.only(&["bandwidth_hz"])?;
                let own = CompensatorOptions { bandwidth_hz: options.bandwidth_hz };
                let inverse = model.compensator(period, &own).map_err(errors::core)?;
                let (lead, bandwidth_hz, band_error) = (inverse.lead(), inverse.bandwidth_hz(), inverse.error());
                Ok(Inverted { engine: Arc::new(Runner::new(inverse)), lead, bandwidth_hz, band_error })
            },
        )
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.0 == other.get().0)
    }

    fn __repr__(&self) -> String {
        let effects = self.effects().join(", ");
        let effects = if effects.is_empty() { String::new() } else { format!(" with {effects}") };
        format!("<Model {}{effects}: {} to {}>", self.kind(), self.0.input.column, self.0.output.column)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((slf.get_type().getattr("loads")?, (slf.get().dumps(),)))
    }
}

/// What a model says about a record.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Simulation {
    timepts: Vec<f64>,
    inputs: Vec<f64>,
    simulated: hyst_ident::simulate::Simulation,
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

    /// Start-up rows: a transient from before the record, shape (n,), bool.
    #[getter]
    fn settling<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_slice(py, &self.simulated.settling)
    }

    /// Constant that was added per file; empty with ``zero="none"``.
    #[getter]
    fn zeros(&self) -> Vec<f64> {
        self.simulated.zeros.clone()
    }

    /// ``rmse``, ``nrmse_percent``, ``max_abs`` and ``rmse_all_rows`` against the measured output; None without one.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.simulated.errors.as_ref().map(|e| errors_dict(py, e)).transpose()
    }

    fn __repr__(&self) -> String {
        let errors = self.simulated.errors.as_ref().map_or(String::new(), |e| format!(", rmse {:?}", e.rmse));
        format!("<Simulation: {} rows{errors}>", self.timepts.len())
    }
}

/// A drive, and what it took to get it.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Drive {
    timepts: Vec<f64>,
    drive: hyst_ident::compensate::Drive,
}

#[pymethods]
impl Drive {
    /// Time [s], shape (n,).
    #[getter]
    fn timepts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.timepts)
    }

    /// Input of the actuator at the reference's rows [V], shape (n,).
    #[getter]
    fn inputs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.drive.voltage)
    }

    /// Samples of preview that were used.
    #[getter]
    fn lead(&self) -> usize {
        self.drive.lead
    }

    /// Band in which the dynamic stages are inverted [Hz]; None if there are none.
    #[getter]
    fn bandwidth_hz(&self) -> Option<f64> {
        self.drive.bandwidth_hz
    }

    /// Largest relative error of that inversion inside its band.
    #[getter]
    fn band_error(&self) -> f64 {
        self.drive.band_error
    }

    /// Rows at which the voltage limit acted.
    #[getter]
    fn voltage_limited(&self) -> Vec<usize> {
        self.drive.voltage_limited.clone()
    }

    /// Rows at which the slew limit acted.
    #[getter]
    fn slew_limited(&self) -> Vec<usize> {
        self.drive.slew_limited.clone()
    }

    fn __repr__(&self) -> String {
        let d = &self.drive;
        let limited = d.voltage_limited.len() + d.slew_limited.len();
        format!("<Drive: {} rows, lead {}, limited in {limited}>", d.voltage.len(), d.lead)
    }
}
