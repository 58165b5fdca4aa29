//! Fits and diagnoses (`hyst_ident::{fit, diagnose}`).

use std::sync::Mutex;

use hyst_ident::diagnose::{self as diagnosis, DiagnoseOptions};
use hyst_ident::fit::{self as fitting, FitOptions};
use hyst_ident::model::Kind;
use hyst_ident::simulate::Zero;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::errors;
use crate::model::{Model, parse, zero_of};
use crate::record::{any_record, of_arrays};

/// Fits a model to a record or to arrays: convex, start-up rows left out.
///
/// Parameters
/// ----------
/// record : Record, path, or list of them
///     The training record; or give ``timepts``, ``inputs`` and ``outputs``.
/// model : str
///     Kind of the hysteresis: ``pi``, ``preisach``, or ``dpm`` from records at several rates.
/// timepts, inputs, outputs : ndarray of float64, shape (n,)
///     Columns in place of a record: time [s], input [V], output in the unit of ``output_column``.
/// temperature : ndarray of float64, shape (n,), optional
///     Temperature [°C].
/// output_column : str
///     As in ``Record``.
/// zero : {"none", "per-record"}
///     One sensor zero for all files, or one for each.
/// seed : int
///     Recorded with the model.
///
/// Raises
/// ------
/// FitError
///     If the record cannot show a hysteresis: too short, constant, falling.
/// RecordError
///     If the record cannot be read or made.
#[pyfunction]
#[pyo3(signature = (record=None, *, model="pi", timepts=None, inputs=None, outputs=None, temperature=None, output_column="displacement_um", zero="none", seed=0))]
#[allow(clippy::too_many_arguments, reason = "keywords of one call")]
pub(crate) fn fit(
    py: Python<'_>,
    record: Option<&Bound<'_, PyAny>>,
    model: &str,
    timepts: Option<&Bound<'_, PyAny>>,
    inputs: Option<&Bound<'_, PyAny>>,
    outputs: Option<&Bound<'_, PyAny>>,
    temperature: Option<&Bound<'_, PyAny>>,
    output_column: &str,
    zero: &str,
    seed: u64,
) -> PyResult<Model> {
    let kind: Kind = model.parse().map_err(|e: hyst_core::UnknownKind| PyValueError::new_err(e.to_string()))?;
    let record = match (record, timepts, inputs, outputs) {
        (Some(record), None, None, None) => any_record(py, record, "both")?,
        (None, Some(t), Some(u), Some(y)) => {
            of_arrays(t, Some(u), Some(y), temperature, None, None, "voltage_v", output_column, "arrays")?.0
        }
        _ => return Err(PyTypeError::new_err("give either a record, or timepts=, inputs= and outputs=")),
    };
    let options = FitOptions { seed, zero_per_record: zero_of(zero)? == Zero::PerRecord, ..FitOptions::default() };
    py.detach(|| fitting::fit(&record, kind, &options)).map(Model).map_err(errors::fit)
}

/// What a diagnosis found.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Diagnosis(diagnosis::Diagnosis);

#[pymethods]
impl Diagnosis {
    /// The model with every effect that was found; the same model if none was.
    #[getter]
    fn extended(&self) -> Model {
        Model(self.0.extended.clone())
    }

    /// The contents of ``findings.json``.
    #[getter]
    fn findings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let json = serde_json::to_string(&self.0.findings).map_err(|e| PyValueError::new_err(e.to_string()))?;
        parse(py, &json)
    }

    /// ``explained``, ``nothing-missing``, ``base-too-coarse`` or ``unexplained``.
    #[getter]
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.findings(py)?.get_item("verdict")
    }

    /// Names of the effects that were found, in the chain's order.
    #[getter]
    fn effects(&self) -> Vec<&'static str> {
        self.0.findings.effects.iter().map(|f| f.name.name()).collect()
    }

    fn __repr__(&self) -> String {
        let effects = self.effects().join(", ");
        format!("<Diagnosis: {}>", if effects.is_empty() { "no effect found" } else { &effects })
    }
}

/// Finds what a model lacks, names it and adds it.
///
/// Parameters
/// ----------
/// record : Record, path, or list of them
///     The training record.
/// model : Model
///     What was fitted to it.
/// test : Record, path, or list of them, optional
///     Only simulated, never fitted.
/// zero : {"none", "per-record"}
///     What is done with the sensor's zero.
/// seed : int
///     Seed of the bootstrap.
/// progress : callable, optional
///     Told in words what is being done. An exception that it raises is raised when the diagnosis is over.
///
/// Raises
/// ------
/// FitError
///     If the record is too short for the search.
#[pyfunction]
#[pyo3(signature = (record, model, *, test=None, zero="none", seed=1, progress=None))]
pub(crate) fn diagnose(
    py: Python<'_>,
    record: &Bound<'_, PyAny>,
    model: &Bound<'_, Model>,
    test: Option<&Bound<'_, PyAny>>,
    zero: &str,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let train = any_record(py, record, "both")?;
    let test = test.map(|t| any_record(py, t, "both")).transpose()?;
    let options = DiagnoseOptions { zero: zero_of(zero)?, seed };
    let model = &model.get().0;
    let raised: Mutex<Option<PyErr>> = Mutex::new(None);
    let tell = |doing: &str| {
        let Some(progress) = &progress else { return };
        if let Err(error) = Python::attach(|py| progress.call1(py, (doing,)).map(|_| ()))
            && let Ok(mut raised) = raised.lock()
        {
            raised.get_or_insert(error);
        }
    };
    let found = py.detach(|| diagnosis::diagnose(&train, test.as_deref(), model, &options, &tell));
    match raised.into_inner() {
        Ok(Some(error)) => Err(error),
        _ => found.map(Diagnosis).map_err(errors::fit),
    }
}
