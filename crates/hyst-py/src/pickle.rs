//! State of an object for `pickle` and `copy`: the version of the package and the serialised object.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Version of the package. Another version may have other fields.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Returns the value of `__reduce__` for an object of a class with `_restore`.
pub(crate) fn reduced<'py, T: Serialize>(object: &Bound<'py, PyAny>, value: &T) -> PyResult<Bound<'py, PyTuple>> {
    let py = object.py();
    let state = postcard::to_allocvec(&(VERSION, value)).map_err(|e| PyValueError::new_err(e.to_string()))?;
    let restore = py.import("hyst._pickle")?.getattr("restore")?;
    let class = object.get_type().name()?;
    PyTuple::new(py, [restore, PyTuple::new(py, [class.into_any(), PyBytes::new(py, &state).into_any()])?.into_any()])
}

/// Restores the value of a state.
///
/// # Errors
/// `ValueError` for bytes of another version, or for other bytes.
pub(crate) fn restored<T: DeserializeOwned>(state: &[u8]) -> PyResult<T> {
    let (version, rest): (String, &[u8]) =
        postcard::take_from_bytes(state).map_err(|e| PyValueError::new_err(format!("not a state of hyst: {e}")))?;
    if version != VERSION {
        let message =
            format!("pickled by hyst {version}, but this is hyst {VERSION}: create the object again from its files");
        return Err(PyValueError::new_err(message));
    }
    postcard::from_bytes(rest).map_err(|e| PyValueError::new_err(format!("not a state of hyst {VERSION}: {e}")))
}
