//! Converts errors of the other crates to Python exceptions (`python/hyst/_errors.py`).

use std::ffi::CString;
use std::io::ErrorKind;

use hyst_ident::atomic_file::AtomicFileError;
use hyst_ident::compensate::CompensateError;
use hyst_ident::fit::FitError;
use hyst_ident::metrics::MetricsError;
use hyst_ident::model::ModelError;
use pyo3::exceptions::PyFileExistsError;
use pyo3::prelude::*;

mod python {
    #![allow(missing_docs, unreachable_pub, reason = "declarations of Python's classes, documented there")]
    pyo3::import_exception!(hyst._errors, FitError);
    pyo3::import_exception!(hyst._errors, ModelFileError);
    pyo3::import_exception!(hyst._errors, NoModelError);
    pyo3::import_exception!(hyst._errors, NoRecordError);
    pyo3::import_exception!(hyst._errors, NotInvertibleError);
    pyo3::import_exception!(hyst._errors, ParameterError);
    pyo3::import_exception!(hyst._errors, RangeWarning);
    pyo3::import_exception!(hyst._errors, ReachError);
    pyo3::import_exception!(hyst._errors, RecordError);
}

/// Converts an error of the core: an invalid parameter, or an operator without an inverse.
pub(crate) fn core(error: hyst_core::Error) -> PyErr {
    match error {
        hyst_core::Error::NotInvertible(_) => not_invertible(error.to_string()),
        _ => parameter(error.to_string()),
    }
}

pub(crate) fn parameter(message: String) -> PyErr {
    python::ParameterError::new_err(message)
}

pub(crate) fn not_invertible(message: String) -> PyErr {
    python::NotInvertibleError::new_err(message)
}

/// Converts an error of a record. Options of the command line in the message are also given as Python arguments.
pub(crate) fn record(error: impl std::error::Error) -> PyErr {
    let mut message = error.to_string();
    if message.contains("--map ") {
        message.push_str(" (in Python --map NAME=COLUMN is map={\"NAME\": \"COLUMN\"})");
    }
    if message.ends_with("--temperature DEGC") {
        message.push_str(" (in Python temperature=)");
    }
    if is_missing_file(&error) {
        python::NoRecordError::new_err(message)
    } else {
        python::RecordError::new_err(message)
    }
}

/// Returns whether the cause is a missing file.
fn is_missing_file(error: &impl std::error::Error) -> bool {
    let io = error.source().and_then(|source| source.downcast_ref::<std::io::Error>());
    io.is_some_and(|error| error.kind() == ErrorKind::NotFound)
}

pub(crate) fn model_file(error: impl std::error::Error) -> PyErr {
    if is_missing_file(&error) {
        return python::NoModelError::new_err(error.to_string());
    }
    no_model_file(error.to_string())
}

pub(crate) fn no_model_file(message: String) -> PyErr {
    python::ModelFileError::new_err(message)
}

/// Converts an error of writing a file; `FileExistsError` if it exists and must not be replaced.
pub(crate) fn written(error: AtomicFileError) -> PyErr {
    match error.source.kind() {
        ErrorKind::AlreadyExists => {
            let path = error.path.display();
            PyFileExistsError::new_err(format!("{path}: the file exists; give overwrite=True to replace it"))
        }
        _ => model_file(error),
    }
}

/// Warns with the line of the caller.
///
/// # Errors
/// If the caller turns warnings into exceptions.
pub(crate) fn out_of_range(py: Python<'_>, message: &str) -> PyResult<()> {
    let message = CString::new(message)?;
    PyErr::warn(py, &py.get_type::<python::RangeWarning>(), &message, 1)
}

pub(crate) fn fit(error: FitError) -> PyErr {
    match error {
        FitError::Model(error) => model(error),
        FitError::Missing { .. } => record(error),
        _ => python::FitError::new_err(error.to_string()),
    }
}

pub(crate) fn model(error: ModelError) -> PyErr {
    model_file(error)
}

pub(crate) fn compensate(error: CompensateError) -> PyErr {
    match error {
        CompensateError::Inverse(error) => core(error),
        CompensateError::OutOfReach { .. } => python::ReachError::new_err(error.to_string()),
        _ => record(error),
    }
}

pub(crate) fn metrics(error: MetricsError) -> PyErr {
    record(error)
}
