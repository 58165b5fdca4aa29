//! Models of files, and what they predict and compensate (`hyst_ident::{model, simulate, compensate}`).

use std::path::{Path, PathBuf};
use std::sync::Arc;

use hyst_core::CompensatorOptions;
use hyst_ident::atomic_file::{create_atomic, write_atomic};
use hyst_ident::compensate::{CompensateOptions, compensate};
use hyst_ident::model::{self as core, Effect};
use hyst_ident::simulate::{SimulateOptions, Zero, simulate_with};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::Needs;
use crate::channels::Channels;
use crate::errors;
use crate::inversion::{Inverted, Options};
use crate::operator::Operator;
use crate::plot;
use crate::record::any_record;
use crate::results::{Drive, Simulation};
use crate::runner::Runner;

/// The argument `zero`.
pub(crate) fn zero_of(word: &str) -> PyResult<Zero> {
    match word {
        "none" => Ok(Zero::None),
        "per-record" => Ok(Zero::PerRecord),
        other => Err(PyValueError::new_err(format!("zero is {other:?}; it must be \"none\" or \"per-record\""))),
    }
}

/// A number that may be left out.
fn finite(name: &str, x: Option<f64>) -> PyResult<Option<f64>> {
    match x {
        Some(x) if !x.is_finite() => Err(PyValueError::new_err(format!("{name} is {x}; it must be finite"))),
        x => Ok(x),
    }
}

/// Text of JSON as Python's objects.
pub(crate) fn parse<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}

/// Writes a model file, whole or not at all.
pub(crate) fn save(model: &core::Model, path: &Path, overwrite: bool) -> PyResult<()> {
    let write = |out: &mut dyn std::io::Write| out.write_all(model.to_json().as_bytes());
    if overwrite { write_atomic(path, write) } else { create_atomic(path, write) }.map_err(errors::written)
}

/// A model, as in ``model.json``: hysteresis and the effects around it, independent of the sample period.
///
/// From ``fit``, ``diagnose``, ``Model.load``, or ``to_model`` of an operator.
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
    ///
    /// Parameters
    /// ----------
    /// path : str or path-like
    ///     The file.
    /// overwrite : bool
    ///     Whether a file that is there already is replaced, as ``hystctl fit -o`` does.
    ///
    /// Raises
    /// ------
    /// FileExistsError
    ///     If the file is there already and ``overwrite`` is false; it stays as it is.
    /// ModelFileError
    ///     If the file cannot be written.
    #[pyo3(signature = (path, *, overwrite=true))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        save(&self.0, &path, overwrite)
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

    /// Whether the output falls where the drive rises: a negative gain.
    #[getter]
    fn falls(&self) -> bool {
        self.0.falls
    }

    /// How the drive goes on between samples: ``linear`` or ``band-limited``. ``simulate`` knows the whole record and goes by it.
    #[getter]
    fn between_samples(&self) -> &'static str {
        self.0.between_samples.name()
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
    /// temperature : float, optional
    ///     Temperature [°C], where the record has no column of it.
    /// periodic : bool
    ///     Whether each segment is one period of a steady state: it is passed twice, and the second pass counts.
    ///
    /// Raises
    /// ------
    /// RecordError
    ///     If the record lacks a column that the model uses, or has other units.
    ///
    /// Warns
    /// -----
    /// RangeWarning
    ///     If the input leaves ``input_range``: in how many rows, and by how much.
    #[pyo3(signature = (record, *, zero="none", temperature=None, periodic=false))]
    fn simulate(
        &self,
        py: Python<'_>,
        record: &Bound<'_, PyAny>,
        zero: &str,
        temperature: Option<f64>,
        periodic: bool,
    ) -> PyResult<Simulation> {
        let (record, zero) = (any_record(py, record, "input")?, zero_of(zero)?);
        let options = SimulateOptions {
            zero,
            temperature: finite("temperature", temperature)?,
            periodic,
            ..SimulateOptions::default()
        };
        let simulated = py.detach(|| simulate_with(&self.0, &record, &options)).map_err(errors::fit)?;
        let (beyond, (low, high)) = (simulated.extrapolated, self.input_range());
        if beyond.rows > 0 {
            let message = format!(
                "in {} of {} rows the input lies beyond input_range, {low:?} to {high:?}, by {:.4e} at most (row {}); the prediction is extrapolated there",
                beyond.rows,
                record.rows(),
                beyond.largest,
                beyond.row
            );
            errors::out_of_range(py, &message)?;
        }
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
        let temperature = finite("temperature", temperature)?;
        let slew = slew.unwrap_or(f64::INFINITY);
        let options = CompensateOptions { voltage: limit, slew, bandwidth_hz, temperature };
        let drive = py.detach(|| compensate(&self.0, &record, &options)).map_err(errors::compensate)?;
        Ok(Drive { timepts: record.time().to_vec(), drive })
    }

    /// Draws loops of the model, over the range that it was fitted to; needs matplotlib.
    ///
    /// Parameters
    /// ----------
    /// period : float
    ///     Sample period [s] of the five turns of a decaying sine, 5000 samples.
    /// temperature : float, optional
    ///     Temperature [°C], for models that depend on it.
    /// ax : matplotlib.axes.Axes, optional
    ///     Where to draw; a new figure if not given.
    /// **options
    ///     Of the line, as in ``matplotlib.axes.Axes.plot``.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    #[pyo3(signature = (*, period=1e-3, temperature=None, ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        period: f64,
        temperature: Option<f64>,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let said = [period.into_bound_py_any(py)?, temperature.into_bound_py_any(py)?];
        plot::drawn("model", slf.as_any(), &said, ax, options)
    }

    /// The model as an operator on arrays at a sample period [s]: ``simulate``, ``step``, ``inverse``, ``compensate``.
    ///
    /// It takes one sample after the other and sees the drive as linear between them, whatever ``between_samples`` says.
    fn operator(&self, period: f64) -> PyResult<Operator> {
        let effects = &self.0.effects;
        let needs = Needs {
            temperature: self.0.needs_temperature(),
            load: self.0.needs_load(),
            time: effects.drift.is_some() || effects.interference.is_some(),
        };
        let mut name = self.0.base.kind().name().to_owned();
        for effect in effects.names() {
            name = format!("{name} + {effect}");
        }
        let (runner, model) = (Runner::new(self.0.build(period).map_err(errors::core)?), self.0.clone());
        let inversion = move |options: &Options| {
            options.only(&["bandwidth_hz"])?;
            let own = CompensatorOptions { bandwidth_hz: options.bandwidth_hz };
            let inverse = model.compensator(period, &own).map_err(errors::core)?;
            let (lead, band) = (inverse.lead(), inverse.bandwidth_hz().map(|hz| (hz, inverse.error())));
            let inverted = Inverted::in_band(inverse, lead, band);
            Ok(match model.inverse_ends() {
                // A drive that is filtered on its way stays at no end.
                Some(([low, high], tolerance)) if lead == 0 => inverted.between(low, high, tolerance),
                _ => inverted,
            })
        };
        let model = self.0.clone();
        let filing = move |channels: &Channels| {
            if channels.is_empty() {
                return Ok(model.clone());
            }
            Err(PyTypeError::new_err("this is the operator of a Model, which has its ranges and columns"))
        };
        Ok(Operator::new(name, needs, Arc::new(runner), inversion, filing))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.0 == other.get().0)
    }

    /// A table and a picture, for notebooks.
    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("hyst._html")?.call_method1("model", (slf,))
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
