//! Closing the loop with measured data: find what a fitted model leaves over, name the effect that
//! explains it, add it, and show the error before and after.
//!
//! 1. **Search** on a rich base (`base/screening.rs`: rate-independent, and the model's own where that stays as it is), so that a coarse one's
//!    own misfit is not taken for an effect: forward with a small beam, then elimination, then swaps.
//!    Every trial refits the whole nested model.
//! 2. **Judge** by cross-validation inside the training record: a block bootstrap must find the gain,
//!    and it must matter against the noise floor and against what is left (a tone of the sensor's own only against the noise floor).
//! 3. **Ask** a Preisach triangle, where it predicts better, whether it needs what was found, and what else, and the own base whether it
//!    lacks a curve.
//! 4. **Extend** the user's own model with the effects found, all weights refitted; and their parameters, where that model follows as well as the
//!    rich base, after it was asked again how each segment begins.

mod advice;
mod changed;
mod colour;
mod evidence;
mod extension;
mod findings;
mod finer;
mod follow;
mod history;
mod limits;
mod named;
mod own_base;
mod probability;
mod race;
mod remainder;
mod rows;
mod scan;
mod score;
mod search;
mod shape;
mod spectrum;
mod start;
mod starts;
mod suspects;
mod tone;
mod trial;
mod uncertainty;

pub use evidence::{Axis, Breakdown, Curve, MOST_POINTS, Mark, Part, Picture, Role, Style};
pub use findings::{
    Alternative, BaseAdvice, Change, EffectKind, Errors as FoundErrors, Finding, Findings, Found, LeftOut, MOST_LISTED,
    OnRecords, Remainder, RemainderKind, Rows, Suspect, Verdict,
};
pub use limits::Limit;
pub use probability::Weighed;
pub use suspects::{FOLLOWED, drive_options, usual_rival};

use extension::{Own, Shaped};

use crate::base::{Basis, DragParams, ROWS_PER_UNKNOWN, ScreeningBasis};
use crate::fit::{BLOCKS, BasisOf, FitError, FitOptions, basis_of, check, fit_settled, sign_matters};
use crate::lsq::Blocks;
use crate::model::{Base, Effect, Model};
use crate::nested::{Cause, Hypothesis, Problem};
use crate::record::Record;
use crate::samples::Samples;
use crate::settle::{Settled, start_up_rows, unless_followed};
use crate::simulate::{Zero, simulate};
use crate::stop::{Stop, until_stopped};
use trial::Trial;

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
    /// Each name that was given, or that might have been, with what its probability was computed from.
    pub weighed: Vec<Weighed>,
}

/// Rows that the search uses at most.
const SEARCH_ROWS: usize = 16_000;
/// Rows that the search for a curve behind the own base uses at most.
const SHAPE_ROWS: usize = 8_000;
/// Rounds in which a stop and the plays of the base behind it are placed.
const STOP_ROUNDS: usize = 3;
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
    diagnose_until(train, test, model, options, progress, &Stop::default())
}

/// As [`diagnose`]; `stop` ends it from another thread, within moments.
///
/// # Errors
/// See [`FitError`]; [`FitError::Stopped`] where it was ended.
pub fn diagnose_until(
    train: &Record,
    test: Option<&Record>,
    model: &Model,
    options: &DiagnoseOptions,
    progress: &(dyn Fn(&str) + Sync),
    stop: &Stop,
) -> Result<Diagnosis, FitError> {
    let found = until_stopped(|| found_in(train, test, model, options, progress, stop));
    found.unwrap_or_else(|| Err(FitError::Stopped { record: train.name() }))
}

fn found_in(
    train: &Record,
    test: Option<&Record>,
    model: &Model,
    options: &DiagnoseOptions,
    progress: &(dyn Fn(&str) + Sync),
    stop: &Stop,
) -> Result<Diagnosis, FitError> {
    let before = simulate(model, train, options.zero)?;
    let mut samples = Samples { stop: stop.clone(), ..Samples::from_record(train) };
    samples.falls &= sign_matters(model.base.kind());
    check(train, &samples, samples.falls != model.falls)?;
    let stage = |source| FitError::Stage { record: train.name(), source };
    let per_record = options.zero == Zero::PerRecord;

    let own = basis_of(model, &samples).map_err(stage)?;
    let kept = match &own {
        BasisOf::Linearised(kept) => Some(Box::new(kept.alone())),
        _ => None,
    };
    let screening = ScreeningBasis::for_samples(&samples, own.as_ref().drags(), kept);
    // Start-up rows are those that the rich base does not follow either: what only a coarse one misses is no transient.
    let fitting = FitOptions { zero_per_record: per_record, ..FitOptions::default() };
    fit_settled(&mut samples, &screening, &fitting, &|| train.name())?;
    // Nor are those that the model itself follows: a rich base that has not seen them may be anywhere there. Unless it follows them after a past
    // that the search does not know.
    for ((segment, in_mid_cycle), past) in samples.segments.iter().zip(&before.in_mid_cycle).zip(&samples.pasts) {
        for k in segment.clone().filter(|_| !in_mid_cycle || !past.is_empty()) {
            samples.settling[k] &= before.settling[k] || samples.blind[k];
        }
    }
    let (rows, needed) = (samples.settling.iter().filter(|s| !**s).count(), ROWS_PER_UNKNOWN * screening.len());
    if rows < needed {
        return Err(FitError::TooShort { record: train.name(), rows, unknowns: screening.len(), needed });
    }
    let unsolvable = || FitError::Unsolvable { record: train.name() };
    let blocks = Blocks::new(&samples, BLOCKS, SEARCH_ROWS);
    let start = hypothesis_of(model);
    // A linearised operator is not searched: its misfit far from its optimum looks like effects.
    let is_searched = !matches!(own, BasisOf::Linearised(_));
    let searched_too = is_searched.then(|| own.as_ref());
    let base_of = |on_own: bool| searched_too.filter(|_| on_own).unwrap_or(&screening);
    // A search over other rows continues from what the one before has found.
    let searched = |samples: &Samples, from: &Hypothesis| {
        let problem = Problem::new(samples, &screening, &blocks, per_record);
        let base = problem.fit(from).map_err(stage)?.ok_or_else(unsolvable)?;
        let found = search::search(&problem, base, &start.causes(), options.seed, progress).map_err(stage)?;
        let (mut problem, mut found, mut on_own) = (problem, found, false);
        if let Some(basis) = searched_too {
            let own = Problem::new(samples, basis, &blocks, per_record);
            let start = (from, start.causes());
            let anew = own_base::search(&own, screening.len(), &found, start, options.seed, progress).map_err(stage)?;
            if let Some(anew) = anew {
                (problem, found, on_own) = (own, anew, true);
            }
        }
        let residual = problem.residual(&found.best.fit).map_err(stage)?;
        Ok::<_, FitError>((found, start_up_rows(samples, &residual), on_own))
    };
    let (mut found, starting, mut on_own) = searched(&samples, &start)?;
    // A transient may stand out only once what else was missing is found.
    if samples.settling.iter().zip(&starting).any(|(known, starts)| *starts && !*known) {
        progress("searching again without the start-up rows that have come to light");
        samples.settling.iter_mut().zip(&starting).for_each(|(known, starts)| *known |= *starts);
        (found, _, on_own) = searched(&samples, &found.best.fit.hypothesis)?;
    }
    // And what stood out as one may be no more than what was missing: a stop that hides the rise from rest, say.
    if !found.named.is_empty() {
        let mut seen = samples.clone();
        let known = Settled { fit: found.best.fit.clone(), settling: samples.settling.clone() };
        let followed = unless_followed(&samples, known, &mut |settling: &[bool]| {
            seen.settling.copy_from_slice(settling);
            let problem = Problem::new(&seen, base_of(on_own), &blocks, per_record);
            let Some(fit) = problem.fit(&found.best.fit.hypothesis).map_err(stage)? else { return Ok(None) };
            let starting = start_up_rows(&seen, &problem.residual(&fit).map_err(stage)?);
            Ok::<_, FitError>(Some((fit, starting)))
        })?;
        if followed.settling != samples.settling {
            progress("searching again with the rows that are no start-up once it is known what acts");
            samples.settling = followed.settling;
            (found, _, on_own) = searched(&samples, &found.best.fit.hypothesis)?;
        }
    }

    progress("asking a finer base whether it needs what was found");
    let problem = Problem::new(&samples, base_of(on_own), &blocks, per_record);
    let finer::Finer { mut hypothesis, mut errors, cv_rmse: mut richest } =
        finer::refine(&problem, &mut found, &start.causes(), &samples, options.seed, progress).map_err(stage)?;
    // The own base was searched: the rich one may still follow better what was found there.
    if on_own {
        let rich = Problem::new(&samples, &screening, &blocks, per_record);
        let fit = rich.fit_linear(&hypothesis).map_err(stage)?;
        richest = fit.and_then(|f| Trial::of(&rich, f)).map_or(richest, |rich| richest.min(rich.cv_rmse()));
    }
    // Its parameters are those of the drift alone; the zero wanders beyond it, and that is told.
    if let Some(least) = found.beside_wandering.filter(|_| hypothesis.effects.drift.is_some()) {
        hypothesis.zero_wanders = true;
        richest = richest.min(least);
    }
    let only_loop = problem.only_loop;
    progress("computing what this record would have shown");
    let units = (model.input.symbol(), model.output.unit.as_str());
    let with_found = problem.fit_linear(&hypothesis).map_err(stage)?.and_then(|f| Trial::of(&problem, f));
    let mut limits = with_found
        .map(|found_here| limits::limits(&problem, &found_here, found.noise, units).map_err(stage))
        .transpose()?
        .unwrap_or_default();
    drop(problem);

    let effects = |h: &Hypothesis| h.causes().iter().filter_map(|c| c.effect()).collect::<Vec<_>>();
    // What was found takes other plays to follow; a stop stands where these meet it, and what it hides is another thing then.
    let mut basis: Option<BasisOf> = None;
    let asked = Own { model, train, samples: &samples, basis: &own, before: &before, per_record };
    let stop_is_new = hypothesis.effects.saturation.is_some() && start.effects.saturation.is_none();
    if effects(&hypothesis) != effects(&start) {
        basis = asked.on_better_plays(&hypothesis)?;
    }
    for round in (1..=STOP_ROUNDS).filter(|_| stop_is_new) {
        let asked = Own { basis: basis.as_ref().unwrap_or(&own), ..asked };
        asked.stop(&mut hypothesis, &mut errors)?;
        // The last word is the stop's.
        let better = if round < STOP_ROUNDS { asked.on_better_plays(&hypothesis)? } else { None };
        let Some(better) = better else { break };
        basis = Some(better);
    }
    // Where each segment has begun, if that shows only beside a curve.
    let mut started: Option<Samples> = None;
    // A base that is not odd bends by its own weights: what a curve behind it took would be its misfit.
    if only_loop.is_none() && own.as_ref().is_odd() {
        progress("asking whether the model's own base lacks a curve");
        let asked = Own { basis: basis.as_ref().unwrap_or(&own), ..asked };
        let shaped_beside = |effects: &Hypothesis| {
            let with_start = asked.start_beside_a_curve(effects, richest)?;
            let asked = Own { samples: with_start.as_ref().unwrap_or(&samples), ..asked };
            let shaped = asked.shape(&start, effects, richest, found.noise, options.seed, progress)?;
            Ok::<_, FitError>((with_start, shaped))
        };
        let (mut with_start, mut shaped) = shaped_beside(&hypothesis)?;
        // What was found may be no more than the trace that a missing curve leaves on a base that does not have it.
        let left = |shaped: &Shaped| shaped.curve.as_ref().map_or(f64::INFINITY, |(curve, _)| curve.cv_with);
        if left(&shaped) > shape::CLOSED_ANEW * richest && shaped.basis.is_none() && !found.named.is_empty() {
            let alone = shaped_beside(&start)?;
            if left(&alone.1) < left(&shaped) {
                found.named.clear();
                (with_start, shaped) = alone;
            }
        }
        if let Some((curve, fit)) = shaped.curve {
            match &shaped.searched {
                Some(_) => errors = uncertainty::standard_errors(&fit, samples.time[0]),
                None => asked.take(curve.effect, &fit, &mut errors),
            }
            if let Some(searched) = shaped.searched {
                found.named = searched.named;
            }
            hypothesis = fit.hypothesis;
            found.named.push(curve);
            found.named.sort_by_key(|n| n.effect);
            started = with_start;
        }
        basis = shaped.basis.or(basis);
    }
    let asked = Own { samples: started.as_ref().unwrap_or(&samples), ..asked };
    // Rich memory may imitate an effect in one record. Where the own base with few effects does as well, that is the simpler explanation.
    if found.named.is_empty() && only_loop.is_none() && is_searched {
        progress("asking whether the model's own base with an effect explains as much");
        let asked = Own { basis: basis.as_ref().unwrap_or(&own), ..asked };
        if let Some(closing) = asked.closing(&hypothesis, &start, richest, found.noise, options.seed, progress)? {
            hypothesis = closing.best.fit.hypothesis.clone();
            errors = uncertainty::standard_errors(&closing.best.fit, samples.time[0]);
            found = closing;
            basis = asked.on_better_plays(&hypothesis)?.or(basis);
        }
    }
    let asked = Own { basis: basis.as_ref().unwrap_or(&own), ..asked };

    progress("refitting the model with what was found");
    let mut extended = model.clone();
    let mut after = before.clone();
    let mut begun: Option<Samples> = None;
    if effects(&hypothesis) != effects(&start) {
        let found_here = (&hypothesis, &errors);
        let best = asked.best(&start, found_here, (richest, found.noise, options.seed), options.zero)?;
        extension::Extension { hypothesis, errors, begun, model: extended, after } = best;
    }
    let asked = Own { samples: begun.as_ref().unwrap_or(asked.samples), ..asked };

    progress("judging what is left");
    let mut useless = Vec::new();
    // What an amplifier does not follow would hide the rest.
    let mut amplified = None;
    if let Some(v_per_s) = hypothesis.slew_limit.filter(|_| !found.named.is_empty()) {
        let record = asked.amplified(v_per_s);
        amplified = Some((simulate(model, &record, options.zero)?, simulate(&extended, &record, options.zero)?));
    }
    let (without, with) = amplified.as_ref().map_or((&before, &after), |(without, with)| (without, with));
    let helps = || Ok::<_, FitError>(asked.is_helped(without, with) && asked.transfers(&start, &hypothesis)?);
    if !found.named.is_empty() && !helps()? {
        // What the rich base shows is hidden by what this one misses.
        useless = found.named.drain(..).map(|n| n.effect).collect();
        (extended, after, amplified) = (model.clone(), before.clone(), None);
        let Hypothesis { slew_limit, zero_wanders, gain_wanders, .. } = hypothesis;
        hypothesis = Hypothesis { slew_limit, zero_wanders, gain_wanders, ..start.clone() };
    }
    if extended != *model {
        extended.rmse = after.errors.as_ref().map(|errors| errors.rmse);
    }
    let mut remainder =
        remainder::judge(&found, &hypothesis, &after, amplified.as_ref(), &samples, richest, model.input.symbol());
    if extended == *model {
        let asked = Own { basis: &own, ..asked };
        remainder = changed::told_apart(&asked, &start, found.noise, options.zero, remainder)?;
    }
    let remainder = remainder.beside(only_loop, &useless);
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
    limits.retain(|effect, _| !named.contains(effect));
    // Of the base of the search: what the own base misses beside an effect does not speak against it.
    let left = found.best.cv_rmse() / found.noise.max(f64::MIN_POSITIVE);
    let candidates = suspects::candidates(&found, &named, left);
    let suspects = suspects::suspects(&candidates, model, &samples, remainder.slew_limit);
    let given = found.named.iter().map(|n| Weighed::of(n.effect, true, &n.evidence(left)));
    let weighed = given.chain(candidates.iter().map(|n| Weighed::of(n.effect, false, &n.evidence))).collect();
    let base_advice = match remainder.kind {
        RemainderKind::None => None,
        _ => {
            let own = (model.base.kind(), asked.basis.as_ref());
            advice::base_advice(&samples, own, &hypothesis, per_record, &stage)?
        }
    };
    let findings = findings::collect(&findings::Material {
        left,
        suspects,
        limits,
        base_advice,
        rows: rows::rows(train, &samples),
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
    Ok(Diagnosis { extended, findings, pictures, breakdowns, weighed })
}

/// What a model already holds.
fn hypothesis_of(model: &Model) -> Hypothesis {
    let drag = match &model.base {
        Base::ViscousPi(p) => Some(DragParams { seconds: p.seconds, volt_seconds: p.volt_seconds }),
        _ => None,
    };
    Hypothesis { drag, ..Hypothesis::of(model.effects.clone()) }
}

/// Why a record cannot show a cause at all; `None` if it can.
fn hidden(cause: Cause, problem: &Problem<'_>) -> Option<&'static str> {
    let varies = |column: &[f64], least: f64| {
        let (low, high) = crate::samples::range(column.iter().copied());
        high - low > least
    };
    match cause {
        Cause::Effect(Effect::Temperature) => match &problem.samples.temperature {
            None => Some("the temperature was not recorded"),
            Some(degc) => (!varies(degc, 0.5)).then_some("the temperature did not change by half a kelvin"),
        },
        Cause::Effect(Effect::Load) => match &problem.samples.load {
            None => Some("the load was not recorded"),
            Some(newtons) => (!varies(newtons, 0.0)).then_some("the load did not change"),
        },
        // What changes one loop's shape may as well be a hysteresis of that shape. That the output turns after the drive does is none:
        // of what is late, the simplest stands for all.
        Cause::Effect(Effect::RateDependence | Effect::Resonance | Effect::Saturation | Effect::Asymmetry)
        | Cause::SlewLimit => {
            problem.only_loop.map(|_| "the record repeats one loop, whose shape may as well be the hysteresis")
        }
        _ => None,
    }
}
