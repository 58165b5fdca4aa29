//! Closing the loop with measured data: find what a fitted model leaves over, name the effect that
//! explains it, add it, and show the error before and after.
//!
//! 1. **Search** on a rich rate-independent base (`base/screening.rs`), so that a coarse base model's
//!    own misfit is not taken for an effect: forward with a small beam, then elimination, then swaps.
//!    Every trial refits the whole nested model.
//! 2. **Judge** by cross-validation inside the training record: a block bootstrap must find the gain,
//!    and it must matter against the noise floor and against what is left.
//! 3. **Extend** the user's own model with the effects found, all weights refitted.

mod evidence;
mod findings;
mod finer;
mod remainder;
mod score;
mod search;
mod shape;
mod spectrum;
mod starts;
mod trial;
mod uncertainty;

pub use evidence::{Axis, Breakdown, Curve, MOST_POINTS, Mark, Part, Picture, Role, Style};
pub use findings::{
    Alternative, Errors as FoundErrors, Finding, Findings, Found, OnRecords, Remainder, RemainderKind, Verdict,
};

use std::collections::BTreeMap;

use crate::base::{Basis, DragParams, ScreeningBasis};
use crate::fit::{BLOCKS, FitError, FitOptions, basis_of, check, fit_settled, to_model};
use crate::lsq::Blocks;
use crate::model::{Base, Effect, Model};
use crate::nested::{Cause, Hypothesis, Problem};
use crate::record::Record;
use crate::samples::Samples;
use crate::settle::start_up_rows;
use crate::simulate::{Simulation, Zero, simulate};

/// What a diagnosis may be told.
#[derive(Clone, Copy, Debug)]
pub struct DiagnoseOptions {
    /// What is done with the sensor's zero.
    pub zero: Zero,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        Self { zero: Zero::None, seed: 1 }
    }
}

/// A diagnosis: the extended model and how it was found.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The user's model with every effect that was found; the same model if none was.
    pub extended: Model,
    /// What was found, with evidence.
    pub findings: Findings,
    /// What a person can check: each named effect's trace in the record, and the whole model before and after.
    pub pictures: Vec<Picture>,
    /// Where what is left lives.
    pub breakdowns: Vec<Breakdown>,
}

/// Rows that the search needs for each unknown of its base: with fewer, noise looks like an effect.
const ROWS_PER_UNKNOWN: usize = 10;
/// Rows that the search uses at most.
const SEARCH_ROWS: usize = 16_000;
/// Rows that the search for a curve behind the own base uses at most.
const SHAPE_ROWS: usize = 8_000;
/// Rows that the final fit uses at most.
const FINAL_ROWS: usize = 40_000;

/// Diagnoses a model on the record that it was fitted to; `test` is only simulated, never fitted.
/// `progress` is told what is being done.
///
/// # Errors
/// See [`FitError`].
pub fn diagnose(
    train: &Record,
    test: Option<&Record>,
    model: &Model,
    options: &DiagnoseOptions,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, FitError> {
    let before = simulate(model, train, options.zero)?;
    let mut samples = Samples::from_record(train);
    check(train, &samples, true)?;
    let stage = |source| FitError::Stage { record: train.name(), source };
    let per_record = options.zero == Zero::PerRecord;

    let own = basis_of(model, &samples).map_err(stage)?;
    let screening = ScreeningBasis::for_samples(&samples, own.as_ref().drags());
    // Start-up rows are those that the rich base does not follow either: what only a coarse one misses is no transient.
    let fitting = FitOptions { zero_per_record: per_record, ..FitOptions::default() };
    fit_settled(&mut samples, &screening, &fitting, &|| train.name())?;
    let (rows, needed) = (samples.settling.iter().filter(|s| !**s).count(), ROWS_PER_UNKNOWN * screening.len());
    if rows < needed {
        return Err(FitError::TooShort { record: train.name(), rows, unknowns: screening.len(), needed });
    }
    let unsolvable = || FitError::Unsolvable { record: train.name() };
    let blocks = Blocks::new(&samples, BLOCKS, SEARCH_ROWS);
    let start = hypothesis_of(model);
    let searched = |samples: &Samples| {
        let problem = Problem::new(samples, &screening, &blocks, per_record);
        let base = problem.fit(&start).map_err(stage)?.ok_or_else(unsolvable)?;
        let found = search::search(&problem, base, options.seed, progress).map_err(stage)?;
        let residual = problem.residual(&found.best.fit).map_err(stage)?;
        Ok::<_, FitError>((found, start_up_rows(samples, &residual)))
    };
    let (mut found, starting) = searched(&samples)?;
    // A transient may stand out only once what else was missing is found.
    if samples.settling.iter().zip(&starting).any(|(known, starts)| *starts && !*known) {
        progress("searching again without the start-up rows that have come to light");
        samples.settling.iter_mut().zip(&starting).for_each(|(known, starts)| *known |= *starts);
        found = searched(&samples)?.0;
    }

    progress("asking a finer base whether it needs what was found");
    let problem = Problem::new(&samples, &screening, &blocks, per_record);
    let finer::Finer { mut hypothesis, mut errors, cv_rmse: richest } =
        finer::refine(&problem, &mut found, &start.causes(), &samples, options.seed).map_err(stage)?;
    let only_loop = problem.only_loop;
    drop(problem);

    progress("asking whether the model's own base lacks a curve");
    let shape = if only_loop.is_some() {
        None
    } else {
        let own_blocks = Blocks::new(&samples, BLOCKS, SHAPE_ROWS);
        let own_problem = Problem::new(&samples, own.as_ref(), &own_blocks, per_record);
        let stop_found = hypothesis.effects.saturation.is_some() && start.effects.saturation.is_none();
        if let Some(own) =
            stop_found.then(|| shape::own_stop(&own_problem, &hypothesis)).transpose().map_err(stage)?.flatten()
        {
            errors.extend(of_stage(Effect::Saturation, uncertainty::standard_errors(&own, samples.time[0])));
            hypothesis = own.hypothesis;
        }
        shape::shape(&own_problem, &hypothesis, richest, found.noise, options.seed).map_err(stage)?
    };
    if let Some(shape) = shape {
        errors.extend(of_stage(shape.named.effect, uncertainty::standard_errors(&shape.fit, samples.time[0])));
        hypothesis = shape.hypothesis;
        found.named.push(shape.named);
        found.named.sort_by_key(|n| n.effect);
    }

    progress("refitting the model with what was found");
    let mut extended = model.clone();
    if hypothesis.causes().iter().filter_map(|c| c.effect()).ne(start.causes().iter().filter_map(|c| c.effect())) {
        // The effects keep the parameters that the rich base gave them: refitted on a coarser base
        // they would take up its misfit. Only the base's weights and the zero are solved again.
        let mut motion_only = without_sensor_effects(&samples, &hypothesis);
        let mut moving = Hypothesis { zero_wanders: false, gain_wanders: false, ..hypothesis.clone() };
        (moving.effects.drift, moving.effects.interference) = (None, None);
        // What was a start-up for the model as it was need be none for the extended one.
        motion_only.settling.clone_from(&before.settling);
        let final_blocks = Blocks::new(&motion_only, BLOCKS, FINAL_ROWS);
        let fitted = |motion: &Samples| {
            let problem = Problem::new(motion, own.as_ref(), &final_blocks, per_record);
            let fit = problem.fit_linear(&moving).map_err(stage)?.ok_or_else(unsolvable)?;
            let starting = start_up_rows(motion, &problem.residual(&fit).map_err(stage)?);
            Ok::<_, FitError>((fit, starting))
        };
        let (mut fit, starting) = fitted(&motion_only)?;
        if starting != motion_only.settling {
            motion_only.settling = starting;
            fit = fitted(&motion_only)?.0;
        }
        // Its reach is that of the motion, not of the sensor.
        extended = to_model(train, &motion_only, &own, &fit, model.seed);
        extended.effects.drift = hypothesis.effects.drift;
        extended.effects.interference = hypothesis.effects.interference;
        extended.std_errors.clone_from(&errors);
    }

    progress("judging what is left");
    let mut after = simulate(&extended, train, options.zero)?;
    let mut useless = Vec::new();
    if !found.named.is_empty() && !follows_better(&samples, &before, &after) {
        // What the rich base shows drowns in what this one misses.
        useless = found.named.drain(..).map(|n| n.effect).collect();
        (extended, hypothesis, after) = (model.clone(), start.clone(), before.clone());
    }
    let mut remainder = remainder::judge(&found, &hypothesis, &after, &samples, richest);
    if let (Some(hz), false) = (only_loop, remainder.kind == RemainderKind::None) {
        remainder.description += &format!(
            "; the record repeats one loop at {hz:.4} Hz, in which rate-dependence, resonance, asymmetry and saturation look like a hysteresis of another shape, and whatever is late looks alike: drive several frequencies and amplitudes"
        );
    }
    if !useless.is_empty() {
        let names: Vec<&str> = useless.iter().map(|e| e.name()).collect();
        remainder.description += &format!(
            "; on a richer base {} would explain a part, but this base does not follow better with it: fit a richer one first",
            names.join(", ")
        );
    }
    let tests = test
        .map(|t| Ok::<_, FitError>((simulate(model, t, options.zero)?, simulate(&extended, t, options.zero)?)))
        .transpose()?;
    let mut named: Vec<Effect> = found.named.iter().map(|n| n.effect).collect();
    named.dedup();
    let evidence::Evidence { pictures, breakdowns, places } = evidence::collect(&evidence::Material {
        extended: &extended,
        named: &named,
        train,
        test,
        before: &before,
        after: &after,
        tests: tests.as_ref(),
        zero: options.zero,
        noise: found.noise,
    })?;
    let findings = findings::collect(&findings::Material {
        model,
        extended: &extended,
        named: &found.named,
        noise: found.noise,
        errors: &errors,
        before: &before,
        after: &after,
        tests: tests.as_ref(),
        remainder: Remainder { places, ..remainder },
        zero: options.zero,
        samples: &samples,
    });
    Ok(Diagnosis { extended, findings, pictures, breakdowns })
}

/// The errors of one effect's parameters.
fn of_stage(effect: Effect, errors: BTreeMap<String, f64>) -> impl Iterator<Item = (String, f64)> {
    errors.into_iter().filter(move |(key, _)| key.split('.').next() == Some(effect.name()))
}

/// Whether the second simulation errs less than the first, over the rows that count for the search: a model that misses a stop, say,
/// takes the rows on it for a start-up.
fn follows_better(samples: &Samples, before: &Simulation, after: &Simulation) -> bool {
    let rows = || (0..samples.len()).filter(|k| !samples.settling[*k]);
    let squares = |s: &Simulation| rows().map(|k| (samples.output[k] - s.predicted[k]).powi(2)).sum::<f64>();
    squares(after) < squares(before)
}

/// What a model already holds.
fn hypothesis_of(model: &Model) -> Hypothesis {
    let drag = match &model.base {
        Base::ViscousPi(p) => Some(DragParams { seconds: p.seconds, volt_seconds: p.volt_seconds }),
        _ => None,
    };
    Hypothesis { drag, ..Hypothesis::of(model.effects.clone()) }
}

/// The record with drift and tone taken from its output.
fn without_sensor_effects(samples: &Samples, h: &Hypothesis) -> Samples {
    let (mut motion, effects) = (samples.clone(), &h.effects);
    for (k, y) in motion.output.iter_mut().enumerate() {
        let t = samples.time[k];
        if let Some(drift) = effects.drift {
            *y -= drift.per_second * t;
        }
        if let Some(tone) = effects.interference {
            *y -= tone.amplitude * (2.0 * std::f64::consts::PI * (tone.hz * t).fract() + tone.phase).sin();
        }
    }
    motion
}

/// Whether a record can show a cause at all.
fn visible(cause: Cause, problem: &Problem<'_>) -> bool {
    let varies = |column: &Option<Vec<f64>>, least: f64| {
        column.as_ref().is_some_and(|c| {
            let (low, high) = crate::samples::range(c.iter().copied());
            high - low > least
        })
    };
    match cause {
        Cause::Effect(Effect::Temperature) => varies(&problem.samples.temperature, 0.5),
        Cause::Effect(Effect::Load) => varies(&problem.samples.load, 0.0),
        Cause::Effect(Effect::RateDependence) => problem.basis.drags() && problem.only_loop.is_none(),
        // What changes one loop's shape may as well be a hysteresis of that shape. That the output turns after the drive does is none:
        // of what is late, the simplest stands for all.
        Cause::Effect(Effect::Resonance | Effect::Saturation | Effect::Asymmetry) => problem.only_loop.is_none(),
        _ => true,
    }
}
