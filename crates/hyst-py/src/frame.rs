//! Reads the columns of tables of other libraries.

use hyst_ident::record::TableColumn;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Returns the columns of a table that contain numbers or dates. Dates become seconds since the first one.
///
/// # Errors
/// If it is not a table.
pub(crate) fn columns(frame: &Bound<'_, PyAny>) -> PyResult<Vec<TableColumn>> {
    let py = frame.py();
    let numpy = py.import("numpy")?;
    let frame = with_index(frame)?;
    let names = if frame.hasattr("columns")? { frame.getattr("columns")? } else { frame.call_method0("keys")? };
    let mut columns = Vec::new();
    for name in names.try_iter()? {
        let name = name?;
        let values = numpy.call_method1("asarray", (frame.get_item(&name)?,))?;
        let kind = values.getattr("dtype")?.getattr("kind")?.extract::<String>()?;
        let (numbers, unit) = match kind.as_str() {
            "f" | "i" | "u" | "b" => (float(&values)?, None),
            "M" | "m" if values.len()? > 0 => {
                let second = numpy.call_method1("timedelta64", (1, "s"))?;
                let since = values.sub(values.get_item(0)?)?;
                (float(&since.div(second)?)?, Some("s".to_owned()))
            }
            // A column with gaps may contain objects. A column of text is skipped.
            "O" => match float(&values) {
                Ok(numbers) => (numbers, None),
                Err(_) => continue,
            },
            _ => continue,
        };
        columns.push(TableColumn { name: name.str()?.to_string(), unit, values: numbers });
    }
    Ok(columns)
}

/// Returns the table with its index as a column, if the index has a name or contains dates. Converts a Dataset of
/// xarray to a table.
fn with_index<'py>(frame: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let frame = if frame.hasattr("to_dataframe")? { frame.call_method0("to_dataframe")? } else { frame.clone() };
    if !(frame.hasattr("reset_index")? && frame.hasattr("index")?) {
        return Ok(frame);
    }
    let index = frame.getattr("index")?;
    let is_named = index.getattr("names")?.try_iter()?.any(|name| name.is_ok_and(|name| !name.is_none()));
    let kind = index.getattr("dtype")?.getattr("kind")?.extract::<String>()?;
    if is_named || ["M", "m"].contains(&kind.as_str()) { frame.call_method0("reset_index") } else { Ok(frame) }
}

/// Converts values to `f64`.
fn float(values: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let keywords = PyDict::new(values.py());
    keywords.set_item("dtype", "float64")?;
    let array = values.py().import("numpy")?.call_method("ascontiguousarray", (values,), Some(&keywords))?;
    Ok(array.cast::<PyArray1<f64>>()?.readonly().as_slice()?.to_vec())
}
