//! The Python class `Operator`, the base class of all models: its runs over signals and samples, and its inverse.

use std::sync::Arc;

use hyst_ident::model as core;
use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{GivenEnvironment, Needs, Signal, array};
use crate::channels::Channels;
use crate::clamp::Clamp;
use crate::inversion::{Inverted, Options};
use crate::runner::{AnyHistory, Engine, NotFinite};

type Inversion = dyn Fn(&Options) -> PyResult<Inverted> + Send + Sync;
type ToModel = dyn Fn(&Channels) -> PyResult<core::Model> + Send + Sync;

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
    /// Converts it to a model for a file.
    to_model: Box<ToModel>,
    /// Input range of an inverse, for the warning about unreachable references.
    clamp: Option<Clamp>,
}

/// History of an operator at one sample.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct _History(AnyHistory);

impl Operator {
    /// Returns an operator of an engine, its inversion and its conversion to a model.
    pub(crate) fn new(
        name: impl Into<String>,
        needs: Needs,
        engine: Arc<dyn Engine>,
        inversion: impl Fn(&Options) -> PyResult<Inverted> + Send + Sync + 'static,
        to_model: impl Fn(&Channels) -> PyResult<core::Model> + Send + Sync + 'static,
    ) -> Self {
        let (inversion, to_model) = (Box::new(inversion), Box::new(to_model));
        Self { name: name.into(), needs, engine, inversion, to_model, clamp: None }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Returns the input range of an inverse of this operator, for the warning about unreachable references.
    fn clamp(&self, inverted: &Inverted) -> Option<Clamp> {
        inverted.ends.map(|ends| Clamp { ends, model: Arc::clone(&self.engine) })
    }

    /// Runs `engine` over the signal `u`, with `lead` samples of preview, and warns if `clamp` is given.
    fn run<'py>(
        &self,
        py: Python<'py>,
        (name, u): (&str, &Bound<'py, PyAny>),
        given: [Option<&Bound<'py, PyAny>>; 3],
        (engine, lead): (&dyn Engine, usize),
        clamp: Option<&Clamp>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let signal = Signal::unchecked(name, u)?;
        let u = signal.values()?;
        let given = GivenEnvironment::new(&self.name, self.needs, given[0], given[1], given[2])?;
        let env = given.rows(u.len())?;
        let y = py.detach(|| engine.follow(&env, u, lead)).map_err(|NotFinite(k)| signal.not_finite_error(name, k))?;
        if let Some(clamp) = clamp {
            clamp.warn(py, &env, (name, u), &y)?;
        }
        Ok(array(py, y))
    }

    /// Runs the operator over the signal `u`, with the given temperature, load and time.
    pub(crate) fn output<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        given: [Option<&Bound<'py, PyAny>>; 3],
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.run(py, ("u", u), given, (&*self.engine, 0), self.clamp.as_ref())
    }

    /// Runs the inverse over the reference `y_ref`, aligned with it.
    pub(crate) fn drive<'py>(
        &self,
        py: Python<'py>,
        y_ref: &Bound<'py, PyAny>,
        given: [Option<&Bound<'py, PyAny>>; 3],
        options: &Options,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let inverted = (self.inversion)(options)?;
        let clamp = self.clamp(&inverted);
        self.run(py, ("y_ref", y_ref), given, (&*inverted.engine, inverted.lead), clamp.as_ref())
    }

    /// Returns the operator of the inverse, and the inverse with its lead and band.
    pub(crate) fn inverted(&self, options: &Options) -> PyResult<(Self, Inverted)> {
        let inverted = (self.inversion)(options)?;
        let unsupported = || PyTypeError::new_err("not available for an inverse, which has its model in `of`");
        let (clamp, engine) = (self.clamp(&inverted), Arc::clone(&inverted.engine));
        let name = format!("the inverse of {}", self.name);
        let base = Self::new(name, self.needs, engine, move |_| Err(unsupported()), move |_| Err(unsupported()));
        Ok((Self { clamp, ..base }, inverted))
    }

    /// Returns the model for a file.
    pub(crate) fn model(&self, channels: &Channels) -> PyResult<core::Model> {
        (self.to_model)(channels)
    }

    /// Returns the history; `None` before the first sample.
    pub(crate) fn history(&self) -> Option<_History> {
        self.engine.history().map(_History)
    }

    /// Continues from a history; returns whether it is one of this operator.
    pub(crate) fn resume(&self, history: &_History) -> bool {
        self.engine.resume(&history.0)
    }

    /// Runs `f` on one sample.
    pub(crate) fn run_sample(
        &self,
        u: f64,
        given: [Option<&Bound<'_, PyAny>>; 3],
        f: impl FnOnce(&dyn Engine, &hyst_core::Env<f64>, f64) -> Option<f64>,
    ) -> PyResult<f64> {
        let given = GivenEnvironment::new(&self.name, self.needs, given[0], given[1], given[2])?;
        let env = given.rows(1)?.at(0);
        f(&*self.engine, &env, u)
            .ok_or_else(|| PyValueError::new_err(format!("the first input is {u}; it must be finite")))
    }
}
