//! What all models have in common: the Python classes `Operator` and `Inverse`.

use std::sync::Arc;

use hyst_core::{Error, Stage};
use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{GivenSurroundings, Needs, Signal, array};
use crate::errors;
use crate::inverse::{Inverted, Options};
use crate::runner::{Engine, Runner};

type Inversion = dyn Fn(&Options) -> PyResult<Inverted> + Send + Sync;

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
}

impl Operator {
    /// Builds the stage of `parameters`; `inverse` is how it will be inverted.
    ///
    /// # Errors
    /// `ParameterError`, as the core says.
    pub(crate) fn new<P, S>(
        name: impl Into<String>,
        needs: Needs,
        parameters: &P,
        build: impl FnOnce(&P) -> Result<S, Error>,
        inverse: impl Fn(&P, &S, &Options) -> PyResult<Inverted> + Send + Sync + 'static,
    ) -> PyResult<Self>
    where
        P: Clone + Send + Sync + 'static,
        S: Stage<f64> + Send + Sync + 'static,
        S::State: Send,
    {
        let runner = Arc::new(Runner::new(build(parameters).map_err(errors::core)?));
        let (engine, parameters) = (Arc::clone(&runner), parameters.clone());
        let inversion = Box::new(move |options: &Options| inverse(&parameters, &runner.stage, options));
        Ok(Self { name: name.into(), needs, engine, inversion })
    }

    /// The output for `u`, in the order that `run` asks of the stage.
    fn over<'py>(
        &self,
        py: Python<'py>,
        (name, u): (&str, &Bound<'py, PyAny>),
        given: [Option<&Bound<'py, PyAny>>; 3],
        (engine, lead): (&dyn Engine, usize),
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let signal = Signal::new(name, u)?;
        let u = signal.values()?;
        let given = GivenSurroundings::new(&self.name, self.needs, given[0], given[1], given[2])?;
        let env = given.rows(u.len())?;
        let y = py.detach(|| engine.follow(&env, u, lead));
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
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        temperature: Option<&Bound<'py, PyAny>>,
        load: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.over(py, ("u", u), [temperature, load, time], (&*self.engine, 0))
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

    /// The inverse: from a reference to the input that makes the model follow it.
    ///
    /// Parameters
    /// ----------
    /// low, high : float, optional
    ///     Range of inputs, for a model that is inverted by search (needed there).
    /// tolerance : float, optional
    ///     How near the search comes to the input; a billionth of the range if not given.
    /// bandwidth_hz : float, optional
    ///     Band in which a model with dynamics is inverted [Hz]; chosen if not given.
    ///
    /// Raises
    /// ------
    /// NotInvertibleError
    ///     If there is no inverse; the message says why.
    /// TypeError
    ///     If an option is given that this model's inverse does not take.
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
        let base = Self {
            name: format!("the inverse of {}", this.name),
            needs: this.needs,
            engine: inverted.engine,
            inversion: Box::new(|_| Err(PyTypeError::new_err("an inverse has its model in `of`"))),
        };
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
        self.over(py, ("y_ref", y_ref), [temperature, load, time], (&*inverted.engine, inverted.lead))
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

/// The inverse of a model: maps a reference to the model's input.
///
/// With a ``lead``, the output of ``simulate`` and ``step`` belongs to ``lead`` samples before the reference that it was
/// given; the model's ``compensate`` aligns them.
#[pyclass(extends = Operator, frozen, module = "hyst")]
pub(crate) struct Inverse {
    of: Py<Operator>,
    /// Samples by which the reference must be known ahead.
    #[pyo3(get)]
    lead: usize,
    /// Band in which the inverse holds [Hz]; None if it holds at all frequencies.
    #[pyo3(get)]
    bandwidth_hz: Option<f64>,
    /// Largest relative error inside that band.
    #[pyo3(get)]
    band_error: f64,
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
