//! Fits a base model to a record.

pub(crate) mod convex;
mod options;
mod searched;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::{ControlFlow, Range};

use hyst_core::{Grid, PiParams, ViscousPiParams};

use crate::BetweenSamples;
use crate::base::{Basis, DragParams, LinearisedBasis, PiBasis, PreisachBasis};
use crate::criteria::{MIN_RMSE_DROP, MINOR_SHARE};
use crate::identify::{Estimate, TableEstimate};
use crate::lsq::Blocks;
use crate::memory;
use crate::model::{Base, Channel, Effects, FittedOn, Kind, Model, ModelError, ZERO};
use crate::nested::{Fitted, Hypothesis, Problem};
use crate::optimize::{Progress, Trials};
use crate::record::{Record, RecordError};
use crate::samples::Samples;
use crate::settle::{start_up_rows, started, windows, without_beginnings};
use crate::simulate::{Zero, simulate};

/// A fit, and its residual in some rows or in every row \[y\].
type FitAndResidual = (Fitted, Vec<f64>);
/// Estimates the drive history of each segment from a fit and its residual in every row. The first flags mark the
/// segments to estimate, the second ones those in which a memory other than rest is expected.
type Recalls<'a> = dyn Fn(&Samples, &FitAndResidual, &[bool], &[bool]) -> Result<Vec<Vec<f64>>, FitError> + 'a;

/// Maximum number of estimates of the drive history, each from the fit with the previous one.
const RECALLS: usize = 2;
/// Cells along one edge of the Preisach triangle.
pub(crate) const CELLS: usize = 24;
/// Minimum number of cells along an edge, for a short record.
const MIN_CELLS: usize = 8;
/// Minimum number of rows for each unknown.
pub(crate) const ROWS_PER_UNKNOWN: usize = 3;
/// Number of blocks of a record.
pub(crate) const BLOCKS: usize = 64;
/// Maximum number of rows of a fit; longer records are thinned evenly after filtering.
pub(crate) const ROWS: usize = 40_000;

/// Reason why a fit is impossible.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// The record cannot be used as it is.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The fit was stopped by the caller.
    #[error("{record}: stopped before the result was complete")]
    Stopped {
        /// The record.
        record: String,
    },
    /// Not enough rows.
    #[error(
        "{record}: {rows} rows (without start-up rows) are too few for {unknowns} unknowns; record at least {needed} rows or fit a smaller model"
    )]
    TooShort {
        /// The record.
        record: String,
        /// Number of rows without start-up rows.
        rows: usize,
        /// Number of unknowns of the model.
        unknowns: usize,
        /// Minimum number of rows.
        needed: usize,
    },
    /// The input is constant.
    #[error(
        "{record}: column {column}: the input is constant ({value}), so the record shows no hysteresis; drive the actuator, e.g. with \
         `hystctl excite identification`"
    )]
    ConstantInput {
        /// The record.
        record: String,
        /// The input's column.
        column: String,
        /// Its value.
        value: f64,
    },
    /// The output is constant.
    #[error(
        "{record}: column {column}: the output is constant ({value}) while the input moves; check the sensor and `--map`"
    )]
    ConstantOutput {
        /// The record.
        record: String,
        /// The output's column.
        column: String,
        /// Its value.
        value: f64,
    },
    /// The output has the opposite sign to that of the model.
    #[error(
        "{record}: the output has the opposite sign to the model's; invert it with --map {column}=-COLUMN (COLUMN is its name in the file), \
         remove the minus sign of an existing --map, or refit the model to this record"
    )]
    Falling {
        /// The record.
        record: String,
        /// The output's name in the record format.
        column: &'static str,
    },
    /// A required column is missing.
    #[error("{record}: column {column} is missing; {advice}")]
    Missing {
        /// The record.
        record: String,
        /// The column.
        column: String,
        /// What to do.
        advice: String,
    },
    /// The equations could not be solved.
    #[error("{record}: the equations of the fit could not be solved; look for outliers in the record")]
    Unsolvable {
        /// The record.
        record: String,
    },
    /// A stage cannot be built.
    #[error("{record}: {source}")]
    Stage {
        /// The record.
        record: String,
        /// Reason.
        source: hyst_core::Error,
    },
    /// Prediction and measurement cannot be compared.
    #[error("{record}: {source}")]
    Compare {
        /// The record.
        record: String,
        /// Reason.
        source: crate::metrics::MetricsError,
    },
    /// Invalid bounds.
    #[error("{record}: {source}")]
    Space {
        /// The record.
        record: String,
        /// Reason.
        source: crate::optimize::SpaceError,
    },
    /// A search that cannot be run or that finds nothing.
    #[error("{record}: {source}")]
    Search {
        /// The record.
        record: String,
        /// Reason.
        source: crate::optimize::SearchError,
    },
    /// Bounds for a variable that is not searched.
    #[error("bounds of {name}: {kind} has no such variable; it searches {names}")]
    UnknownBounds {
        /// The name given.
        name: String,
        /// The kind of model.
        kind: &'static str,
        /// The searched variables.
        names: String,
    },
    /// An optimizer that the model does not support.
    #[error("{kind} does not support {optimizer}; {advice}")]
    Optimizer {
        /// The kind of model.
        kind: &'static str,
        /// The requested optimizer.
        optimizer: String,
        /// Available optimizers.
        advice: &'static str,
    },
    /// A drive that is band-limited between samples, for a model that does not support it.
    #[error(
        "{kind}: only bouc-wen-oscillator supports a drive that is band-limited between samples; use --between-samples linear"
    )]
    BandLimited {
        /// The kind of model.
        kind: &'static str,
    },
    /// A number of thresholds for a model without selectable thresholds.
    #[error("{kind}: a number of thresholds applies only to the convex fit of pi; {advice}")]
    Thresholds {
        /// The kind of model.
        kind: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// A number of elements outside of the allowed range.
    #[error("{elements} elements; expected 1 to {most}")]
    Elements {
        /// The requested number.
        elements: usize,
        /// The maximum.
        most: usize,
    },
    /// First-order descent curves without a valid surface.
    #[error(transparent)]
    Everett(#[from] crate::everett::EverettError),
    /// A model that does not suit the record.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A base that is not linear in its weights.
    #[error("{kind} is not linear in its weights: its parameters are searched")]
    NoBasis {
        /// The kind of model.
        kind: &'static str,
    },
}

pub use options::{FitOptions, Optimizer, VariableBounds};

/// A model and the details of its fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// Description of the fit: what was searched, what was solved for, and why.
    pub how: String,
    /// Standard errors and correlations of the parameters; `None` if the parameters are elements of a table.
    pub estimate: Option<Estimate>,
    /// How well the record determines the cells of a Preisach triangle and the nodes of a mirror function.
    pub tables: Vec<TableEstimate>,
    /// The searches; `None` if nothing was searched.
    pub trials: Option<Trials>,
    /// Evaluations of the model.
    pub evaluations: u64,
    /// RMS residual for each interpolation of the drive between samples that was tried \[y\].
    /// Each is fitted to all rows; rows that are start-up for any of them do not count. The model uses the better one.
    pub between_samples: Vec<(BetweenSamples, f64)>,
}

impl Fit {
    /// Returns a fit without a search.
    pub fn at_once(model: Model, how: &str) -> Self {
        let (estimate, tables, trials, between_samples) = (None, Vec::new(), None, Vec::new());
        Self { model, how: how.into(), estimate, tables, trials, evaluations: 1, between_samples }
    }
}

/// Fits a base model to a record; start-up rows are left out.
///
/// # Errors
/// See [`FitError`].
pub fn fit(record: &Record, kind: Kind, options: &FitOptions) -> Result<Model, FitError> {
    fit_with(record, kind, options, &mut |_| ControlFlow::Continue(())).map(|fit| fit.model)
}

/// Fits as [`fit`] does and returns the details.
///
/// `watch` is called after every generation of a search and may end it. The best result so far is then polished and
/// returned.
///
/// # Errors
/// See [`FitError`].
pub fn fit_with(
    record: &Record,
    kind: Kind,
    options: &FitOptions,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    if options.form.between_samples == Some(BetweenSamples::BandLimited) && kind != Kind::BoucWenOscillator {
        return Err(FitError::BandLimited { kind: kind.name() });
    }
    options.suits(kind)?;
    let convex = options.convex();
    let mut fit: Fit = match kind {
        Kind::Pi | Kind::Preisach if convex => convex::fit(record, kind, options)?,
        Kind::Dpm if convex => crate::everett::fit_dpm(record, options)?.into(),
        _ => searched::fit(record, kind, options, watch)?,
    };
    let zero = if options.zero_per_record { Zero::PerRecord } else { Zero::None };
    fit.model.rmse = simulate(&fit.model, record, zero)?.errors.map(|errors| errors.rmse);
    Ok(fit)
}

/// Returns whether the sign of the output is a property of the model.
pub(crate) fn sign_matters(kind: Kind) -> bool {
    // The phase of an oscillator lags by up to 180°.
    kind != Kind::BoucWenOscillator
}

/// A basis of a kind, with the grid or the thresholds for a record.
#[derive(Clone)]
pub(crate) enum BasisOf {
    Pi(PiBasis),
    Preisach(PreisachBasis),
    /// A linearised operator of another kind.
    Linearised(Box<LinearisedBasis>),
}

impl BasisOf {
    pub(crate) fn as_ref(&self) -> &dyn Basis {
        match self {
            Self::Pi(b) => b,
            Self::Preisach(b) => b,
            Self::Linearised(b) => b.as_ref(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.as_ref().len()
    }

    /// Returns the operator with these weights. Weights below 1e-9 of their sum are solver residue and set to zero.
    pub(crate) fn operator(&self, weights: &[f64]) -> Base {
        let smallest = 1e-9 * weights.iter().map(|w| w.abs()).sum::<f64>();
        let clean: Vec<f64> = weights.iter().map(|w| if w.abs() < smallest { 0.0 } else { *w }).collect();
        match self {
            Self::Pi(b) => {
                Base::Pi(PiParams { gain: clean[0], thresholds: b.thresholds.clone(), weights: clean[1..].to_vec() })
            }
            Self::Preisach(b) => Base::Preisach(b.spec(&clean)),
            Self::Linearised(b) => b.operator(weights),
        }
    }
}

pub(crate) fn basis_for(kind: Kind, samples: &Samples) -> Result<BasisOf, FitError> {
    Ok(match kind {
        Kind::Pi => BasisOf::Pi(PiBasis::for_samples(samples)),
        Kind::Preisach => {
            // A short record determines a coarser triangle.
            let most = samples.len() / ROWS_PER_UNKNOWN;
            let finest = |cells: &usize| PreisachBasis::for_samples(samples, *cells).len() <= most;
            let cells = (MIN_CELLS..=CELLS).rev().find(finest).unwrap_or(MIN_CELLS);
            BasisOf::Preisach(PreisachBasis::for_samples(samples, cells))
        }
        other => return Err(FitError::NoBasis { kind: other.name() }),
    })
}

/// Returns the basis of a model's base for a record that it was fitted to, with its own thresholds or grid.
pub(crate) fn basis_of(model: &Model, samples: &Samples) -> Result<BasisOf, hyst_core::Error> {
    Ok(match &model.base {
        Base::Pi(PiParams { thresholds, .. })
        | Base::ViscousPi(ViscousPiParams { pi: PiParams { thresholds, .. }, .. }) => {
            BasisOf::Pi(PiBasis { thresholds: thresholds.clone(), ..PiBasis::for_samples(samples) })
        }
        Base::Preisach(spec) => {
            let grid = Grid { low: spec.low, high: spec.high, cells: spec.cells };
            BasisOf::Preisach(PreisachBasis {
                grid,
                rest: spec.rest,
                ..PreisachBasis::for_samples(samples, spec.cells)
            })
        }
        _ => BasisOf::Linearised(Box::new(LinearisedBasis::new(
            &model.base,
            model.falls,
            model.between_samples,
            samples,
        )?)),
    })
}

/// Checks whether a record can be fitted; `wrong_sign` means that its output has the opposite sign to the model's.
pub(crate) fn check(record: &Record, samples: &Samples, wrong_sign: bool) -> Result<(), FitError> {
    let name = record.name();
    let Some(unit) = record.output_unit() else {
        return Err(FitError::Missing {
            record: name,
            column: "displacement_um".into(),
            advice: "a fit needs the measured output".into(),
        });
    };
    if record.input().is_empty() {
        return Err(FitError::Missing {
            record: name,
            column: "voltage_v".into(),
            advice: "a fit needs the drive".into(),
        });
    }
    let (low, high) = samples.input_range();
    if high - low <= 1e-9 * high.abs().max(low.abs()).max(f64::MIN_POSITIVE) {
        return Err(FitError::ConstantInput { record: name, column: record.input_column().into(), value: low });
    }
    let (least, most) = crate::samples::range(samples.output.iter().copied());
    if most - least <= 1e-12 * most.abs().max(least.abs()).max(f64::MIN_POSITIVE) {
        return Err(FitError::ConstantOutput { record: name, column: unit.column().into(), value: least });
    }
    if wrong_sign {
        return Err(FitError::Falling { record: name, column: unit.column() });
    }
    Ok(())
}

/// Fits the basis and finds the start-up rows and the drive history of each segment. Sets `samples.settling` and
/// `samples.pasts`. Returns the fit and its residual in the rows that it used.
pub(crate) fn fit_settled(
    samples: &mut Samples,
    basis: &dyn Basis,
    options: &FitOptions,
    name: &dyn Fn() -> String,
) -> Result<FitAndResidual, FitError> {
    let run = |samples: &Samples, basis: &dyn Basis| everywhere(samples, basis, options.zero_per_record, name);
    let mut all = run(samples, basis)?;
    if samples.mark_spikes(&all.1) {
        all = run(samples, basis)?;
    }
    let (mut found, late) = start_up_found(samples, all, None, |samples| run(samples, basis))?;
    if memory::standing_out_where_followed(samples, &late.1).contains(&true) {
        // The drive history is estimated with play operators for every base: their few unknowns need few rows.
        samples.settling.copy_from_slice(&samples.blind);
        let plays = PiBasis::for_samples(samples);
        let recalls = |samples: &Samples, (fitted, residual): &FitAndResidual, asked: &[bool], surely: &[bool]| {
            let blocks = Blocks::new(samples, BLOCKS, ROWS);
            let problem = Problem::new(samples, &plays, &blocks, options.zero_per_record);
            memory::recalled(&problem, fitted, residual, asked, surely)
                .map_err(|source| FitError::Stage { record: name(), source })
        };
        let by_plays = recalled(samples, |samples| run(samples, &plays), &recalls)?;
        samples.settling.copy_from_slice(&samples.blind);
        let all = run(samples, basis)?;
        (found, _) = start_up_found(samples, all, Some(&by_plays), |samples| run(samples, basis))?;
    }
    Ok(within(samples, found))
}

/// Estimates the drive history of each segment with play operators and sets `samples.pasts`. Returns their residual in
/// each row.
fn recalled(
    samples: &mut Samples,
    run: impl Fn(&Samples) -> Result<FitAndResidual, FitError>,
    recalls: &Recalls<'_>,
) -> Result<Vec<f64>, FitError> {
    let (mut found, mut late) = start_up_found(samples, run(samples)?, None, &run)?;
    let asked = memory::standing_out_where_followed(samples, &late.1);
    if !asked.contains(&true) {
        return Ok(found.1);
    }
    // A part of the history shows in the whole record. Without a start-up, or near 0 V where a sensor transient may be
    // the cause, only the last reversals are estimated.
    let rest = without_beginnings(samples);
    let starts = started(samples, &samples.settling);
    let surely: Vec<bool> = memory::away(samples).iter().zip(starts).map(|(away, starts)| *away && starts).collect();
    let histories =
        memory::with_histories(&rest, &surely, &mut |samples: &Samples| Ok::<_, FitError>(run(samples)?.0.squares))?;
    if histories.pasts != samples.pasts {
        samples.pasts = histories.pasts;
        samples.settling.copy_from_slice(&samples.blind);
        let all = run(samples)?;
        (found, late) = start_up_found(samples, all, None, &run)?;
    }
    for _ in 0..RECALLS {
        let pasts = memory::kept(&samples.pasts, recalls(samples, &late, &asked, &surely)?);
        if pasts == samples.pasts {
            break;
        }
        let mut recalled = Samples { pasts, settling: samples.blind.clone(), ..samples.clone() };
        let all = run(&recalled)?;
        let with_past = start_up_found(&mut recalled, all, None, &run)?;
        let count = |samples: &Samples| samples.settling.iter().filter(|s| **s).count();
        // The history must leave fewer start-up rows, or as many and a clearly smaller error.
        let (now, then) = (count(samples), count(&recalled));
        let errs_less = with_past.0.0.rmse() <= (1.0 - MIN_RMSE_DROP) * found.0.rmse();
        if then > now || (then == now && !errs_less) {
            break;
        }
        *samples = recalled;
        (found, late) = with_past;
    }
    Ok(found.1)
}

/// Finds the start-up rows, given a fit to all rows, and sets `samples.settling`. Returns the fit to the rows that
/// count and the fit without the start-up windows. `beside` is the residual of another basis in each row.
fn start_up_found(
    samples: &mut Samples,
    all: FitAndResidual,
    beside: Option<&[f64]>,
    run: impl Fn(&Samples) -> Result<FitAndResidual, FitError>,
) -> Result<(FitAndResidual, FitAndResidual), FitError> {
    let windows = windows(samples);
    let without = without_beginnings(samples);
    let late = run(&without)?;
    let rms_late = |r: &[f64]| {
        let kept = r.iter().zip(&without.settling).filter(|(_, s)| !**s);
        let (sum, n) = kept.fold((0.0, 0usize), |(sum, n), (r, _)| (sum + r * r, n + 1));
        (sum / n.max(1) as f64).sqrt()
    };
    // If the fit without the start-up windows is much better on the rest, the windows disagree with the rest and are
    // judged by that fit. The same applies if a record starts away from 0 V, because its memory is unknown. Otherwise
    // they belong to the record and contain its virgin curve.
    let (low, high) = samples.input_range();
    let away = samples.segments.iter().any(|s| samples.input[s.start].abs() > MINOR_SHARE * low.abs().max(high.abs()));
    let judged_late = away || rms_late(&all.1) > 1.5 * rms_late(&late.1);
    let mut residual = if judged_late { late.1.clone() } else { all.1.clone() };
    // A fit without these rows may lack weights that only they determine. Rows that the other basis follows are no
    // start-up rows.
    if let Some(beside) = beside.filter(|_| judged_late) {
        for (s, w) in samples.segments.iter().zip(&windows) {
            let rows = s.start..s.start + w;
            let squares = |r: &[f64]| rows.clone().filter(|k| !samples.blind[*k]).map(|k| r[k] * r[k]).sum::<f64>();
            if squares(beside) < squares(&residual) {
                residual[rows.clone()].copy_from_slice(&beside[rows]);
            }
        }
    }
    samples.settling = start_up_rows(samples, &residual);
    let found = if samples.settling.iter().any(|s| *s) { run(samples)? } else { all };
    Ok((found, late))
}

/// Fits the rows that count. Returns the fit and its residual in every row.
fn everywhere(
    samples: &Samples,
    basis: &dyn Basis,
    zero_per_file: bool,
    name: &dyn Fn() -> String,
) -> Result<FitAndResidual, FitError> {
    let blocks = Blocks::new(samples, BLOCKS, ROWS);
    let problem = Problem::new(samples, basis, &blocks, zero_per_file);
    let stage = |source| FitError::Stage { record: name(), source };
    let fitted =
        problem.fit(&Hypothesis::default()).map_err(stage)?.ok_or_else(|| FitError::Unsolvable { record: name() })?;
    let residual = problem.residual(&fitted).map_err(stage)?;
    Ok((fitted, residual))
}

/// Reduces the residual of a fit to the rows that the fit used.
fn within(samples: &Samples, (fitted, residual): FitAndResidual) -> FitAndResidual {
    let left = Blocks::new(samples, BLOCKS, ROWS).all_used(samples).map(|k| residual[k]).collect();
    (fitted, left)
}

/// Fits the rows that count. Returns the fit and its residual in the rows that it used.
fn solved(
    samples: &Samples,
    basis: &dyn Basis,
    zero_per_file: bool,
    name: &dyn Fn() -> String,
) -> Result<FitAndResidual, FitError> {
    Ok(within(samples, everywhere(samples, basis, zero_per_file, name)?))
}

/// Adds the standard errors to a model, and the names of the parameters that the record does not determine.
fn with_errors(mut model: Model, estimate: &Estimate) -> Model {
    let stage = model.base.kind().name();
    // The sensor's zero belongs to no stage.
    let key = |name: &str| if name == ZERO { name.into() } else { format!("{stage}.{name}") };
    let finite = estimate.parameters.iter().filter(|p| p.std_error.is_finite());
    model.std_errors = finite.map(|p| (key(&p.name), p.std_error)).collect();
    model.undetermined = estimate.undetermined().into_iter().filter(|name| *name != ZERO).map(key).collect();
    model
}

/// Builds a model from a fit.
pub(crate) fn to_model(record: &Record, samples: &Samples, basis: &BasisOf, fitted: &Fitted, seed: u64) -> Model {
    let zero = fitted.zeros.iter().sum::<f64>() / fitted.zeros.len().max(1) as f64;
    let base = match (basis.operator(&fitted.weights), fitted.hypothesis.drag) {
        (Base::Pi(pi), Some(DragParams { seconds, volt_seconds })) => {
            Base::ViscousPi(ViscousPiParams { pi, seconds, volt_seconds })
        }
        (base, _) => base,
    };
    Model { effects: fitted.hypothesis.effects.clone(), ..model_of(record, samples, base, zero, seed) }
}

/// Builds a model without effects that was fitted to the settled rows of a record.
pub(crate) fn model_of(record: &Record, samples: &Samples, base: Base, zero: f64, seed: u64) -> Model {
    let unit = record.output_unit();
    let (low, high) = samples.input_range();
    let (least, most) = crate::samples::range(samples.settled_output());
    Model {
        input: Channel { column: record.input_column().into(), unit: unit_of(record.input_column()), low, high },
        between_samples: BetweenSamples::Linear,
        output: Channel {
            column: unit.map_or("", |u| u.column()).into(),
            unit: unit.map_or("", |u| u.suffix()).into(),
            low: least,
            high: most,
        },
        falls: samples.falls,
        zero,
        base,
        effects: Effects::default(),
        std_errors: BTreeMap::new(),
        undetermined: BTreeSet::new(),
        rmse: None,
        recorded_at_hz: 1.0 / samples.period,
        fitted_on: fitted_on(record, samples),
        seed,
        version: env!("CARGO_PKG_VERSION").into(),
    }
}

fn fitted_on(record: &Record, samples: &Samples) -> Vec<FittedOn> {
    let of_file = |(source, rows): (&crate::record::Source, Range<usize>)| {
        let settling_rows = samples.settling[rows.clone()].iter().filter(|s| **s).count();
        FittedOn {
            file: std::path::Path::new(&source.name)
                .file_name()
                .map_or_else(|| source.name.clone(), |n| n.to_string_lossy().into_owned()),
            sha256: source.sha256.clone().unwrap_or_default(),
            rows: rows.len() - settling_rows,
            settling_rows,
        }
    };
    record.sources().iter().zip(record.rows_of_files()).map(of_file).collect()
}

/// Returns the unit from the suffix of a column's name.
pub(crate) fn unit_of(column: &str) -> String {
    match column.rsplit('_').next() {
        Some("v") => "V".into(),
        Some("n") => "N".into(),
        Some(other) => other.into(),
        None => String::new(),
    }
}
