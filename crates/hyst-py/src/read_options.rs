//! Options of reading a record: required columns, names of columns, sample rate.

use hyst_ident::record::{ColumnMap, Need, Reading};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors;

/// Parses the argument `need`.
pub(crate) fn needed(need: &str) -> PyResult<Need> {
    match need {
        "both" => Ok(Need::InputAndOutput),
        "input" => Ok(Need::Input),
        "output" => Ok(Need::Output),
        other => {
            let message = format!("need is {other:?}; it must be \"both\", \"input\" or \"output\"");
            Err(PyValueError::new_err(message))
        }
    }
}

/// Returns the argument `map` as arguments of the command line.
pub(crate) fn map_arguments(map: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<String>> {
    let argument = |(name, column): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        Ok(format!("{}={}", name.extract::<String>()?, column.extract::<String>()?))
    };
    map.into_iter().flatten().map(argument).collect()
}

/// Returns the options for reading columns.
pub(crate) fn reading(arguments: &[String], rate: Option<f64>) -> PyResult<Reading> {
    if let Some(rate) = rate.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
        return Err(PyValueError::new_err(format!(
            "rate is {rate}; it must be a positive number of samples per second"
        )));
    }
    Ok(Reading { map: ColumnMap::parse(arguments).map_err(errors::record)?, rate })
}
