//! What was found, on the finest base at hand: parameters refitted, names that this base does not need taken back, and what drowned in the
//! misfit of the base of the search looked for anew.
//!
//! That base is rich but smooth. Where a Preisach triangle predicts the record better, what the search took for an effect may have been the
//! base's own misfit, what it found may be bent by it, and what it missed may be hidden by it.

use std::collections::BTreeMap;

use hyst_core::Error;

use super::scan::Scan;
use super::score;
use super::search::{Search, beyond, further};
use super::shape::own_stop;
use super::starts::starts;
use super::trial::Trial;
use super::uncertainty::{Undetermined, standard_errors};
use crate::base::{Basis, PreisachBasis, ROWS_PER_UNKNOWN, RatedBasis, ScreeningBasis};
use crate::criteria::{LARGE_RATIO, MIN_RMSE_DROP, MIN_SHARE_BESIDE_SLEW_LIMIT, MINOR_SHARE};
use crate::lsq::Blocks;
use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Problem};
use crate::samples::Samples;
use crate::settle::start_up_rows;

/// Cells along an edge of the triangle.
const CELLS: usize = 24;
/// Cells along an edge of the one that is searched, which a trial passes four times as fast.
const SEARCHED_CELLS: usize = 16;
/// Rows that the comparison uses.
const ROWS: usize = 8_000;

/// What a hysteresis that takes its time may be taken for.
const SLOW: [Effect; 4] = [Effect::Delay, Effect::Lag, Effect::Resonance, Effect::Creep];

/// What is known in the end.
pub(super) struct Finer {
    pub(super) hypothesis: Hypothesis,
    pub(super) errors: BTreeMap<String, f64>,
    /// Cross-validated error that the finest base leaves \[y\].
    pub(super) cv_rmse: f64,
}

/// Looks on the finest base for what the search could not see, takes names back that it does not need, and refits the others there.
pub(super) fn refine(
    problem: &Problem<'_>,
    found: &mut Search,
    already: &[Cause],
    samples: &Samples,
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Finer, Error> {
    beside_nameless(problem, found, already)?;
    beside_a_law_of_the_rate(problem, found, already, seed)?;
    let of = |trial: &Trial| Finer {
        hypothesis: trial.fit.hypothesis.clone(),
        errors: standard_errors(&trial.fit, samples.time[0]),
        cv_rmse: trial.cv_rmse(),
    };
    // The triangle has no drag.
    if found.best.cv_rmse() <= (1.0 + MIN_RMSE_DROP) * found.noise || found.best.fit.hypothesis.drag.is_some() {
        return Ok(of(&found.best));
    }
    let blocks = Blocks::new(samples, problem.blocks.rows.len(), ROWS);
    let basis = PreisachBasis::for_samples(samples, CELLS);
    let mut settled = samples.clone();
    let first = Problem::new(samples, &basis, &blocks, problem.zero_per_file).widening_as(problem);
    let Some(rough) = placed(&first, &found.best.fit.hypothesis)? else { return Ok(of(&found.best)) };
    // A triangle that keeps every turn in its memory also shows how long an unknown start lasts.
    let starting = start_up_rows(samples, &first.residual(&rough)?);
    settled.settling.iter_mut().zip(starting).for_each(|(known, starts)| *known |= starts);
    drop(first);
    let triangle = Problem::new(&settled, &basis, &blocks, problem.zero_per_file).widening_as(problem);
    let fitted = |h: &Hypothesis| Ok::<_, Error>(triangle.fit(h)?.and_then(|f| Trial::of(&triangle, f)));
    let from = [&found.best.fit.hypothesis, &rough.hypothesis];
    let differ = from[0] != from[1];
    let fits = from.into_iter().take(if differ { 2 } else { 1 }).map(fitted).collect::<Result<Vec<_>, _>>()?;
    let best = fits.into_iter().flatten().min_by(|a, b| a.total().total_cmp(&b.total()));
    let Some(mut best) = best else { return Ok(of(&found.best)) };
    if best.cv_rmse() >= (1.0 - MIN_RMSE_DROP) * found.best.cv_rmse() {
        return Ok(of(&found.best));
    }
    if score::is_far_better(&found.best, &best)
        && best.cv_rmse() > LARGE_RATIO * found.noise
        && let Some(anew) = searched_anew(problem, &triangle, found, already, seed, progress)?
        && let Some(rough) = placed(&triangle, &anew.best.fit.hypothesis)?
        && let Some(with) = fitted(&rough.hypothesis)?
    {
        (*found, best) = (anew, with);
    }
    decide_rivals(&triangle, found, &mut best, seed)?;
    loop {
        let mut least: Option<Trial> = None;
        let loose = Undetermined::of(&best.fit);
        for cause in beyond(&best.fit.hypothesis, already) {
            let Some(without) = without(&triangle, &best, cause, found.noise, seed)? else { continue };
            let is_loose = loose.speaks_against(cause, || score::is_far_better(&without, &best));
            if (is_loose || !score::judge(&triangle, &without, &best, found.noise, seed).accepted())
                && least.as_ref().is_none_or(|l| without.total() < l.total())
            {
                least = Some(without);
            }
        }
        let Some(without) = least else { break };
        best = fitted(&without.fit.hypothesis)?.unwrap_or(without);
        // Of two modes one may stay, and the name with it.
        let stays = beyond(&best.fit.hypothesis, already);
        found.named.retain(|n| stays.contains(&Cause::Effect(n.effect)));
    }
    Ok(of(&best))
}

/// A first fit of what was found on another base: a stop stands where this base meets it, if that is better.
fn placed(problem: &Problem<'_>, found: &Hypothesis) -> Result<Option<Fitted>, Error> {
    let as_found = problem.fit_linear(found)?;
    let stop = if found.effects.saturation.is_some() { own_stop(problem, found)? } else { None };
    Ok(as_found.into_iter().chain(stop).min_by(|a, b| a.squares.total_cmp(&b.squares)))
}

/// The finer base without one cause, all else refitted; its parameters as they are where that already shows that it is not needed.
fn without(triangle: &Problem<'_>, best: &Trial, cause: Cause, noise: f64, seed: u64) -> Result<Option<Trial>, Error> {
    let less = best.fit.hypothesis.without(cause);
    let Some(kept) = triangle.fit_linear(&less)?.and_then(|f| Trial::of(triangle, f)) else { return Ok(None) };
    if !score::judge(triangle, &kept, best, noise, seed).accepted() {
        return Ok(Some(kept));
    }
    let refitted = triangle.fit(&less)?.and_then(|f| Trial::of(triangle, f));
    Ok(Some(refitted.filter(|t| t.total() < kept.total()).unwrap_or(kept)))
}

/// Asks the finer base about what came near to each effect that was named: the one that it clearly prefers is named.
fn decide_rivals(triangle: &Problem<'_>, found: &mut Search, best: &mut Trial, seed: u64) -> Result<(), Error> {
    for n in 0..found.named.len() {
        for i in 0..found.named[n].instead.len() {
            let other = found.named[n].instead[i].clone();
            // The others of its set are those of the best, or another rival has been named since.
            let stands = best.fit.hypothesis.without(Cause::Effect(found.named[n].effect)).causes()
                == other.hypothesis.without(Cause::Effect(other.effect)).causes();
            let near = other.tie
                || (other.judgement.explains_enough() && other.cv_rmse <= LARGE_RATIO * found.named[n].cv_with);
            // In one loop no base can tell what is late from what is late otherwise.
            if !near || !stands || triangle.only_loop.is_some() {
                continue;
            }
            let Some(trial) = triangle.fit(&other.hypothesis)?.and_then(|f| Trial::of(triangle, f)) else { continue };
            let named = &mut found.named[n];
            named.instead[i].tie = score::undecided(best, &trial, seed);
            if other.judgement.explains_enough() && score::clearly_better(best, &trial, seed) {
                let was = &mut named.instead[i];
                (was.effect, was.cv_rmse, was.judgement) = (named.effect, named.cv_with, named.judgement);
                was.hypothesis = best.fit.hypothesis.clone();
                (named.effect, named.cv_with, named.judgement) = (other.effect, other.cv_rmse, other.judgement);
                *best = trial;
            }
        }
        found.named[n].instead.sort_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
    }
    found.named.sort_by_key(|n| n.effect);
    Ok(())
}

fn is_named(found: &Search, effect: Effect) -> bool {
    found.named.iter().any(|n| n.effect == effect)
}

/// What a triangle of fewer cells finds beyond what was found, where it sees far better too; nothing where its word does not stand.
fn searched_anew(
    problem: &Problem<'_>,
    triangle: &Problem<'_>,
    found: &Search,
    already: &[Cause],
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Option<Search>, Error> {
    let basis = PreisachBasis::for_samples(problem.samples, SEARCHED_CELLS);
    let coarser = Problem::new(triangle.samples, &basis, triangle.blocks, triangle.zero_per_file).widening_as(problem);
    let rough = placed(&coarser, &found.best.fit.hypothesis)?;
    let from = rough.map(|rough| coarser.fit(&rough.hypothesis)).transpose()?.flatten();
    let from = from.and_then(|f| Trial::of(&coarser, f));
    let Some(from) = from.filter(|t| score::is_far_better(&found.best, t)) else { return Ok(None) };
    let mut anew = further(&coarser, from.fit, already, found.noise, seed, progress)?;
    beside_nameless(&coarser, &mut anew, already)?;
    // A wandering alone is no news: of what a triangle leaves some is its own, and wanders like anything.
    let news = anew.named.iter().any(|n| !is_named(found, n.effect));
    Ok((news && !may_be_drag(problem, found, &anew)?).then_some(anew))
}

/// Whether what the triangle alone calls late, or creep, is better explained by a hysteresis that takes its time, which the triangle cannot do:
/// the base of the search, which can, is asked.
fn may_be_drag(problem: &Problem<'_>, found: &Search, anew: &Search) -> Result<bool, Error> {
    let late: Vec<Effect> =
        anew.named.iter().map(|n| n.effect).filter(|e| SLOW.contains(e) && !is_named(found, *e)).collect();
    if late.is_empty() {
        return Ok(false);
    }
    let basis = ScreeningBasis::for_samples(problem.samples, true, None);
    let dragging = Problem::new(problem.samples, &basis, problem.blocks, problem.zero_per_file).widening_as(problem);
    let squares =
        |h: &Hypothesis| Ok::<_, Error>(dragging.fit(h)?.and_then(|f| Trial::of(&dragging, f)).map(|t| t.total()));
    let with = &anew.best.fit.hypothesis;
    let without = late.iter().fold(with.clone(), |h, e| h.without(Cause::Effect(*e)));
    let (Some(as_found), Some(from)) = (squares(with)?, dragging.fit_linear(&without)?) else { return Ok(false) };
    for start in starts(&Scan::new(&dragging, &from, 0.0)?, Cause::Effect(Effect::RateDependence))? {
        if squares(&start)?.is_some_and(|dragged| dragged < as_found) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Takes back what is small beside a wandering, or an amplifier that does not follow, that was found.
fn beside_nameless(problem: &Problem<'_>, found: &mut Search, already: &[Cause]) -> Result<(), Error> {
    let h = found.best.fit.hypothesis.clone();
    let follows = Hypothesis { slew_limit: None, ..h.clone() };
    let by_less_than_a_sample = |seconds: f64| seconds < problem.samples.period;
    let share = |effect: Effect| match effect {
        Effect::Delay if h.effects.delay.is_some_and(|p| by_less_than_a_sample(p.seconds)) => f64::INFINITY,
        Effect::Lag if h.effects.lag.is_some_and(|p| by_less_than_a_sample(p.seconds)) => f64::INFINITY,
        // An amplifier turns between two samples, where no row shows it: what remains of it looks like an effect of the motion, none of the sensor.
        _ if effect.acts_on_the_motion() => MIN_SHARE_BESIDE_SLEW_LIMIT,
        _ => 0.0,
    };
    beside(problem, found, already, &follows, &share)?;
    // A zero or a gain that wanders is interpolated between few heights; the remainder looks like many effects.
    let still = Hypothesis { zero_wanders: false, gain_wanders: false, ..found.best.fit.hypothesis.clone() };
    beside(problem, found, already, &still, &|_| MINOR_SHARE)
}

/// Takes back what is late or slow beside a law of the rate where any other law of the rate takes it as well: what a formula misses of an actuator's own
/// law would be called a lag or a creep.
fn beside_a_law_of_the_rate(
    problem: &Problem<'_>,
    found: &mut Search,
    already: &[Cause],
    seed: u64,
) -> Result<(), Error> {
    loop {
        let h = found.best.fit.hypothesis.clone();
        let new = beyond(&h, already);
        let late: Vec<Cause> = SLOW.map(Cause::Effect).into_iter().filter(|cause| new.contains(cause)).collect();
        if late.is_empty() || !new.contains(&Cause::Effect(Effect::RateDependence)) {
            return Ok(());
        }
        // A law whose thresholds grow says over what time the rate is felt.
        let felt_over = h.effects.widening.as_ref().map_or(0.0, |p| p.seconds);
        let rated = RatedBasis::around(problem.basis, problem.samples, felt_over);
        let Some(rated) = rated.filter(|rated| ROWS_PER_UNKNOWN * rated.len() <= problem.samples.len()) else {
            return Ok(());
        };
        let any_law = Problem::new(problem.samples, &rated, problem.blocks, problem.zero_per_file);
        let fitted = |h: &Hypothesis| Ok::<_, Error>(any_law.fit(h)?.and_then(|f| Trial::of(&any_law, f)));
        let Some(with) = fitted(&h)? else { return Ok(()) };
        let mut needless: Option<(Cause, Trial)> = None;
        for cause in late {
            let Some(without) = fitted(&h.without(cause))? else { continue };
            if !score::judge(&any_law, &without, &with, found.noise, seed).accepted()
                && needless.as_ref().is_none_or(|(_, least)| without.total() < least.total())
            {
                needless = Some((cause, without));
            }
        }
        let Some((cause, _)) = needless else { return Ok(()) };
        let Some(trial) = problem.fit(&h.without(cause))?.and_then(|f| Trial::of(problem, f)) else { return Ok(()) };
        found.best = trial;
        let stays = beyond(&found.best.fit.hypothesis, already);
        found.named.retain(|n| stays.contains(&Cause::Effect(n.effect)));
    }
}

/// Takes back what explains less than a share of what was found does beyond `less`, which lacks something without a name.
fn beside(
    problem: &Problem<'_>,
    found: &mut Search,
    already: &[Cause],
    less: &Hypothesis,
    share: &dyn Fn(Effect) -> f64,
) -> Result<(), Error> {
    let h = &found.best.fit.hypothesis;
    if less == h {
        return Ok(());
    }
    let Some(without) = problem.fit_linear(less)?.and_then(|f| Trial::of(problem, f)) else { return Ok(()) };
    let explained = without.cv_rmse().powi(2) - found.best.cv_rmse().powi(2);
    let mut kept = h.clone();
    found.named.retain(|n| {
        let enough = n.cv_without.powi(2) - n.cv_with.powi(2) >= share(n.effect) * explained.max(0.0);
        if enough || n.judgement.alone {
            return true;
        }
        // What was judged is the last of two modes; the other stays, and the name with it.
        let cause = Cause::Effect(n.effect);
        kept = kept.without(cause);
        beyond(&kept, already).contains(&cause)
    });
    if kept != *h
        && let Some(trial) = problem.fit(&kept)?.and_then(|f| Trial::of(problem, f))
    {
        found.best = trial;
    }
    Ok(())
}
