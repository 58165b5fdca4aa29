//! Models of files, their simulation and compensation (`hyst_ident::{model, simulate, compensate}`).

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
use crate::read_record::any_record;
use crate::results::{Drive, Simulation};
use crate::runner::Runner;

/// Parses the argument `zero`.
pub(crate) fn zero_of(word: &str) -> PyResult<Zero> {
    match word {
        "none" => Ok(Zero::None),
        "per-record" => Ok(Zero::PerRecord),
        other => Err(PyValueError::new_err(format!("zero is {other:?}; it must be \"none\" or \"per-record\""))),
    }
}

/// Checks an optional number.
fn finite(name: &str, x: Option<f64>) -> PyResult<Option<f64>> {
    match x {
        Some(x) if !x.is_finite() => Err(PyValueError::new_err(format!("{name} is {x}; it must be finite"))),
        x => Ok(x),
    }
}

/// Parses JSON to Python objects.
pub(crate) fn parse<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}

/// Writes a model file atomically.
pub(crate) fn save(model: &core::Model, path: &Path, overwrite: bool) -> PyResult<()> {
    let write = |out: &mut dyn std::io::Write| out.write_all(model.to_json().as_bytes());
    if overwrite { write_atomic(path, write) } else { create_atomic(path, write) }.map_err(errors::written)
}

/// A model as in ``model.json``: base model and effects, independent of the sample period.
///
/// Returned by ``fit``, ``diagnose``, ``Model.load`` and ``to_model`` of an operator.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Model(pub(crate) core::Model);

#[pymethods]
impl Model {
    /// Reads a ``model.json``.
    ///
    /// Raises
    /// ------
    /// ModelFileError
    ///     If the file cannot be read, is not a model, has a newer schema or a parameter out of range.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        core::Model::read(&path).map(Self).map_err(errors::model)
    }

    /// Reads a model from the text of a ``model.json``.
    #[staticmethod]
    fn loads(text: &str) -> PyResult<Self> {
        core::Model::parse("text", text).map(Self).map_err(errors::model)
    }

    /// Writes a ``model.json`` atomically: an interrupted write leaves no partial file.
    ///
    /// Parameters
    /// ----------
    /// path : str or path-like
    ///     The file.
    /// overwrite : bool
    ///     Whether an existing file is replaced.
    ///
    /// Raises
    /// ------
    /// FileExistsError
    ///     If the file exists and ``overwrite`` is false. The file is not changed.
    /// ModelFileError
    ///     If the file cannot be written.
    #[pyo3(signature = (path, *, overwrite=true))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        save(&self.0, &path, overwrite)
    }

    /// Returns the text of the file.
    fn dumps(&self) -> String {
        self.0.to_json()
    }

    /// Returns the content of the file.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        parse(py, &self.0.to_json())
    }

    /// Kind of the base model: ``pi``, ``preisach``, …
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.base.kind().name()
    }

    /// Names of the effects, in the order of the chain.
    #[getter]
    fn effects(&self) -> Vec<&'static str> {
        self.0.effects.names().into_iter().map(Effect::name).collect()
    }

    /// Sensor zero: the output at rest [y].
    #[getter]
    fn zero(&self) -> f64 {
        self.0.zero
    }

    /// Whether the output falls when the drive rises (negative gain).
    #[getter]
    fn falls(&self) -> bool {
        self.0.falls
    }

    /// Interpolation of the drive between samples: ``linear`` or ``band-limited``. ``simulate`` uses it, because it
    /// knows the whole record.
    #[getter]
    fn between_samples(&self) -> &'static str {
        self.0.between_samples.name()
    }

    /// Column of the input, with the unit.
    #[getter]
    fn input_column(&self) -> &str {
        &self.0.input.column
    }

    /// Minimum and maximum input of the training record.
    #[getter]
    fn input_range(&self) -> (f64, f64) {
        (self.0.input.low, self.0.input.high)
    }

    /// Column of the output, with the unit.
    #[getter]
    fn output_column(&self) -> &str {
        &self.0.output.column
    }

    /// Minimum and maximum output of the training record.
    #[getter]
    fn output_range(&self) -> (f64, f64) {
        (self.0.output.low, self.0.output.high)
    }

    /// Simulates the model over the input of a record. The memory is virgin at the start of each segment.
    ///
    /// Parameters
    /// ----------
    /// record : Record, path, or list of them
    /// zero : {"none", "per-record"}
    ///     Whether one constant per file is estimated from its measured output.
    /// temperature : float, optional
    ///     Temperature [°C], if the record has no such column.
    /// periodic : bool
    ///     Whether each segment is one period of a steady state. It is then simulated twice, and the second pass is
    ///     returned.
    ///
    /// Raises
    /// ------
    /// RecordError
    ///     If a column that the model uses is missing or has another unit.
    ///
    /// Warns
    /// -----
    /// RangeWarning
    ///     If the input is outside ``input_range``, with the number of rows and the distance.
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
                "in {} of {} rows the input is outside input_range, {low:?} to {high:?}, by at most {:.4e} (row {}); the prediction is extrapolated there",
                beyond.rows,
                record.rows(),
                beyond.largest,
                beyond.row
            );
            errors::out_of_range(py, &message)?;
        }
        Ok(Simulation { timepts: record.time().to_vec(), inputs: record.input().to_vec(), simulated })
    }

    /// Computes the drive with which the actuator follows a reference.
    ///
    /// Parameters
    /// ----------
    /// reference : Record, path, or list of them
    ///     Record with the reference as its output column. Its first and last value are held for the preview.
    /// limit : (float, float), optional
    ///     Minimum and maximum drive [V]; default: ``input_range``.
    /// slew : float, optional
    ///     Maximum slew rate of the drive [V/s].
    /// bandwidth_hz : float, optional
    ///     Band in which lag, delay and resonances are inverted [Hz]; by default chosen from the model.
    /// temperature : float, optional
    ///     Temperature [°C], if the reference has no such column.
    ///
    /// Raises
    /// ------
    /// ReachError
    ///     If the reference is outside what the actuator reaches.
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

    /// Plots loops of the model over ``input_range``; needs matplotlib.
    ///
    /// Parameters
    /// ----------
    /// period : float
    ///     Sample period [s] of the drive: five periods of a decaying sine, 5000 samples.
    /// temperature : float, optional
    ///     Temperature [°C], for models that depend on it.
    /// ax : matplotlib.axes.Axes, optional
    ///     Axes to plot in; by default a new figure.
    /// **options
    ///     Options of the line, as in ``matplotlib.axes.Axes.plot``.
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
        let arguments = [period.into_bound_py_any(py)?, temperature.into_bound_py_any(py)?];
        plot::drawn("model", slf.as_any(), &arguments, ax, options)
    }

    /// Returns the model as an operator on arrays at a sample period [s]: ``simulate``, ``step``, ``inverse``,
    /// ``compensate``.
    ///
    /// It processes sample by sample, with a drive that is linear between samples, independent of ``between_samples``.
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
                // A filtered drive does not remain at an end of the range.
                Some(([low, high], tolerance)) if lead == 0 => inverted.between(low, high, tolerance),
                _ => inverted,
            })
        };
        let model = self.0.clone();
        let to_model = move |channels: &Channels| {
            if channels.is_empty() {
                return Ok(model.clone());
            }
            Err(PyTypeError::new_err(
                "leave out ranges and columns: this operator is of a Model, which has its ranges and columns",
            ))
        };
        Ok(Operator::new(name, needs, Arc::new(runner), inversion, to_model))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.0 == other.get().0)
    }

    /// Returns a table and a plot for notebooks.
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
