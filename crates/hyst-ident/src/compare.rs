//! Fits all models to a record and compares them.
//!
//! Each model is fitted to the training record only and simulated on it and on the test record. All are judged on the
//! same rows: rows that are start-up rows for any of them do not count.

use std::ops::ControlFlow;
use std::time::Instant;

use hyst_core::PreisachParams;
use serde::{Serialize, Serializer};

use crate::fit::{Fit, FitError, FitOptions, fit_with};
use crate::identify::{TableEstimate, parameters_of};
use crate::metrics::{Errors, Mape, MetricsError, mape, peak_to_valley, smape};
use crate::model::{Base, Kind};
use crate::record::Record;
use crate::simulate::{Simulation, Zero, simulate};

/// Key by which the models are sorted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SortedBy {
    /// RMSE on the training record.
    /// A model with more parameters has a smaller RMSE here even if it predicts no better.
    TrainRmse,
    /// RMSE on the test record, which no model has seen.
    TestRmse,
}

/// Errors of a model's prediction of a record.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// RMSE, its share of the span, maximum error.
    #[serde(flatten)]
    pub errors: Errors,
    /// Mean absolute error relative to the measurement, without rows near zero.
    pub mape: Mape,
    /// Symmetric mean absolute error, a ratio between 0 and 2.
    pub smape: f64,
    /// Maximum minus minimum of the signed error \[output unit\].
    pub peak_to_valley: f64,
}

impl Figures {
    /// Computes the errors; `settling` flags the rows that do not count.
    ///
    /// # Errors
    /// As [`Errors::of`].
    pub fn of(measured: &[f64], predicted: &[f64], settling: &[bool]) -> Result<Self, MetricsError> {
        Ok(Self {
            errors: Errors::of(measured, predicted, settling)?,
            mape: mape(measured, predicted, settling)?,
            smape: smape(measured, predicted, settling)?,
            peak_to_valley: peak_to_valley(measured, predicted, settling)?,
        })
    }
}

/// One model on the records.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// Kind.
    #[serde(rename = "model", serialize_with = "as_name")]
    pub kind: Kind,
    /// Number of identified parameters, without the sensor's zero.
    pub parameters: usize,
    /// Parameters that the record does not determine, or only together with others.
    /// `None` if the parameters are elements of `tables`.
    pub undetermined: Option<Vec<String>>,
    /// Determination of each element of a table of weights (cells, nodes) by the record.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<TableEstimate>,
    /// On the training record.
    pub train: Figures,
    /// On the test record, if there is one.
    pub test: Option<Figures>,
    /// Description of the fit.
    pub how: String,
    /// Evaluations of the model.
    pub evaluations: u64,
    /// Duration of the fit \[s\]: the only field that differs between two runs.
    pub fit_seconds: f64,
    /// The fit.
    #[serde(skip)]
    pub fit: Fit,
    /// Prediction for each row of the training record \[output unit\].
    #[serde(skip)]
    pub train_predicted: Vec<f64>,
    /// Prediction for each row of the test record \[output unit\].
    #[serde(skip)]
    pub test_predicted: Vec<f64>,
}

impl Compared {
    /// Returns the RMSE by which the model is sorted.
    fn rmse(&self) -> f64 {
        self.test.unwrap_or(self.train).errors.rmse
    }
}

/// A model that was not fitted.
#[derive(Clone, Debug, Serialize)]
pub struct Skipped {
    /// Kind.
    #[serde(rename = "model", serialize_with = "as_name")]
    pub kind: Kind,
    /// Why it was not fitted, and what it requires.
    pub reason: String,
}

/// Result of a comparison.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Key by which the models are sorted.
    pub sorted_by: SortedBy,
    /// The models, best first.
    pub models: Vec<Compared>,
    /// Models that were not fitted, with the reason.
    pub skipped: Vec<Skipped>,
    /// Rows of the training record that do not count.
    #[serde(skip)]
    pub train_settling: Vec<bool>,
    /// Rows of the test record that do not count.
    #[serde(skip)]
    pub test_settling: Vec<bool>,
}

/// Progress of a comparison.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// The model that is being fitted.
    pub kind: Kind,
    /// Number of finished models.
    pub done: usize,
    /// Number of models.
    pub of: usize,
    /// Evaluations of the current search and their maximum; 0 of 0 before it starts.
    pub evaluations: (u64, u64),
}

fn as_name<S: Serializer>(kind: &Kind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.name())
}

/// A model that was fitted and simulated but not yet judged.
struct Run {
    kind: Kind,
    fit: Fit,
    seconds: f64,
    train: Simulation,
    test: Option<Simulation>,
}

/// Fits each of `kinds` to `train` with the same options and simulates it on both records.
///
/// A model that cannot be fitted is skipped with the reason. `watch` is called at every step and may end the
/// comparison; a running search then ends with its best result so far, and no other model is fitted.
///
/// # Errors
/// If no model can be fitted: the reason of the first.
pub fn compare(
    train: &Record,
    test: Option<&Record>,
    kinds: &[Kind],
    options: &FitOptions,
    watch: &mut dyn FnMut(Step) -> ControlFlow<()>,
) -> Result<Comparison, FitError> {
    let zero = if options.zero_per_record { Zero::PerRecord } else { Zero::None };
    let (mut runs, mut skipped, mut first) = (Vec::new(), Vec::new(), None);
    for (done, kind) in kinds.iter().copied().enumerate() {
        let mut step = Step { kind, done, of: kinds.len(), evaluations: (0, 0) };
        if watch(step).is_break() {
            break;
        }
        let began = Instant::now();
        let fitted = fit_with(train, kind, options, &mut |p| {
            step.evaluations = (p.evaluations, p.budget);
            watch(step)
        });
        let seconds = began.elapsed().as_secs_f64();
        let run = fitted.and_then(|fit| {
            let test = test.map(|test| simulate(&fit.model, test, zero)).transpose()?;
            Ok(Run { kind, seconds, train: simulate(&fit.model, train, zero)?, test, fit })
        });
        match run {
            Ok(run) => runs.push(run),
            Err(error) => {
                skipped.push(Skipped { kind, reason: error.to_string() });
                first.get_or_insert(error);
            }
        }
    }
    if let (true, Some(error)) = (runs.is_empty(), first) {
        return Err(error);
    }
    let train_settling = for_any(train.rows(), runs.iter().map(|r| &r.train));
    let test_settling = for_any(test.map_or(0, Record::rows), runs.iter().filter_map(|r| r.test.as_ref()));
    let figures = |record: &Record, predicted: &[f64], settling: &[bool]| {
        Figures::of(record.output().unwrap_or_default(), predicted, settling)
            .map_err(|source| FitError::Compare { record: record.name(), source })
    };
    let judged = |run: Run| -> Result<Compared, FitError> {
        let test_predicted = run.test.map_or_else(Vec::new, |s| s.predicted);
        Ok(Compared {
            kind: run.kind,
            parameters: identified(&run.fit),
            undetermined: undetermined(&run.fit),
            tables: run.fit.tables.clone(),
            train: figures(train, &run.train.predicted, &train_settling)?,
            test: test.map(|test| figures(test, &test_predicted, &test_settling)).transpose()?,
            how: run.fit.how.clone(),
            evaluations: run.fit.evaluations,
            fit_seconds: run.seconds,
            fit: run.fit,
            train_predicted: run.train.predicted,
            test_predicted,
        })
    };
    let mut models = runs.into_iter().map(judged).collect::<Result<Vec<_>, _>>()?;
    models.sort_by(|a, b| a.rmse().total_cmp(&b.rmse()));
    let sorted_by = if test.is_some() { SortedBy::TestRmse } else { SortedBy::TrainRmse };
    Ok(Comparison { sorted_by, models, skipped, train_settling, test_settling })
}

/// Returns the rows that are start-up rows for any of the models.
fn for_any<'a>(rows: usize, simulated: impl Iterator<Item = &'a Simulation>) -> Vec<bool> {
    let mut settling = vec![false; rows];
    for own in simulated {
        settling.iter_mut().zip(&own.settling).for_each(|(any, own)| *any |= *own);
    }
    settling
}

/// Returns the number of fitted parameters: those of the estimate, or the cells and nodes of a convex fit, whose grid
/// is given.
fn identified(fit: &Fit) -> usize {
    if let Some(estimate) = &fit.estimate {
        return estimate.fitted;
    }
    // Relays that never switch back are counted only if there are any.
    let cells = |p: &PreisachParams<Vec<f64>>| {
        p.density.len() + if p.once.iter().any(|w| *w != 0.0) { p.once.len() } else { 0 }
    };
    match &fit.model.base {
        Base::Preisach(p) => cells(p),
        Base::Dpm(p) => cells(&p.preisach) + p.mirror.weights.len(),
        other => parameters_of(other).len(),
    }
}

fn undetermined(fit: &Fit) -> Option<Vec<String>> {
    fit.estimate.as_ref().map(|e| e.undetermined().into_iter().map(str::to_owned).collect())
}
