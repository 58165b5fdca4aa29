//! Conversion from and to NumPy arrays.

use std::ops::Deref;

use hyst_core::Env;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A signal of the caller as contiguous `float64`: a view if the array already is, otherwise a copy.
pub(crate) struct Signal<'py>(PyReadonlyArray1<'py, f64>);

impl<'py> Signal<'py> {
    /// Reads the argument `name` and checks that its values are finite.
    ///
    /// # Errors
    /// As [`unchecked`](Self::unchecked), and `ValueError` if a value is not finite.
    pub(crate) fn new(name: &str, x: &Bound<'py, PyAny>) -> PyResult<Self> {
        let signal = Self::unchecked(name, x)?;
        match not_finite(signal.values()?) {
            Some(k) => Err(signal.not_finite_error(name, k)),
            None => Ok(signal),
        }
    }

    /// Reads the argument `name` without a check of its values. The caller checks them.
    ///
    /// # Errors
    /// `TypeError` if it is not a sequence of real numbers, `ValueError` if it does not have one dimension.
    pub(crate) fn unchecked(name: &str, x: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Some(array) = in_place(x) {
            return Ok(Self(array));
        }
        let array = numbers(name, x)?;
        let Ok(array) = array.cast::<PyArray1<f64>>() else {
            let ndim = array.cast::<PyUntypedArray>().map_or(0, PyUntypedArrayMethods::ndim);
            return Err(match ndim {
                0 => PyTypeError::new_err(format!(
                    "{name} must be a sequence of numbers, not one number ({})",
                    x.get_type().name()?
                )),
                _ => PyValueError::new_err(format!(
                    "{name} must have one dimension, not {ndim}; {name}.ravel() makes it one"
                )),
            });
        };
        Ok(Self(array.try_readonly()?))
    }

    /// Returns the error for a value at `k` that is not finite.
    pub(crate) fn not_finite_error(&self, name: &str, k: usize) -> PyErr {
        let number = self.values().ok().and_then(|values| values.get(k)).copied().unwrap_or(f64::NAN);
        PyValueError::new_err(format!("{name}[{k}] is {number}; signals must be finite"))
    }

    pub(crate) fn values(&self) -> PyResult<&[f64]> {
        Ok(self.0.as_slice()?)
    }
}

/// Returns a view of a one-dimensional contiguous array of `float64`; `None` for anything else.
fn in_place<'py>(x: &Bound<'py, PyAny>) -> Option<PyReadonlyArray1<'py, f64>> {
    let array = x.cast::<PyArray1<f64>>().ok()?;
    // A view of a masked array would lose its mask.
    if !array.is_contiguous() || x.hasattr("mask").unwrap_or(true) {
        return None;
    }
    array.try_readonly().ok().filter(|array| array.as_slice().is_ok())
}

/// Converts anything that NumPy converts to an array of real numbers to contiguous `float64`: lists, integers, single
/// precision, strided views, columns of pandas and polars. Masked values become NaN.
///
/// # Errors
/// `TypeError` for anything else.
fn numbers<'py>(name: &str, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = x.py();
    let type_error = |what: String| {
        PyTypeError::new_err(format!("{name} must be a one-dimensional array or sequence of real numbers, not {what}"))
    };
    if x.is_none() {
        return Err(type_error("None".to_owned()));
    }
    let numpy = py.import("numpy")?;
    let float = numpy.getattr("float64")?;
    if x.is_instance(&numpy.getattr("ma")?.getattr("MaskedArray")?)? {
        return x.call_method1("astype", (float,))?.call_method1("filled", (f64::NAN,));
    }
    let array =
        numpy.call_method1("asarray", (x,)).map_err(|error| type_error(format!("that ({})", error.value(py))))?;
    let dtype = array.getattr("dtype")?;
    let to_float = |array: &Bound<'py, PyAny>| {
        let contiguous = PyDict::new(py);
        contiguous.set_item("dtype", &float)?;
        numpy.call_method("ascontiguousarray", (array,), Some(&contiguous))
    };
    match dtype.getattr("kind")?.extract::<String>()?.as_str() {
        "f" | "i" | "u" | "b" => {}
        // Columns of pandas that may have gaps contain objects.
        "O" if to_float(&array).is_ok() => {}
        _ if array.getattr("ndim")?.extract::<usize>()? == 0 => {
            return Err(type_error(x.get_type().name()?.to_string()));
        }
        _ => return Err(type_error(format!("of {}", dtype.str()?))),
    }
    // A single number keeps dimension 0.
    if array.getattr("ndim")?.extract::<usize>()? == 0 { Ok(array) } else { to_float(&array) }
}

/// Reads integers from anything that NumPy converts to an array of numbers.
///
/// # Errors
/// `TypeError` or `ValueError` if a value is not an integer.
pub(crate) fn integers(name: &str, x: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
    let signal = Signal::new(name, x)?;
    let integer = |(k, value): (usize, &f64)| {
        // An integer that a double represents exactly.
        if value.fract() == 0.0 && value.abs() < 9e15 {
            return Ok(*value as i64);
        }
        Err(PyValueError::new_err(format!("{name}[{k}] is {value}; labels must be integers")))
    };
    signal.values()?.iter().enumerate().map(integer).collect()
}

/// A list of numbers as a parameter of a model.
#[derive(Clone, Debug)]
pub(crate) struct List(pub(crate) Vec<f64>);

impl Deref for List {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.0
    }
}

impl<'a, 'py> FromPyObject<'a, 'py> for List {
    type Error = PyErr;

    fn extract(x: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        // The model rejects a parameter that is not finite, and names it.
        Ok(Self(Signal::unchecked("the list", &x)?.values()?.to_vec()))
    }
}

/// Returns the index of the first value that is not finite. The blocks have no early exit, so that the compiler can
/// vectorise them.
pub(crate) fn not_finite(values: &[f64]) -> Option<usize> {
    let block = values.chunks(256).position(|block| !block.iter().fold(true, |finite, v| finite & v.is_finite()))?;
    values.iter().skip(256 * block).position(|v| !v.is_finite()).map(|k| 256 * block + k)
}

/// Returns a new NumPy array.
pub(crate) fn array(py: Python<'_>, values: Vec<f64>) -> Bound<'_, PyArray1<f64>> {
    PyArray1::from_vec(py, values)
}

/// One quantity of the environment as given by the caller: nothing, a number, or a signal.
pub(crate) enum Given<'py> {
    Nothing,
    Number(f64),
    Signal(Signal<'py>),
}

impl<'py> Given<'py> {
    /// Reads the argument `name`.
    ///
    /// # Errors
    /// As [`Signal::new`], and `ValueError` for a number that is not finite.
    pub(crate) fn new(name: &str, x: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        let Some(x) = x else { return Ok(Self::Nothing) };
        // An array with one element also converts to `f64`.
        let is_array = x.hasattr("__len__")? && x.cast::<PyUntypedArray>().map_or(true, |array| array.ndim() > 0);
        match x.extract::<f64>() {
            Ok(number) if !is_array && number.is_finite() => Ok(Self::Number(number)),
            Ok(number) if !is_array => Err(PyValueError::new_err(format!("{name} is {number}; it must be finite"))),
            _ => Ok(Self::Signal(Signal::new(name, x)?)),
        }
    }
}

impl Given<'_> {
    /// Returns a column of `rows` samples.
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

/// One quantity of the environment at all samples.
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

/// Quantities of the environment that a model needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Needs {
    pub(crate) temperature: bool,
    pub(crate) load: bool,
    pub(crate) time: bool,
}

/// Checked environment of one call.
pub(crate) struct GivenEnvironment<'py> {
    temperature: Given<'py>,
    load: Given<'py>,
    time: Given<'py>,
}

impl<'py> GivenEnvironment<'py> {
    /// Reads the arguments `temperature`, `load` and `time`.
    ///
    /// # Errors
    /// As [`Given::new`], and `TypeError` if the model `who` needs one that is not given.
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

    /// Returns the environment of `rows` samples.
    ///
    /// # Errors
    /// `ValueError` if a signal has another length.
    pub(crate) fn rows(&self, rows: usize) -> PyResult<Environment<'_>> {
        Ok(Environment {
            temperature: self.temperature.column("temperature", rows)?,
            load: self.load.column("load", rows)?,
            time: self.time.column("time", rows)?,
        })
    }
}

/// Environment of each sample of a call.
#[derive(Clone, Copy)]
pub(crate) struct Environment<'a> {
    temperature: Column<'a>,
    load: Column<'a>,
    time: Column<'a>,
}

impl Environment<'_> {
    pub(crate) fn at(&self, k: usize) -> Env<f64> {
        Env { time: self.time.at(k), temperature: self.temperature.at(k), load: self.load.at(k) }
    }

    /// Returns whether it is the same at all samples.
    pub(crate) fn constant(&self) -> bool {
        [self.temperature, self.load, self.time].iter().all(|c| matches!(c, Column::Constant(_)))
    }
}
