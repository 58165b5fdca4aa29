//! Records from files.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use hyst_ident::record::{self as core, RecordError};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::errors;
use crate::read_options::{map_arguments, needed, reading};
use crate::record::Record;

/// Reads a record from a file. The format is detected from the content.
///
/// Parameters
/// ----------
/// path : str or path-like, or a sequence of them
///     The file; several are joined.
/// map : dict of str to str, optional
///     Columns for the names of the record format: ``{"voltage_v": "Vin", "displacement_um": "Sensor"}``.
/// need : {"both", "input", "output"}
///     Required columns: both for a fit, the input for a simulation, the output for a reference.
/// rate : float, optional
///     Sample rate [Hz] of files without times. If given, times in a file are not read.
/// name : str, optional
///     Name of the record of a single file in messages and reports; default: its path.
///
/// Raises
/// ------
/// RecordError
///     If the file cannot be read. The message contains file, line, column, and how to fix it.
#[pyfunction]
#[pyo3(signature = (path, *, map=None, need="both", rate=None, name=None))]
pub(crate) fn read_record(
    py: Python<'_>,
    path: &Bound<'_, PyAny>,
    map: Option<&Bound<'_, PyDict>>,
    need: &str,
    rate: Option<f64>,
    name: Option<&str>,
) -> PyResult<Record> {
    let (need, how) = (needed(need)?, reading(&map_arguments(map)?, rate)?);
    let paths = paths(path)?;
    let read = || {
        if let (Some(name), [path]) = (name, paths.as_slice()) {
            let bytes =
                fs::read(path).map_err(|source| RecordError::Io { file: path.display().to_string(), source })?;
            return core::Record::parse(name, &bytes, how, need);
        }
        let records = paths.iter().map(|path| core::Record::read(path, how.clone(), need)).collect::<Result<_, _>>()?;
        core::Record::join(records)
    };
    Ok(Record::wrap(py.detach(read).map_err(errors::record)?))
}

/// Reads a path or a sequence of paths.
fn paths(path: &Bound<'_, PyAny>) -> PyResult<Vec<PathBuf>> {
    if let Ok(path) = path.extract::<PathBuf>() {
        return Ok(vec![path]);
    }
    path.extract::<Vec<PathBuf>>().map_err(|_| PyTypeError::new_err("path must be a path or a sequence of paths"))
}

/// Reads a record, the path of a record, or a sequence of both.
pub(crate) fn any_record(py: Python<'_>, record: &Bound<'_, PyAny>, need: &str) -> PyResult<Arc<core::Record>> {
    if let Ok(record) = record.cast::<Record>() {
        return Ok(Arc::clone(&record.get().0));
    }
    if record.is_instance_of::<PyList>() || record.is_instance_of::<PyTuple>() {
        let each = record.try_iter()?.map(|r| any_record(py, &r?, need).map(|r| (*r).clone()));
        let joined = core::Record::join(each.collect::<PyResult<_>>()?).map_err(errors::record)?;
        return Ok(Arc::new(joined));
    }
    if record.extract::<PathBuf>().is_err() {
        return Err(PyTypeError::new_err("record must be a Record, a path, or a list of them"));
    }
    read_record(py, record, None, need, None, None).map(|r| r.0)
}
