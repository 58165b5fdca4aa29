//! Numpy arrays in and out.

use hyst_core::Env;
use numpy::{PyArray1, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray1, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// A signal of the caller: contiguous `float64`, seen in place.
pub(crate) struct Signal<'py>(PyReadonlyArray1<'py, f64>);

impl<'py> Signal<'py> {
    /// Looks at the argument `name`.
    ///
    /// # Errors
    /// As [`unread`](Self::unread), and `ValueError` if it holds a number that is not finite.
    pub(crate) fn new(name: &str, x: &Bound<'py, PyAny>) -> PyResult<Self> {
        let signal = Self::unread(name, x)?;
        match not_finite(signal.values()?) {
            Some(k) => Err(signal.refused(name, k)),
            None => Ok(signal),
        }
    }

    /// Looks at the argument `name`, but not at its numbers: who reads them checks them then.
    ///
    /// # Errors
    /// `TypeError` if it is no array of `float64`, `ValueError` if it has not one dimension or is not contiguous.
    pub(crate) fn unread(name: &str, x: &Bound<'py, PyAny>) -> PyResult<Self> {
        let Ok(array) = x.cast::<PyUntypedArray>() else {
            return Err(PyTypeError::new_err(format!(
                "{name} must be a one-dimensional numpy array of float64, not {}; numpy.asarray({name}, dtype=float) makes one",
                x.get_type().name()?
            )));
        };
        if !array.dtype().is_equiv_to(&numpy::dtype::<f64>(x.py())) {
            return Err(PyTypeError::new_err(format!(
                "{name} must be an array of float64, not of {}; {name}.astype(float) converts it",
                array.dtype().str()?
            )));
        }
        let Ok(array) = x.cast::<PyArray1<f64>>() else {
            return Err(PyValueError::new_err(format!(
                "{name} must have one dimension, not {}; {name}.ravel() makes it one",
                array.ndim()
            )));
        };
        let array = array.try_readonly()?;
        if array.as_slice().is_err() {
            return Err(PyValueError::new_err(format!(
                "{name} is not contiguous in memory; numpy.ascontiguousarray({name}) makes a copy that is"
            )));
        }
        Ok(Self(array))
    }

    /// What to say about a number at `k` that is not finite.
    pub(crate) fn refused(&self, name: &str, k: usize) -> PyErr {
        let number = self.values().ok().and_then(|values| values.get(k)).copied().unwrap_or(f64::NAN);
        PyValueError::new_err(format!("{name}[{k}] is {number}; signals must be finite"))
    }

    pub(crate) fn values(&self) -> PyResult<&[f64]> {
        Ok(self.0.as_slice()?)
    }
}

/// Place of the first value that is not finite. In blocks without an early end, which the processor takes several values at a time.
pub(crate) fn not_finite(values: &[f64]) -> Option<usize> {
    let block = values.chunks(256).position(|block| !block.iter().fold(true, |finite, v| finite & v.is_finite()))?;
    values.iter().skip(256 * block).position(|v| !v.is_finite()).map(|k| 256 * block + k)
}

/// A new array of the caller's.
pub(crate) fn array(py: Python<'_>, values: Vec<f64>) -> Bound<'_, PyArray1<f64>> {
    PyArray1::from_vec(py, values)
}

/// What surrounds the samples as the caller gave it: nothing, a number, or a signal.
pub(crate) enum Given<'py> {
    Nothing,
    Number(f64),
    Signal(Signal<'py>),
}

impl<'py> Given<'py> {
    /// Looks at the argument `name`.
    ///
    /// # Errors
    /// As [`Signal::new`], and `ValueError` for a number that is not finite.
    pub(crate) fn new(name: &str, x: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        let Some(x) = x else { return Ok(Self::Nothing) };
        if x.cast::<PyUntypedArray>().is_ok_and(|a| a.ndim() > 0) {
            return Ok(Self::Signal(Signal::new(name, x)?));
        }
        match x.extract::<f64>() {
            Ok(number) if number.is_finite() => Ok(Self::Number(number)),
            Ok(number) => Err(PyValueError::new_err(format!("{name} is {number}; it must be finite"))),
            Err(_) => Err(PyTypeError::new_err(format!(
                "{name} must be a number or a one-dimensional numpy array of float64, not {}",
                x.get_type().name()?
            ))),
        }
    }
}

impl Given<'_> {
    /// As a column of `rows` samples.
    ///
    /// # Errors
    /// `ValueError` if a signal has another length.
    fn column(&self, name: &str, rows: usize) -> PyResult<Column<'_>> {
        match self {
            Self::Nothing => Ok(Column::Constant(0.0)),
            Self::Number(x) => Ok(Column::Constant(*x)),
            Self::Signal(x) => match x.values()? {
                values if values.len() == rows => Ok(Column::PerSample(values)),
                values => {
                    let message = format!("{name} has {} values, but the signal has {rows}", values.len());
                    Err(PyValueError::new_err(message))
                }
            },
        }
    }
}

/// One surrounding at all samples.
#[derive(Clone, Copy)]
enum Column<'a> {
    Constant(f64),
    PerSample(&'a [f64]),
}

impl Column<'_> {
    fn at(self, k: usize) -> f64 {
        match self {
            Self::Constant(x) => x,
            Self::PerSample(x) => x.get(k).copied().unwrap_or_default(),
        }
    }
}

/// Surroundings that a model cannot do without.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Needs {
    pub(crate) temperature: bool,
    pub(crate) load: bool,
    pub(crate) time: bool,
}

/// Surroundings of one call, checked.
pub(crate) struct GivenSurroundings<'py> {
    temperature: Given<'py>,
    load: Given<'py>,
    time: Given<'py>,
}

impl<'py> GivenSurroundings<'py> {
    /// Looks at the arguments `temperature`, `load` and `time`.
    ///
    /// # Errors
    /// As [`Given::new`], and `TypeError` if the model, called `who`, needs one that is not there.
    pub(crate) fn new(
        who: &str,
        needs: Needs,
        temperature: Option<&Bound<'py, PyAny>>,
        load: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let check = |needed: bool, name: &str, unit: &str, x: Option<&Bound<'py, PyAny>>| {
            if needed && x.is_none() {
                return Err(PyTypeError::new_err(format!("{who} depends on {name}: give {name}= [{unit}]")));
            }
            Given::new(name, x)
        };
        Ok(Self {
            temperature: check(needs.temperature, "temperature", "°C", temperature)?,
            load: check(needs.load, "load", "N", load)?,
            time: check(needs.time, "time", "s", time)?,
        })
    }

    /// The surroundings of `rows` samples.
    ///
    /// # Errors
    /// `ValueError` if a signal has another length.
    pub(crate) fn rows(&self, rows: usize) -> PyResult<Surroundings<'_>> {
        Ok(Surroundings {
            temperature: self.temperature.column("temperature", rows)?,
            load: self.load.column("load", rows)?,
            time: self.time.column("time", rows)?,
        })
    }
}

/// Surroundings of every sample of a call.
#[derive(Clone, Copy)]
pub(crate) struct Surroundings<'a> {
    temperature: Column<'a>,
    load: Column<'a>,
    time: Column<'a>,
}

impl Surroundings<'_> {
    pub(crate) fn at(&self, k: usize) -> Env<f64> {
        Env { time: self.time.at(k), temperature: self.temperature.at(k), load: self.load.at(k) }
    }

    /// Whether all samples have the same ones.
    pub(crate) fn constant(&self) -> bool {
        [self.temperature, self.load, self.time].iter().all(|c| matches!(c, Column::Constant(_)))
    }
}
