//! Whether the user's own base lacks a curve behind it: asymmetry, or a stop.
//!
//! The search runs on a rich base that bends in itself, so that a coarse base is not taken for an effect. Here the own base is asked: if
//! one curve without memory takes most of what separates it from the rich one, that curve is its name; if not, what is
//! missing has memory, and the base is too coarse.

use hyst_core::{AsymmetryParams, Error, MAX_DEAD_ZONES};

use super::search::{Instead, Named};
use super::trial::Trial;
use super::{score, starts};
use crate::model::Effect;
use crate::nested::{Fitted, Hypothesis, Problem};

/// Error of the own base over that of the rich one from which on something is missing.
const MISSING: f64 = 1.1;
/// Error of the own base with a curve over that of the rich one up to which the curve is all that was missing.
const CLOSED: f64 = 1.7;
/// The same where the plays of the own base have been chosen anew behind the curve: little else is then left to be missing.
const CLOSED_ANEW: f64 = 1.25;
/// Share of what stands above the noise floor that it has to take.
const TAKEN: f64 = 0.9;
/// Noise floors that count as near the noise.
const NEAR_NOISE: f64 = 1.5;
/// Ends of the curve: share of the motion's range beyond the outermost dead zone.
const MARGIN: f64 = 0.08;

/// What the own base was found to lack.
pub(super) struct Shape {
    pub(super) hypothesis: Hypothesis,
    pub(super) fit: Fitted,
    pub(super) named: Named,
    /// Whether it is the curve of the base that was chosen behind it.
    pub(super) anew: bool,
}

/// The own base with a curve behind it.
pub(super) struct Bent {
    pub(super) own: Option<Trial>,
    /// The same on the plays that were chosen behind that curve: without it, where they lack something too, and with it.
    pub(super) anew: Option<(Trial, Trial)>,
}

/// The own base with what was found; none if it cannot be solved.
pub(super) fn plain(problem: &Problem<'_>, found: &Hypothesis) -> Result<Option<Trial>, Error> {
    Ok(problem.fit_linear(found)?.and_then(|f| Trial::of(problem, f)))
}

/// Whether it misses nothing that the rich one shows.
pub(super) fn is_complete(plain: &Trial, richest: f64) -> bool {
    plain.cv_rmse() <= MISSING * richest
}

/// The same with a curve behind it; none if there is one already.
pub(super) fn bent(problem: &Problem<'_>, found: &Hypothesis, plain: &Fitted) -> Result<Option<Trial>, Error> {
    if found.effects.asymmetry.is_some() {
        return Ok(None);
    }
    let Some(curve) = curve(problem, plain) else { return Ok(None) };
    let mut h = found.clone();
    h.effects.asymmetry = Some(curve);
    Ok(problem.fit_linear(&h)?.and_then(|f| Trial::of(problem, f)))
}

/// Looks for a curve behind the own base of `problem`, all that was found before kept. `plain` is that base without one, which
/// [lacks](is_complete) something; `richest` is the cross-validated error that a rich base leaves \[y\].
pub(super) fn shape(
    problem: &Problem<'_>,
    found: &Hypothesis,
    plain: &Trial,
    bent: Bent,
    richest: f64,
    noise: f64,
    seed: u64,
) -> Result<Option<Shape>, Error> {
    // With a drag there is no finer base than that of the search: what it leaves need not be the least that a base can leave.
    let least = if found.drag.is_some() { richest.min(NEAR_NOISE * noise) } else { richest };
    let own = bent.own.map(|t| (Effect::Asymmetry, t, None));
    let anew = bent.anew.map(|(plain, t)| (Effect::Asymmetry, t, Some(plain)));
    let mut tried: Vec<(Effect, Trial, Option<Trial>)> = own.into_iter().chain(anew).collect();
    if found.effects.saturation.is_none() {
        for fitted in stopped(problem, found, &plain.fit)? {
            tried.extend(Trial::of(problem, fitted).map(|t| (Effect::Saturation, t, None)));
        }
    }
    // What better plays gain is not the curve's.
    let on_better_plays = tried.iter().find_map(|(.., anew)| anew.clone()).filter(|p| p.total() < plain.total());
    let plain = on_better_plays.as_ref().unwrap_or(plain);
    let judged: Vec<_> = tried
        .iter()
        .map(|(effect, t, anew)| {
            let (without, closed) = anew.as_ref().map_or((plain, CLOSED), |plain| (plain, CLOSED_ANEW));
            let judgement = score::judge(problem, without, t, noise, seed);
            let accepted = judgement.accepted() && judgement.share >= TAKEN && t.cv_rmse() <= closed * least;
            (*effect, t, judgement, accepted, anew)
        })
        .collect();
    let accepted = judged.iter().filter(|(.., accepted, _)| *accepted);
    // A stop has fewer numbers than a curve: where they are as good as each other it is the stop.
    let best = accepted.min_by(|a, b| {
        let weight = |effect: Effect| if effect == Effect::Saturation { 0.95 } else { 1.0 };
        (weight(a.0) * a.1.cv_rmse()).total_cmp(&(weight(b.0) * b.1.cv_rmse()))
    });
    Ok(best.map(|(effect, trial, judgement, _, anew)| {
        let others = judged.iter().filter(|(e, ..)| e != effect).map(|(e, other, judgement, accepted, _)| Instead {
            effect: *e,
            cv_rmse: other.cv_rmse(),
            tie: *accepted && score::undecided(trial, other, seed),
            hypothesis: other.fit.hypothesis.clone(),
            judgement: *judgement,
        });
        let mut instead: Vec<Instead> = others.collect();
        instead.sort_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
        instead.dedup_by_key(|i| i.effect);
        Shape {
            hypothesis: trial.fit.hypothesis.clone(),
            fit: trial.fit.clone(),
            anew: anew.is_some(),
            named: Named {
                effect: *effect,
                cv_without: anew.as_ref().unwrap_or(plain).cv_rmse(),
                cv_with: trial.cv_rmse(),
                judgement: *judgement,
                instead,
            },
        }
    }))
}

/// Fits of the own base with a stop, from several beginnings. Everything else stays as it was found: on this coarser base it would take
/// up the misfit.
fn stopped(problem: &Problem<'_>, found: &Hypothesis, plain: &Fitted) -> Result<Vec<Fitted>, Error> {
    let mut fits = Vec::new();
    let ends = starts::stops(problem.samples, plain).into_iter().flatten();
    let above_rest = starts::stops_above_rest(problem.samples, plain).into_iter().flatten();
    for stop in found.effects.saturation.into_iter().chain(ends).chain(above_rest) {
        let mut h = found.clone();
        h.effects.saturation = Some(stop);
        fits.extend(problem.fit(&h)?.and_then(|f| {
            h.effects.saturation = f.hypothesis.effects.saturation;
            problem.fit_linear(&h).ok().flatten()
        }));
    }
    Ok(fits)
}

/// Where the own base meets a stop that the rich one has found: what lies behind a stop is hidden, and each base fills it in its own way.
pub(super) fn own_stop(problem: &Problem<'_>, found: &Hypothesis) -> Result<Option<Fitted>, Error> {
    let Some(plain) = problem.fit_linear(found)? else { return Ok(None) };
    let fits = stopped(problem, found, &plain)?;
    Ok(fits.into_iter().filter(|f| f.squares < plain.squares).min_by(|a, b| a.squares.total_cmp(&b.squares)))
}

/// Dead zones spread evenly over the operator's output, moving away from zero.
fn curve(problem: &Problem<'_>, plain: &Fitted) -> Option<AsymmetryParams<Vec<f64>>> {
    let operator = problem.operator_output(plain).ok()?;
    let settled = operator.iter().zip(&problem.samples.settling).filter(|(_, s)| !**s).map(|(v, _)| *v);
    let (low, high) = crate::samples::range(settled);
    let (low, high) = (low + MARGIN * (high - low), high - MARGIN * (high - low));
    if low >= high {
        return None;
    }
    let mut thresholds: Vec<f64> =
        (0..MAX_DEAD_ZONES).map(|i| low + (high - low) * i as f64 / (MAX_DEAD_ZONES - 1) as f64).collect();
    thresholds.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    Some(AsymmetryParams { weights: vec![0.0; thresholds.len()], thresholds })
}
