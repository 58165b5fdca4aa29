//! `fit`: a base model from a record.

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

/// A fit, and what it leaves in some rows or in every row \[y\].
type Left = (Fitted, Vec<f64>);
/// The past of each segment, as a fit with what it leaves in every row calls for it where it is asked for, and where it is no surprise.
type Recalls<'a> = dyn Fn(&Samples, &Left, &[bool], &[bool]) -> Result<Vec<Vec<f64>>, FitError> + 'a;

/// How often the past of a record is asked for, each time with what was fitted to the rows that the last one explains.
const RECALLS: usize = 2;
/// Cells along one edge of the Preisach triangle.
pub(crate) const CELLS: usize = 24;
/// And of the coarsest, for a short record.
const MIN_CELLS: usize = 8;
/// Rows for each unknown that a fit needs.
pub(crate) const ROWS_EACH: usize = 3;
/// Blocks of a record.
pub(crate) const BLOCKS: usize = 64;
/// Rows that one fit uses at most; longer records are thinned evenly after filtering.
pub(crate) const ROWS: usize = 40_000;

/// Why a fit is impossible.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// The record cannot be used as it is.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// It was ended from outside.
    #[error("{record}: stopped before it was done")]
    Stopped {
        /// The record.
        record: String,
    },
    /// Not enough rows.
    #[error(
        "{record}: {rows} settled rows are too few for {unknowns} unknowns; record at least {needed}, or fit a smaller model"
    )]
    TooShort {
        /// The record.
        record: String,
        /// Rows that it has.
        rows: usize,
        /// Unknowns of the model.
        unknowns: usize,
        /// Rows that would do.
        needed: usize,
    },
    /// The input does not move.
    #[error(
        "{record}: column {column}: the input is constant ({value}), so the record shows no hysteresis; drive the actuator, e.g. with `hystctl excite identification`"
    )]
    ConstantInput {
        /// The record.
        record: String,
        /// The input's column.
        column: String,
        /// Its value.
        value: f64,
    },
    /// The output does not move.
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
    /// The output falls where that of the model rises, or the other way round.
    #[error(
        "{record}: the output has the other sign than the model's; turn it with --map {column}=-COLUMN, where COLUMN is its name in the file, take out the minus that a --map has already, or fit the model anew to this record"
    )]
    Falling {
        /// The record.
        record: String,
        /// The output's name in the record format.
        column: &'static str,
    },
    /// A column is needed.
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
    #[error("{record}: the equations of the fit could not be solved; look for rows that are far off the others")]
    Unsolvable {
        /// The record.
        record: String,
    },
    /// A stage cannot be built.
    #[error("{record}: {source}")]
    Stage {
        /// The record.
        record: String,
        /// Why.
        source: hyst_core::Error,
    },
    /// Prediction and measurement cannot be compared.
    #[error("{record}: {source}")]
    Compare {
        /// The record.
        record: String,
        /// Why.
        source: crate::metrics::MetricsError,
    },
    /// Bounds that are no box.
    #[error("{record}: {source}")]
    Space {
        /// The record.
        record: String,
        /// What is wrong.
        source: crate::optimize::SpaceError,
    },
    /// A search that cannot be run or finds nothing.
    #[error("{record}: {source}")]
    Search {
        /// The record.
        record: String,
        /// Why.
        source: crate::optimize::SearchError,
    },
    /// Bounds of what is not searched.
    #[error("bounds of {name}: {kind} has no such variable; it searches {names}")]
    UnknownBounds {
        /// The name given.
        name: String,
        /// The kind of model.
        kind: &'static str,
        /// What it searches.
        names: String,
    },
    /// A way to optimise that the model does not have.
    #[error("{kind}: {optimizer} does not fit it; {advice}")]
    Optimizer {
        /// The kind of model.
        kind: &'static str,
        /// The way that was asked for.
        optimizer: String,
        /// Which there are.
        advice: &'static str,
    },
    /// A drive that is band-limited between samples, for a model that does not look there.
    #[error(
        "{kind}: a drive that is band-limited between samples is for bouc-wen-oscillator in this version; take it as linear"
    )]
    BandLimited {
        /// The kind of model.
        kind: &'static str,
    },
    /// Thresholds chosen where there are none to choose.
    #[error("{kind}: a number of thresholds is for the convex fit of pi; {advice}")]
    Thresholds {
        /// The kind of model.
        kind: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// More elements than a model can have, or none.
    #[error("{elements} elements: a model has 1 to {most}")]
    Elements {
        /// What was asked for.
        elements: usize,
        /// The most.
        most: usize,
    },
    /// First-order descent curves that give no surface.
    #[error(transparent)]
    Everett(#[from] crate::everett::EverettError),
    /// A model does not suit the record.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A base that is not linear in its weights.
    #[error("{kind} is no sum of columns with weights: its parameters are searched")]
    NoBasis {
        /// The kind of model.
        kind: &'static str,
    },
}

pub use options::{FitOptions, Optimizer, VariableBounds};

/// A model, and how it was found.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// In words: what was searched, what was solved for, and why so.
    pub how: String,
    /// What the record says about each parameter; `None` where they are elements of a table, which are too many.
    pub estimate: Option<Estimate>,
    /// How much the record says of the cells of a Preisach triangle, of the nodes of a mirror function.
    pub tables: Vec<TableEstimate>,
    /// The searches, if there was something to search.
    pub trials: Option<Trials>,
    /// Evaluations of the model.
    pub evaluations: u64,
    /// Where several ways of the drive between samples were tried: what each leaves of the training record \[y\] when it is fitted to
    /// all rows, counted over those that are a start-up transient for none. The model is the better one.
    pub between_samples: Vec<(BetweenSamples, f64)>,
}

impl Fit {
    /// A fit in which nothing was searched.
    pub fn at_once(model: Model, how: &str) -> Self {
        let (estimate, tables, trials, between_samples) = (None, Vec::new(), None, Vec::new());
        Self { model, how: how.into(), estimate, tables, trials, evaluations: 1, between_samples }
    }
}

/// Fits a base model; the rows of a start-up transient are left out.
///
/// # Errors
/// See [`FitError`].
pub fn fit(record: &Record, kind: Kind, options: &FitOptions) -> Result<Model, FitError> {
    fit_with(record, kind, options, &mut |_| ControlFlow::Continue(())).map(|fit| fit.model)
}

/// [`fit`] that says how it went. `watch` is told of every generation of a search and may end it; the best so far is
/// then polished and returned.
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

/// Models that rise and fall with their input, or against it.
pub(crate) fn sign_matters(kind: Kind) -> bool {
    // The oscillator lags by up to half a turn.
    kind != Kind::BoucWenOscillator
}

/// A base of a kind, with the grid or thresholds that the record calls for.
#[derive(Clone)]
pub(crate) enum BasisOf {
    Pi(PiBasis),
    Preisach(PreisachBasis),
    /// An operator of another kind, near its parameters.
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

    /// The operator with these weights. What the solver leaves below a billionth of the sum is zero.
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
            let most = samples.len() / ROWS_EACH;
            let finest = |cells: &usize| PreisachBasis::for_samples(samples, *cells).len() <= most;
            let cells = (MIN_CELLS..=CELLS).rev().find(finest).unwrap_or(MIN_CELLS);
            BasisOf::Preisach(PreisachBasis::for_samples(samples, cells))
        }
        other => return Err(FitError::NoBasis { kind: other.name() }),
    })
}

/// The base that a model has, for a record that it was fitted to: its own thresholds or grid.
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

/// Whether a record can be fitted; `wrong_sign` if its output falls where the model's rises, or rises where that falls.
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

/// Fits the base and finds the start-up rows while it does, and what the actuator remembered when each segment began: sets `samples.settling` and
/// `samples.pasts`. Gives the fit and what it has left in the rows that it used.
pub(crate) fn fit_settled(
    samples: &mut Samples,
    basis: &dyn Basis,
    options: &FitOptions,
    name: &dyn Fn() -> String,
) -> Result<Left, FitError> {
    let run = |samples: &Samples, basis: &dyn Basis| everywhere(samples, basis, options.zero_per_record, name);
    let mut all = run(samples, basis)?;
    if samples.mark_spikes(&all.1) {
        all = run(samples, basis)?;
    }
    let (mut found, late) = start_up_found(samples, all, None, |samples| run(samples, basis))?;
    if memory::standing_out_where_followed(samples, &late.1).contains(&true) {
        // What the actuator remembers is no matter of the base that is fitted, and few plays are determined by few rows.
        samples.settling.copy_from_slice(&samples.blind);
        let plays = PiBasis::for_samples(samples);
        let recalls = |samples: &Samples, (fitted, residual): &Left, asked: &[bool], surely: &[bool]| {
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

/// Finds what the actuator remembered when each segment began, as plays follow it: sets `samples.pasts`. Gives what they miss of each row.
fn recalled(
    samples: &mut Samples,
    run: impl Fn(&Samples) -> Result<Left, FitError>,
    recalls: &Recalls<'_>,
) -> Result<Vec<f64>, FitError> {
    let (mut found, mut late) = start_up_found(samples, run(samples)?, None, &run)?;
    let asked = memory::standing_out_where_followed(samples, &late.1);
    if !asked.contains(&true) {
        return Ok(found.1);
    }
    // A part of what came before is seen all through the record. Where no start-up shows, or near 0 V, where one may be a transient of the sensor, the turns
    // alone are asked for.
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
        // It leaves fewer rows to a start-up, or as many and clearly less of all.
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

/// Finds the start-up rows, given a fit to all: sets `samples.settling`. Gives the fit to the rows that count, and one to those that are a start-up
/// for none. `beside` is what another base misses of each row.
fn start_up_found(
    samples: &mut Samples,
    all: Left,
    beside: Option<&[f64]>,
    run: impl Fn(&Samples) -> Result<Left, FitError>,
) -> Result<(Left, Left), FitError> {
    let windows = windows(samples);
    let without = without_beginnings(samples);
    let late = run(&without)?;
    let rms_late = |r: &[f64]| {
        let kept = r.iter().zip(&without.settling).filter(|(_, s)| !**s);
        let (sum, n) = kept.fold((0.0, 0usize), |(sum, n), (r, _)| (sum + r * r, n + 1));
        (sum / n.max(1) as f64).sqrt()
    };
    // If leaving the beginnings out improves the rest a lot, they disagree with the rest: judge them
    // by a fit that has not seen them. So too where a record begins away from 0 V: its memory there is
    // nobody's guess. If neither, they belong to the record (and hold its virgin curve).
    let (low, high) = samples.input_range();
    let away = samples.segments.iter().any(|s| samples.input[s.start].abs() > MINOR_SHARE * low.abs().max(high.abs()));
    let judged_late = away || rms_late(&all.1) > 1.5 * rms_late(&late.1);
    let mut residual = if judged_late { late.1.clone() } else { all.1.clone() };
    // What has not seen them need not have all weights that they call for. What another base follows there is no start-up.
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

/// A fit to the rows that count, and what it leaves in every row.
fn everywhere(
    samples: &Samples,
    basis: &dyn Basis,
    zero_per_file: bool,
    name: &dyn Fn() -> String,
) -> Result<Left, FitError> {
    let blocks = Blocks::new(samples, BLOCKS, ROWS);
    let problem = Problem::new(samples, basis, &blocks, zero_per_file);
    let stage = |source| FitError::Stage { record: name(), source };
    let fitted =
        problem.fit(&Hypothesis::default()).map_err(stage)?.ok_or_else(|| FitError::Unsolvable { record: name() })?;
    let residual = problem.residual(&fitted).map_err(stage)?;
    Ok((fitted, residual))
}

/// A fit and what it leaves in the rows that it used.
fn within(samples: &Samples, (fitted, residual): Left) -> Left {
    let left = Blocks::new(samples, BLOCKS, ROWS).all_used(samples).map(|k| residual[k]).collect();
    (fitted, left)
}

/// A fit to the rows that count, and what it leaves in the rows that it used.
fn solved(
    samples: &Samples,
    basis: &dyn Basis,
    zero_per_file: bool,
    name: &dyn Fn() -> String,
) -> Result<Left, FitError> {
    Ok(within(samples, everywhere(samples, basis, zero_per_file, name)?))
}

/// A model with standard errors, and with the names of what its record does not determine.
fn with_errors(mut model: Model, estimate: &Estimate) -> Model {
    let stage = model.base.kind().name();
    // The sensor's zero belongs to no stage.
    let key = |name: &str| if name == ZERO { name.into() } else { format!("{stage}.{name}") };
    let finite = estimate.parameters.iter().filter(|p| p.std_error.is_finite());
    model.std_errors = finite.map(|p| (key(&p.name), p.std_error)).collect();
    model.undetermined = estimate.undetermined().into_iter().filter(|name| *name != ZERO).map(key).collect();
    model
}

/// Puts a fit into a model.
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

/// A model without effects, fitted to the settled rows of a record.
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

/// The unit at the end of a column's name, as a person writes it.
pub(crate) fn unit_of(column: &str) -> String {
    match column.rsplit('_').next() {
        Some("v") => "V".into(),
        Some("n") => "N".into(),
        Some(other) => other.into(),
        None => String::new(),
    }
}
