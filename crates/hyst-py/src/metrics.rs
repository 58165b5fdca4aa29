//! Errors of a prediction (`hyst_ident::metrics`).

use hyst_ident::metrics::{self, Errors};
use numpy::{PyArray1, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::arrays::Signal;
use crate::errors;

/// Returns the flags of the rows to leave out: those of the caller, or none.
fn flags(settling: Option<&Bound<'_, PyAny>>, rows: usize) -> PyResult<Vec<bool>> {
    let Some(settling) = settling else { return Ok(vec![false; rows]) };
    let array = settling.cast::<PyArray1<bool>>().ok().filter(|a| a.is_contiguous()).ok_or_else(|| {
        PyTypeError::new_err(
            "settling must be a one-dimensional contiguous numpy array of bool, true for rows to leave out",
        )
    })?;
    Ok(array.try_readonly()?.as_slice()?.to_vec())
}

/// Computes `metric` of the three columns.
fn with<R>(
    measured: &Bound<'_, PyAny>,
    predicted: &Bound<'_, PyAny>,
    settling: Option<&Bound<'_, PyAny>>,
    metric: impl FnOnce(&[f64], &[f64], &[bool]) -> Result<R, metrics::MetricsError>,
) -> PyResult<R> {
    let (measured, predicted) = (Signal::new("measured", measured)?, Signal::new("predicted", predicted)?);
    let (y, p) = (measured.values()?, predicted.values()?);
    metric(y, p, &flags(settling, y.len())?).map_err(errors::metrics)
}

/// Root-mean-square error, in the unit of the signals.
///
/// Parameters
/// ----------
/// measured, predicted : ndarray of float64, shape (n,)
/// settling : ndarray of bool, shape (n,), optional
///     Rows to leave out, as ``Simulation.settling``.
#[pyfunction]
#[pyo3(signature = (measured, predicted, *, settling=None))]
pub(crate) fn rmse(
    measured: &Bound<'_, PyAny>,
    predicted: &Bound<'_, PyAny>,
    settling: Option<&Bound<'_, PyAny>>,
) -> PyResult<f64> {
    Ok(with(measured, predicted, settling, Errors::of)?.rmse)
}

/// ``rmse`` in % of the span of the measured signal. Arguments as ``rmse``.
#[pyfunction]
#[pyo3(signature = (measured, predicted, *, settling=None))]
pub(crate) fn nrmse(
    measured: &Bound<'_, PyAny>,
    predicted: &Bound<'_, PyAny>,
    settling: Option<&Bound<'_, PyAny>>,
) -> PyResult<f64> {
    Ok(with(measured, predicted, settling, Errors::of)?.nrmse_percent)
}

/// Maximum absolute error, in the unit of the signals. Arguments as ``rmse``.
#[pyfunction]
#[pyo3(signature = (measured, predicted, *, settling=None))]
pub(crate) fn max_abs(
    measured: &Bound<'_, PyAny>,
    predicted: &Bound<'_, PyAny>,
    settling: Option<&Bound<'_, PyAny>>,
) -> PyResult<f64> {
    Ok(with(measured, predicted, settling, Errors::of)?.max_abs)
}

/// Mean of ``|p − y| / |y|``, as a ratio. Rows with a measured signal below 1 % of its span are left out; ``None`` if
/// no row remains. Arguments as ``rmse``.
#[pyfunction]
#[pyo3(signature = (measured, predicted, *, settling=None))]
pub(crate) fn mape(
    measured: &Bound<'_, PyAny>,
    predicted: &Bound<'_, PyAny>,
    settling: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<f64>> {
    Ok(with(measured, predicted, settling, metrics::mape)?.ratio)
}

/// Mean of ``2 |p − y| / (|p| + |y|)``, as a ratio from 0 to 2. Arguments as ``rmse``.
#[pyfunction]
#[pyo3(signature = (measured, predicted, *, settling=None))]
pub(crate) fn smape(
    measured: &Bound<'_, PyAny>,
    predicted: &Bound<'_, PyAny>,
    settling: Option<&Bound<'_, PyAny>>,
) -> PyResult<f64> {
    with(measured, predicted, settling, metrics::smape)
}

/// Maximum minus minimum of the signed error, in the unit of the signals. Arguments as ``rmse``.
#[pyfunction]
#[pyo3(signature = (measured, predicted, *, settling=None))]
pub(crate) fn peak_to_valley(
    measured: &Bound<'_, PyAny>,
    predicted: &Bound<'_, PyAny>,
    settling: Option<&Bound<'_, PyAny>>,
) -> PyResult<f64> {
    with(measured, predicted, settling, metrics::peak_to_valley)
}
