//! Calls of the methods of the Python object, and their return values.

use std::collections::BTreeMap;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyMapping;

/// Call of a method of the object.
pub(super) enum Call {
    Start(f64),
    Exchange(Vec<f64>),
    /// Asks for the present voltage.
    Present,
    Stop,
}

/// Result of a call.
pub(super) enum Answer {
    Rate(f64),
    Columns(BTreeMap<&'static str, Vec<f64>>),
    /// `exchange` has put out the drive, but returned no valid columns.
    Invalid(PyErr),
    /// Present voltage \[V\], if the object returns it.
    Present(Option<f64>),
    Stopped,
}

/// Calls a method of the object.
pub(super) fn ask(object: &Bound<'_, PyAny>, call: Call) -> PyResult<Answer> {
    match call {
        Call::Start(rate_hz) => {
            let returned = object.call_method1("start", (rate_hz,))?;
            Ok(Answer::Rate(if returned.is_none() { rate_hz } else { returned.extract()? }))
        }
        Call::Exchange(drive) => {
            let drive = PyArray1::from_vec(object.py(), drive);
            let returned = object.call_method1("exchange", (drive,))?;
            Ok(columns(&returned).map_or_else(Answer::Invalid, Answer::Columns))
        }
        Call::Present => Ok(Answer::Present(object.call_method0("capabilities")?.getattr("present_v")?.extract()?)),
        Call::Stop => object.call_method0("stop").map(|_| Answer::Stopped),
    }
}

/// Reads the return value of `exchange`: the outputs, or a mapping.
fn columns(returned: &Bound<'_, PyAny>) -> PyResult<BTreeMap<&'static str, Vec<f64>>> {
    let Ok(mapping) = returned.cast::<PyMapping>() else {
        return Ok(BTreeMap::from([("output", numbers(returned, "output")?)]));
    };
    let mut found = BTreeMap::new();
    for name in ["output", "drive", "temperature", "load"] {
        if mapping.contains(name)? {
            found.insert(name, numbers(&mapping.get_item(name)?, name)?);
        }
    }
    Ok(found)
}

fn numbers(values: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    let numpy = values.py().import("numpy")?;
    let converted =
        numpy.call_method1("atleast_1d", (values,)).and_then(|array| array.call_method1("astype", ("float64",)));
    let array: Result<PyReadonlyArray1<'_, f64>, _> = converted.and_then(|array| array.extract());
    match array {
        Ok(array) => Ok(array.as_array().to_vec()),
        Err(_) => Err(PyTypeError::new_err(format!(
            "exchange returned {} as \"{name}\"; expected a one-dimensional array of numbers",
            values.get_type().name()?
        ))),
    }
}
