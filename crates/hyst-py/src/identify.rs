//! Fit and diagnosis (`hyst_ident::{fit, diagnose}`).

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use hyst_cli::report;
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::diagnose::{self as diagnosis, DiagnoseOptions};
use hyst_ident::fit::{self as fitting, FitOptions, Optimizer, VariableBounds};
use hyst_ident::identify::Form;
use hyst_ident::model::Kind;
use hyst_ident::optimize::Progress;
use hyst_ident::record::Record;
use hyst_ident::simulate::Zero;
use hyst_ident::stop::Stop;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::interrupt::interruptible;
use crate::model::{Model, parse, zero_of};
use crate::progress::Bar;
use crate::read_record::any_record;
use crate::record::of_arrays;
use crate::{errors, pickle, plot};

/// Fits a model to a record or to arrays, without the start-up rows.
///
/// Parameters
/// ----------
/// record : Record, path, or list of them
///     The training record. Alternatively give ``timepts``, ``inputs`` and ``outputs``.
/// model : str
///     Kind of the base model, such as ``bouc-wen``; ``dpm`` accepts records at several rates.
/// timepts, inputs, outputs : ndarray of float64, shape (n,)
///     Columns instead of a record: time [s], input [V], output in the unit of ``output_column``.
/// temperature : ndarray of float64, shape (n,), optional
///     Temperature [°C].
/// output_column : str
///     As in ``Record``.
/// zero : {"none", "per-record"}
///     One sensor zero for all files, or one per file.
/// optimizer : str
///     ``auto``, ``convex`` (least squares of the weights), or a search: ``de``, ``pso``, ``gwo`` and the others that
///     ``hystctl fit --help`` lists.
/// seed : int, optional
///     Seed of the random numbers, stored in the model. Required for a search that is selected by name; default 0.
/// trials : int
///     Number of repetitions of a search with other random numbers. The best result is used.
/// evaluations : int, optional
///     Maximum number of evaluations of a trial; default 1500 per searched variable.
/// population : int, optional
///     Population size of the search; default: that of the search.
/// bounds : dict of str to (float, float), optional
///     Minimum and maximum of searched variables, instead of those that are derived from the record.
/// form : {"zhu", "xie", "backlash", "elasto-slip"}, optional
///     Form of ``bouc-wen`` (``zhu``: n = 1; ``xie``: n is searched), or of an element of ``maxwell-slip``.
/// between_samples : {"linear", "band-limited"}, optional
///     Interpolation of the drive of ``bouc-wen-oscillator`` between samples; by default both are tried.
/// elements : int, optional
///     Number of play operators of ``gpi`` and ``td-pi``, and of ``pi`` in a search; number of elements of ``td-em``;
///     maximum number of elements of ``maxwell-slip``.
/// thresholds : int, optional
///     Maximum number of thresholds of ``pi``. Their values are estimated from the record.
/// progress : bool or callable, optional
///     Whether a search shows a progress bar (tqdm); by default in a terminal or a notebook. A function is called with
///     the number of evaluations. Ctrl-C ends the search.
///
/// Raises
/// ------
/// FitError
///     If the record cannot show hysteresis (too short, constant, falling), or if the search cannot run or finds
///     nothing.
/// RecordError
///     If the record cannot be read or made, or if a column that the model needs is missing.
/// ValueError
///     If a model, optimizer or form is unknown, or a search has no seed.
#[pyfunction]
#[pyo3(signature = (record=None, *, model="pi", timepts=None, inputs=None, outputs=None, temperature=None, output_column="displacement_um", zero="none", optimizer="auto", seed=None, trials=1, evaluations=None, population=None, bounds=None, form=None, between_samples=None, elements=None, thresholds=None, progress=None))]
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
    optimizer: &str,
    seed: Option<u64>,
    trials: usize,
    evaluations: Option<u64>,
    population: Option<usize>,
    bounds: Option<BTreeMap<String, (f64, f64)>>,
    form: Option<&str>,
    between_samples: Option<&str>,
    elements: Option<usize>,
    thresholds: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let kind: Kind = named(model)?;
    let optimizer: Optimizer = named(optimizer)?;
    if let (Optimizer::Search(name), None) = (&optimizer, seed) {
        let message = format!("optimizer={name:?} uses random numbers: give seed= to make the result repeatable");
        return Err(PyValueError::new_err(message));
    }
    let form: Form = form.map_or_else(|| Ok(Form::default()), named)?;
    let of_variable = |(name, (lower, upper))| VariableBounds { name, lower, upper };
    let options = FitOptions {
        seed: seed.unwrap_or(0),
        zero_per_record: zero_of(zero)? == Zero::PerRecord,
        optimizer,
        trials,
        evaluations,
        population,
        bounds: bounds.into_iter().flatten().map(of_variable).collect(),
        form: Form { elements, between_samples: between_samples.map(named).transpose()?, ..form },
        thresholds,
    };
    let record = match (record, timepts, inputs, outputs) {
        (Some(record), None, None, None) => any_record(py, record, "both")?,
        (None, Some(t), Some(u), Some(y)) => {
            of_arrays(t, Some(u), Some(y), temperature, None, None, "voltage_v", output_column, "arrays")?.0
        }
        _ => return Err(PyTypeError::new_err("give either a record, or timepts=, inputs= and outputs=")),
    };
    // A search can take minutes; Ctrl-C ends it.
    let work = |stop: &Arc<AtomicBool>, reports: Sender<Progress>| {
        let mut watch = |progress| {
            // Fails after an exception; the report is then not needed.
            let _ = reports.send(progress);
            if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        fitting::fit_with(&record, kind, &options, &mut watch)
    };
    let mut bar = Bar::new("fit", progress);
    let found = interruptible(py, work, |py, Progress { evaluations, budget, .. }| bar.at(py, evaluations, budget));
    bar.close(py)?;
    found?.map(|fit| Model(fit.model)).map_err(errors::fit)
}

/// Parses a name.
fn named<T: FromStr<Err: std::fmt::Display>>(name: &str) -> PyResult<T> {
    name.parse().map_err(|e: T::Err| PyValueError::new_err(e.to_string()))
}

/// Pickled state of a diagnosis. Types with optional fields are stored as JSON.
#[derive(Serialize, Deserialize)]
struct PickledState {
    json: [String; 5],
    train: Record,
    test: Option<Record>,
    per_record: bool,
    seed: u64,
}

impl PickledState {
    fn of(own: &Diagnosis) -> PyResult<Self> {
        let found = &own.found;
        let json = [
            own.model.to_json(),
            found.extended.to_json(),
            json(&found.findings)?,
            json(&found.pictures)?,
            json(&found.breakdowns)?,
        ];
        let (train, test) = ((*own.train).clone(), own.test.as_deref().cloned());
        Ok(Self { json, train, test, per_record: own.zero == Zero::PerRecord, seed: own.seed })
    }

    fn diagnosis(self) -> PyResult<Diagnosis> {
        let [model, extended, findings, pictures, breakdowns] = &self.json;
        let model_of = |text: &str| hyst_ident::model::Model::parse("pickle", text).map_err(errors::model);
        Ok(Diagnosis {
            found: diagnosis::Diagnosis {
                extended: model_of(extended)?,
                findings: of_json(findings)?,
                pictures: of_json(pictures)?,
                breakdowns: of_json(breakdowns)?,
                weighed: Vec::new(),
            },
            model: model_of(model)?,
            train: Arc::new(self.train),
            test: self.test.map(Arc::new),
            zero: if self.per_record { Zero::PerRecord } else { Zero::None },
            seed: self.seed,
        })
    }
}

fn json(value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|e| PyValueError::new_err(e.to_string()))
}

fn of_json<T: DeserializeOwned>(text: &str) -> PyResult<T> {
    serde_json::from_str(text).map_err(|e| PyValueError::new_err(e.to_string()))
}

/// Result of a diagnosis.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Diagnosis {
    found: diagnosis::Diagnosis,
    /// The diagnosed model, for the report.
    model: hyst_ident::model::Model,
    train: Arc<Record>,
    test: Option<Arc<Record>>,
    zero: Zero,
    seed: u64,
}

impl Diagnosis {
    /// Returns the report as an HTML page.
    fn page(&self) -> PyResult<String> {
        let per_record = self.zero == Zero::PerRecord;
        let options = if per_record { vec!["--zero".to_owned(), "per-record".to_owned()] } else { Vec::new() };
        let model = self.model.to_json();
        let contents = report::Contents {
            diagnosis: &self.found,
            model: &self.model,
            model_file: "model.json",
            model_path: "model.json",
            model_sha256: &format!("{:x}", Sha256::digest(&model)),
            extended_file: None,
            train: &self.train,
            test: self.test.as_deref(),
            reading: options,
            seed: self.seed,
        };
        report::page(&contents).map_err(|e| PyValueError::new_err(e.to_string()))
    }
}

#[pymethods]
impl Diagnosis {
    /// The extended model; the diagnosed model if no effect was found.
    #[getter]
    fn extended(&self) -> Model {
        Model(self.found.extended.clone())
    }

    /// The contents of ``findings.json``.
    #[getter]
    fn findings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        parse(py, &json(&self.found.findings)?)
    }

    /// ``explained``, ``nothing-missing``, ``base-too-coarse`` or ``unexplained``.
    #[getter]
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.findings(py)?.get_item("verdict")
    }

    /// Names of the found effects, in the order of the chain.
    #[getter]
    fn effects(&self) -> Vec<&'static str> {
        self.found.findings.effects.iter().map(|f| f.name.name()).collect()
    }

    /// Plots the residuals of the diagnosed and of the extended model over time, for the test record if there is one,
    /// otherwise for the training record.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     Axes to plot in; by default a new figure.
    /// **options
    ///     Options of both lines, as in ``matplotlib.axes.Axes.plot``.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    #[pyo3(signature = (*, ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, own) = (slf.py(), slf.get());
        let record = crate::record::Record(own.test.as_ref().unwrap_or(&own.train).clone());
        let zero = if own.zero == Zero::PerRecord { "per-record" } else { "none" };
        let models = [Model(own.model.clone()), own.extended()];
        let arguments = [models.into_bound_py_any(py)?, record.into_bound_py_any(py)?, zero.into_bound_py_any(py)?];
        plot::drawn("diagnosis", slf.as_any(), &arguments, ax, options)
    }

    /// Returns whether extended model and findings are equal.
    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| {
            let (own, other) = (&self.found, &other.get().found);
            own.extended == other.extended && own.findings == other.findings
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        pickle::reduced(slf.as_any(), &PickledState::of(slf.get())?)
    }

    /// Restores the object from the state of `__reduce__`.
    #[staticmethod]
    fn _restore(state: &[u8]) -> PyResult<Self> {
        pickle::restored::<PickledState>(state)?.diagnosis()
    }

    /// Writes the report: one self-contained HTML page with plots.
    ///
    /// Parameters
    /// ----------
    /// path : str or path-like
    ///     The file. An existing file is replaced.
    fn report(&self, path: PathBuf) -> PyResult<()> {
        let page = self.page()?;
        write_atomic(&path, |out| out.write_all(page.as_bytes())).map_err(errors::written)
    }

    /// Returns the report in an iframe, so that its style and scripts do not affect the notebook.
    fn _repr_html_(&self) -> PyResult<String> {
        let page = self.page()?.replace('&', "&amp;").replace('"', "&quot;");
        Ok(format!("<iframe srcdoc=\"{page}\" style=\"width:100%;height:640px;border:1px solid #ccc\"></iframe>"))
    }

    fn __repr__(&self) -> String {
        let effects = self.effects().join(", ");
        format!("<Diagnosis: {}>", if effects.is_empty() { "no effect found" } else { &effects })
    }
}

/// Finds the effects that are missing in a model, names them and adds them.
///
/// Parameters
/// ----------
/// record : Record, path, or list of them
///     The training record.
/// model : Model
///     The model that was fitted to it.
/// test : Record, path, or list of them, optional
///     The test record. It is simulated, but not fitted.
/// zero : {"none", "per-record"}
///     One sensor zero for all files, or one per file.
/// seed : int
///     Seed of the bootstrap.
/// progress : bool or callable, optional
///     Whether a progress bar (tqdm) shows the present step; by default in a terminal or a notebook. A function is
///     called with the step as text. An exception of the function ends the diagnosis, as Ctrl-C does.
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
    let work = |stop: &Arc<AtomicBool>, steps: Sender<String>| {
        let steps = Mutex::new(steps);
        let report = |step: &str| {
            // Fails after an exception; the step is then not needed.
            let _ = steps.lock().map(|steps| steps.send(step.to_owned()));
        };
        diagnosis::diagnose_until(&train, test.as_deref(), model, &options, &report, &Stop::from(Arc::clone(stop)))
    };
    let mut bar = Bar::new("diagnose", progress);
    let found = interruptible(py, work, |py, step: String| bar.say(py, &step));
    bar.close(py)?;
    let found = found?.map_err(errors::fit)?;
    Ok(Diagnosis { found, model: model.clone(), train, test, zero: options.zero, seed })
}
