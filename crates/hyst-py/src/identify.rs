//! Fits and diagnoses (`hyst_ident::{fit, diagnose}`).

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
use crate::record::{any_record, of_arrays};
use crate::{errors, pickle, plot};

/// Fits a model to a record or to arrays; start-up rows are left out.
///
/// Parameters
/// ----------
/// record : Record, path, or list of them
///     The training record; or give ``timepts``, ``inputs`` and ``outputs``.
/// model : str
///     Kind of the hysteresis, as ``bouc-wen``; ``dpm`` takes records at several rates.
/// timepts, inputs, outputs : ndarray of float64, shape (n,)
///     Columns in place of a record: time [s], input [V], output in the unit of ``output_column``.
/// temperature : ndarray of float64, shape (n,), optional
///     Temperature [°C].
/// output_column : str
///     As in ``Record``.
/// zero : {"none", "per-record"}
///     One sensor zero for all files, or one for each.
/// optimizer : str
///     ``auto`` and ``convex`` (weights alone are solved for at once), or a search: ``de``, ``pso``, ``gwo`` and the others that
///     ``hystctl fit --help`` lists.
/// seed : int, optional
///     Of what is drawn at random, recorded with the model. A search that is asked for by its name needs one; 0 otherwise.
/// trials : int
///     How often a search is repeated with other draws; the best is taken.
/// evaluations : int, optional
///     Most evaluations of a trial; 1500 for each searched variable if not given.
/// population : int, optional
///     Members, particles or wolves; the search's own number if not given.
/// bounds : dict of str to (float, float), optional
///     Lowest and highest value of searched variables, instead of those that the record suggests.
/// form : {"zhu", "xie", "backlash", "elasto-slip"}, optional
///     Form of ``bouc-wen`` (``zhu``: n = 1; ``xie``: n is searched), or of an element of ``maxwell-slip``.
/// between_samples : {"linear", "band-limited"}, optional
///     How the drive of ``bouc-wen-oscillator`` goes on between samples; both are tried if not given.
/// elements : int, optional
///     Plays of ``gpi`` and ``td-pi``, of ``pi`` when it is searched; elements of ``td-em``; most elements of ``maxwell-slip``.
/// thresholds : int, optional
///     Most thresholds of ``pi``, chosen where the record calls for them.
/// progress : bool or callable, optional
///     Whether a search shows a bar (tqdm); in a terminal or a notebook if not given. A function is told how many evaluations are done. Ctrl-C ends the search.
///
/// Raises
/// ------
/// FitError
///     If the record cannot show a hysteresis (too short, constant, falling), or if the search cannot be run or finds nothing.
/// RecordError
///     If the record cannot be read or made, or lacks what the model needs.
/// ValueError
///     If there is no such model, optimizer or form, or a search has no seed.
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
        let message = format!("optimizer={name:?} draws at random: give seed=, so that it can be repeated");
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
    // A search can take minutes: Ctrl-C ends it.
    let work = |stop: &Arc<AtomicBool>, reports: Sender<Progress>| {
        let mut watch = |progress| {
            // Nobody listens once an exception is under way.
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

/// What has this name.
fn named<T: FromStr<Err: std::fmt::Display>>(name: &str) -> PyResult<T> {
    name.parse().map_err(|e: T::Err| PyValueError::new_err(e.to_string()))
}

/// What is kept of a diagnosis. What may leave fields out is JSON.
#[derive(Serialize, Deserialize)]
struct Kept {
    json: [String; 5],
    train: Record,
    test: Option<Record>,
    per_record: bool,
    seed: u64,
}

impl Kept {
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

/// What a diagnosis found.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Diagnosis {
    found: diagnosis::Diagnosis,
    /// What was diagnosed, for the report.
    model: hyst_ident::model::Model,
    train: Arc<Record>,
    test: Option<Arc<Record>>,
    zero: Zero,
    seed: u64,
}

impl Diagnosis {
    /// The report as a page.
    fn page(&self) -> PyResult<String> {
        let per_record = self.zero == Zero::PerRecord;
        let reading = if per_record { vec!["--zero".to_owned(), "per-record".to_owned()] } else { Vec::new() };
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
            reading,
            seed: self.seed,
        };
        report::page(&contents).map_err(|e| PyValueError::new_err(e.to_string()))
    }
}

#[pymethods]
impl Diagnosis {
    /// The model with every effect that was found; the same model if none was.
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

    /// Names of the effects that were found, in the chain's order.
    #[getter]
    fn effects(&self) -> Vec<&'static str> {
        self.found.findings.effects.iter().map(|f| f.name.name()).collect()
    }

    /// Draws the residual over time, of the model that was diagnosed and of the extended one: over the test record, or else the training record.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     Where to draw; a new figure if not given.
    /// **options
    ///     Of both lines, as in ``matplotlib.axes.Axes.plot``.
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
        let said = [models.into_bound_py_any(py)?, record.into_bound_py_any(py)?, zero.into_bound_py_any(py)?];
        plot::drawn("diagnosis", slf.as_any(), &said, ax, options)
    }

    /// Whether both found the same.
    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| {
            let (own, other) = (&self.found, &other.get().found);
            own.extended == other.extended && own.findings == other.findings
        })
    }
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        pickle::reduced(slf.as_any(), &Kept::of(slf.get())?)
    }

    /// The object of what `__reduce__` keeps.
    #[staticmethod]
    fn _restore(state: &[u8]) -> PyResult<Self> {
        pickle::restored::<Kept>(state)?.diagnosis()
    }

    /// Writes the report: one page of HTML with plots, which loads nothing.
    ///
    /// Parameters
    /// ----------
    /// path : str or path-like
    ///     The file; one that is there is replaced.
    fn report(&self, path: PathBuf) -> PyResult<()> {
        let page = self.page()?;
        write_atomic(&path, |out| out.write_all(page.as_bytes())).map_err(errors::written)
    }

    /// The report in a frame of its own: its style and its scripts stay there.
    fn _repr_html_(&self) -> PyResult<String> {
        let page = self.page()?.replace('&', "&amp;").replace('"', "&quot;");
        Ok(format!("<iframe srcdoc=\"{page}\" style=\"width:100%;height:640px;border:1px solid #ccc\"></iframe>"))
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
/// progress : bool or callable, optional
///     Whether a bar (tqdm) shows what is being done; in a terminal or a notebook if not given. A function is given it in words; an exception that it
///     raises ends the diagnosis, as Ctrl-C does.
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
    let work = |stop: &Arc<AtomicBool>, says: Sender<String>| {
        let says = Mutex::new(says);
        let tell = |doing: &str| {
            // Nobody listens once an exception is under way.
            let _ = says.lock().map(|says| says.send(doing.to_owned()));
        };
        diagnosis::diagnose_until(&train, test.as_deref(), model, &options, &tell, &Stop::from(Arc::clone(stop)))
    };
    let mut bar = Bar::new("diagnose", progress);
    let found = interruptible(py, work, |py, doing: String| bar.say(py, &doing));
    bar.close(py)?;
    let found = found?.map_err(errors::fit)?;
    Ok(Diagnosis { found, model: model.clone(), train, test, zero: options.zero, seed })
}
