//! What all models have in common: the Python class `Operator`.

use std::path::PathBuf;
use std::sync::Arc;

use hyst_ident::model as core;
use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{GivenSurroundings, Needs, Signal, array};
use crate::channels::Channels;
use crate::clamp::Clamp;
use crate::inverse::Inverse;
use crate::inversion::{Inverted, Options};
use crate::model::{Model, save};
use crate::runner::{AnyHistory, Engine, NotFinite};

type Inversion = dyn Fn(&Options) -> PyResult<Inverted> + Send + Sync;
type Filing = dyn Fn(&Channels) -> PyResult<core::Model> + Send + Sync;

/// A model: maps an input sample and a history to an output sample.
///
/// Signals are one-dimensional contiguous numpy arrays of float64. They are read in place, without a copy and with
/// Python's lock released: do not write to them from another thread meanwhile.
#[pyclass(subclass, frozen, module = "hyst")]
pub(crate) struct Operator {
    name: String,
    needs: Needs,
    engine: Arc<dyn Engine>,
    inversion: Box<Inversion>,
    /// How a model file comes of it.
    filing: Box<Filing>,
    /// Where it stays for references that are out of reach, if it is an inverse that does.
    clamp: Option<Clamp>,
}

/// What an operator remembers at one instant.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct _History(AnyHistory);

impl Operator {
    /// Of an engine, how it is inverted and how a file comes of it.
    pub(crate) fn new(
        name: impl Into<String>,
        needs: Needs,
        engine: Arc<dyn Engine>,
        inversion: impl Fn(&Options) -> PyResult<Inverted> + Send + Sync + 'static,
        filing: impl Fn(&Channels) -> PyResult<core::Model> + Send + Sync + 'static,
    ) -> Self {
        let (inversion, filing) = (Box::new(inversion), Box::new(filing));
        Self { name: name.into(), needs, engine, inversion, filing, clamp: None }
    }

    /// Where an inverse of this stays for references that are out of reach.
    fn clamp(&self, inverted: &Inverted) -> Option<Clamp> {
        inverted.ends.map(|ends| Clamp { ends, model: Arc::clone(&self.engine) })
    }

    /// The output for `u`, in the order that `run` asks of the stage.
    fn over<'py>(
        &self,
        py: Python<'py>,
        (name, u): (&str, &Bound<'py, PyAny>),
        given: [Option<&Bound<'py, PyAny>>; 3],
        (engine, lead): (&dyn Engine, usize),
        clamp: Option<&Clamp>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let signal = Signal::unread(name, u)?;
        let u = signal.values()?;
        let given = GivenSurroundings::new(&self.name, self.needs, given[0], given[1], given[2])?;
        let env = given.rows(u.len())?;
        let y = py.detach(|| engine.follow(&env, u, lead)).map_err(|NotFinite(k)| signal.refused(name, k))?;
        if let Some(clamp) = clamp {
            clamp.warn(py, &env, (name, u), &y)?;
        }
        Ok(array(py, y))
    }

    /// One sample through `run`.
    fn one(
        &self,
        u: f64,
        given: [Option<&Bound<'_, PyAny>>; 3],
        run: impl FnOnce(&dyn Engine, &hyst_core::Env<f64>, f64) -> Option<f64>,
    ) -> PyResult<f64> {
        let given = GivenSurroundings::new(&self.name, self.needs, given[0], given[1], given[2])?;
        let env = given.rows(1)?.at(0);
        run(&*self.engine, &env, u)
            .ok_or_else(|| PyValueError::new_err(format!("{u} is no input to rest at: the first one must be finite")))
    }
}

#[pymethods]
impl Operator {
    /// The output for a whole input.
    ///
    /// Every call starts from a fresh history, at rest at ``u[0]``: linear parts settled there, memory virgin and then
    /// seeing ``u[0]``. The history that ``step`` moves is not touched.
    ///
    /// Parameters
    /// ----------
    /// u : ndarray of float64, shape (n,), contiguous
    ///     Input [V, or the unit of the parameters].
    /// temperature : float or ndarray of float64, shape (n,), optional
    ///     Temperature [°C].
    /// load : float or ndarray of float64, shape (n,), optional
    ///     External load [N].
    /// time : float or ndarray of float64, shape (n,), optional
    ///     The lab's clock [s]. Only models of the sensor look at it.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (n,)
    ///     Output, a new array.
    ///
    /// Raises
    /// ------
    /// TypeError
    ///     If ``u`` is no array of float64, or a surrounding that the model depends on is missing.
    /// ValueError
    ///     If ``u`` has not one dimension, is not contiguous or not finite, or lengths differ.
    #[pyo3(signature = (u, *, temperature=None, load=None, time=None))]
    pub(crate) fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        temperature: Option<&Bound<'py, PyAny>>,
        load: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.over(py, ("u", u), [temperature, load, time], (&*self.engine, 0), self.clamp.as_ref())
    }

    /// Sets the object's own history to rest at ``u0`` and returns the output there.
    ///
    /// Parameters
    /// ----------
    /// u0 : float
    ///     Input at rest.
    /// temperature, load, time : float, optional
    ///     Surroundings [°C, N, s].
    #[pyo3(signature = (u0, *, temperature=None, load=None, time=None))]
    fn reset(
        &self,
        u0: f64,
        temperature: Option<&Bound<'_, PyAny>>,
        load: Option<&Bound<'_, PyAny>>,
        time: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<f64> {
        self.one(u0, [temperature, load, time], |engine, env, u| u.is_finite().then(|| engine.reset(env, u)))
    }

    /// The output one sample later, at input ``u``; moves the object's own history.
    ///
    /// The first ``step`` of an object that was never reset is a ``reset``. An input that is not finite
    /// counts as the last finite one.
    ///
    /// Parameters
    /// ----------
    /// u : float
    ///     Input.
    /// temperature, load, time : float, optional
    ///     Surroundings [°C, N, s].
    #[pyo3(signature = (u, *, temperature=None, load=None, time=None))]
    fn step(
        &self,
        u: f64,
        temperature: Option<&Bound<'_, PyAny>>,
        load: Option<&Bound<'_, PyAny>>,
        time: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<f64> {
        self.one(u, [temperature, load, time], |engine, env, u| engine.step(env, u))
    }

    /// The object's own history, to ``_resume`` from; ``None`` before the first sample.
    fn _history(&self) -> Option<_History> {
        self.engine.history().map(_History)
    }

    /// Continues from a history of this object.
    fn _resume(&self, history: &_History) -> PyResult<()> {
        let own = self.engine.resume(&history.0);
        own.then_some(()).ok_or_else(|| PyValueError::new_err("this is the history of another operator"))
    }

    /// The inverse: from a reference to the input that makes the model follow it.
    ///
    /// Parameters
    /// ----------
    /// low, high : float, optional
    ///     Range of inputs, for a model that is inverted by search (needed there).
    /// tolerance : float, optional
    ///     How near the search comes to the input; a billionth of the range if not given. Of an activation-function model that is
    ///     inverted backwards in time: what the preview may miss, of the largest |α u̇|; 1e-9 if not given.
    /// bandwidth_hz : float, optional
    ///     Band in which a model with dynamics is inverted [Hz]; chosen if not given.
    ///
    /// Raises
    /// ------
    /// NotInvertibleError
    ///     If there is no inverse; the message says why.
    /// TypeError
    ///     If an option is given that this model's inverse does not take.
    ///
    /// Warns
    /// -----
    /// RangeWarning
    ///     By ``simulate`` of the inverse, if it cannot reach all samples within its range of inputs: how many, and by how
    ///     much. ``step`` takes the nearer end without a word.
    #[pyo3(signature = (*, low=None, high=None, tolerance=None, bandwidth_hz=None))]
    fn inverse(
        slf: &Bound<'_, Self>,
        low: Option<f64>,
        high: Option<f64>,
        tolerance: Option<f64>,
        bandwidth_hz: Option<f64>,
    ) -> PyResult<Py<Inverse>> {
        let this = slf.get();
        let inverted = (this.inversion)(&Options { low, high, tolerance, bandwidth_hz })?;
        let none = || PyTypeError::new_err("an inverse has its model in `of`");
        let clamp = this.clamp(&inverted);
        let name = format!("the inverse of {}", this.name);
        let base = Self::new(name, this.needs, inverted.engine, move |_| Err(none()), move |_| Err(none()));
        let base = Self { clamp, ..base };
        let inverse = Inverse {
            of: slf.clone().unbind(),
            lead: inverted.lead,
            bandwidth_hz: inverted.bandwidth_hz,
            band_error: inverted.band_error,
        };
        Py::new(slf.py(), PyClassInitializer::from(base).add_subclass(inverse))
    }

    /// The input that makes the model follow a reference: ``inverse`` over an array, rows aligned with the reference.
    ///
    /// Where the inverse needs a preview, the reference is held at its ends.
    ///
    /// Parameters
    /// ----------
    /// y_ref : ndarray of float64, shape (n,), contiguous
    ///     Reference, in the output's unit.
    /// temperature, load, time : float or ndarray of float64, shape (n,), optional
    ///     Surroundings [°C, N, s].
    /// low, high, tolerance, bandwidth_hz : float, optional
    ///     As in ``inverse``.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (n,)
    ///     Input, a new array.
    ///
    /// Warns
    /// -----
    /// RangeWarning
    ///     If no input from ``low`` to ``high`` (of ``Saturation``: none at all) reaches some samples: how many, and by how
    ///     much they are missed. The input is the nearer end there.
    #[pyo3(signature = (y_ref, *, temperature=None, load=None, time=None, low=None, high=None, tolerance=None, bandwidth_hz=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of one call")]
    fn compensate<'py>(
        &self,
        py: Python<'py>,
        y_ref: &Bound<'py, PyAny>,
        temperature: Option<&Bound<'py, PyAny>>,
        load: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
        low: Option<f64>,
        high: Option<f64>,
        tolerance: Option<f64>,
        bandwidth_hz: Option<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let inverted = (self.inversion)(&Options { low, high, tolerance, bandwidth_hz })?;
        let clamp = self.clamp(&inverted);
        let run = (&*inverted.engine, inverted.lead);
        self.over(py, ("y_ref", y_ref), [temperature, load, time], run, clamp.as_ref())
    }

    /// The model that a file holds: what ``Model.load`` and hystctl read.
    ///
    /// It has the parameters alone: no history, no sample period, and nothing that only an inverse takes (``filter_degc``
    /// of ``TdEm``). A stage that is no hysteresis stands beside one that does nothing, ``Pi(gain=1, ...)``.
    ///
    /// Parameters
    /// ----------
    /// input_range : (float, float), optional
    ///     Lowest and highest input for which the parameters hold [u]: drives that the model computes keep to them, predictions
    ///     beyond them are warned of. Needed, but for ``Preisach`` and ``Dpm``, which have a grid.
    /// output_range : (float, float), optional
    ///     Lowest and highest output [y]; those at rest at the ends of ``input_range`` if not given.
    /// input_column : str, optional
    ///     ``voltage_v`` (if not given), or ``QUANTITY_in_UNIT``.
    /// output_column : str, optional
    ///     ``displacement_um`` (if not given), ``displacement_nm``, ``displacement_mm`` or ``force_n``. Parameters are not
    ///     converted: they are in these units.
    ///
    /// Raises
    /// ------
    /// TypeError
    ///     If ``input_range`` is needed; or given where the operator is that of a ``Model``, which has one; or if this is
    ///     an inverse.
    /// ModelFileError
    ///     If files do not hold such a variant: a short ``memory``, a ``drifting`` model.
    /// ParameterError
    ///     If a range is not finite or not in order, ``input_column`` is no name of an input, or ``output_column`` not the
    ///     unit in which ``TdEm`` gives its output (``per_metre``).
    /// ValueError
    ///     If ``output_column`` is none of those.
    #[pyo3(signature = (*, input_range=None, output_range=None, input_column=None, output_column=None))]
    fn to_model(
        &self,
        input_range: Option<(f64, f64)>,
        output_range: Option<(f64, f64)>,
        input_column: Option<String>,
        output_column: Option<String>,
    ) -> PyResult<Model> {
        (self.filing)(&Channels { input_range, output_range, input_column, output_column }).map(Model)
    }

    /// The text of a ``model.json``: that of ``to_model``, whose arguments and errors it has.
    #[pyo3(signature = (*, input_range=None, output_range=None, input_column=None, output_column=None))]
    fn to_json(
        &self,
        input_range: Option<(f64, f64)>,
        output_range: Option<(f64, f64)>,
        input_column: Option<String>,
        output_column: Option<String>,
    ) -> PyResult<String> {
        Ok(self.to_model(input_range, output_range, input_column, output_column)?.0.to_json())
    }

    /// Writes a ``model.json``: that of ``to_model``, whose other arguments and errors it has. An interrupted write leaves no
    /// half of one.
    ///
    /// Parameters
    /// ----------
    /// path : str or path-like
    ///     The file.
    /// overwrite : bool
    ///     Whether a file that is there already is replaced.
    ///
    /// Raises
    /// ------
    /// FileExistsError
    ///     If the file is there already and ``overwrite`` is false; it stays as it is.
    /// ModelFileError
    ///     If the file cannot be written.
    #[pyo3(signature = (path, *, overwrite=false, input_range=None, output_range=None, input_column=None, output_column=None))]
    fn save(
        &self,
        path: PathBuf,
        overwrite: bool,
        input_range: Option<(f64, f64)>,
        output_range: Option<(f64, f64)>,
        input_column: Option<String>,
        output_column: Option<String>,
    ) -> PyResult<()> {
        save(&self.to_model(input_range, output_range, input_column, output_column)?.0, &path, overwrite)
    }

    /// Samples by which an input must be known ahead of its output: 0 for a model.
    #[getter]
    fn lead(&self) -> usize {
        0
    }

    fn __repr__(&self) -> String {
        format!("Operator({})", self.name)
    }
}
