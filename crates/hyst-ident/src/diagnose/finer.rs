//! Checks the effects found on a finer basis: refits their parameters, drops the names that it does not need and
//! searches for effects that the misfit of the screening basis has hidden.
//!
//! The screening basis is rich but smooth. If a Preisach triangle predicts the record better, a named effect may have
//! been misfit of the screening basis, its parameters may be biased, and other effects may be hidden.

use std::collections::BTreeMap;

use hyst_core::Error;

use super::causes::new_causes;
use super::scan::Scan;
use super::score;
use super::search::{Search, search_with_noise};
use super::shape::own_limits;
use super::starts::starts;
use super::trial::Trial;
use super::uncertainty::{Undetermined, standard_errors};
use crate::base::{Basis, PreisachBasis, ROWS_PER_UNKNOWN, RatedBasis, ScreeningBasis};
use crate::criteria::{LARGE_RATIO, MIN_RMSE_DROP, MIN_SHARE_BESIDE_SLEW_LIMIT, MINOR_SHARE, NEGLIGIBLE_SHARE};
use crate::lsq::Blocks;
use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Problem};
use crate::samples::Samples;
use crate::settle::start_up_rows;

/// Cells along an edge of the triangle.
const CELLS: usize = 24;
/// Cells along an edge of the triangle that is searched: a trial on it is four times as fast.
const SEARCHED_CELLS: usize = 16;
/// Maximum number of rows.
const ROWS: usize = 8_000;

/// Effects that a rate-dependent hysteresis may be mistaken for.
const LATE_OR_SLOW: [Effect; 4] = [Effect::Delay, Effect::Lag, Effect::Resonance, Effect::Creep];

/// Final result of the check.
pub(super) struct Finer {
    pub(super) hypothesis: Hypothesis,
    pub(super) errors: BTreeMap<String, f64>,
    /// Cross-validated RMSE on the finest basis \[y\].
    pub(super) cv_rmse: f64,
}

/// Refits the effects on the finest basis, drops those that it does not need and searches for hidden ones.
pub(super) fn refine(
    problem: &Problem<'_>,
    found: &mut Search,
    already: &[Cause],
    samples: &Samples,
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Finer, Error> {
    drop_small_next_to_unlisted(problem, found, already)?;
    drop_misfit_of_rate_law(problem, found, already, seed)?;
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
    let Some(rough) = first_fit(&first, &found.best.fit.hypothesis)? else { return Ok(of(&found.best)) };
    // A triangle keeps every reversal in its memory, so it also shows how long an unknown start lasts.
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
        && let Some(anew) = search_coarser_triangle(problem, &triangle, found, already, seed, progress)?
        && let Some(rough) = first_fit(&triangle, &anew.best.fit.hypothesis)?
        && let Some(with) = fitted(&rough.hypothesis)?
    {
        (*found, best) = (anew, with);
    }
    decide_rivals(&triangle, found, &mut best, seed)?;
    loop {
        let mut least: Option<Trial> = None;
        let loose = Undetermined::of(&best.fit, samples.output_span());
        for cause in new_causes(&best.fit.hypothesis, already) {
            let Some(without) = without(&triangle, &best, cause, found.noise, seed)? else { continue };
            let is_loose = loose.contradicts(cause, || score::is_far_better(&without, &best));
            if (is_loose || !score::judge(&triangle, &without, &best, found.noise, seed).accepted())
                && least.as_ref().is_none_or(|l| without.total() < l.total())
            {
                least = Some(without);
            }
        }
        let Some(without) = least else { break };
        best = fitted(&without.fit.hypothesis)?.unwrap_or(without);
        // If one of two modes stays, the name stays.
        let stays = new_causes(&best.fit.hypothesis, already);
        found.named.retain(|n| stays.contains(&Cause::Effect(n.effect)));
    }
    Ok(of(&best))
}

/// Returns a first fit with the effects found on another basis. The saturation limit is refitted if that is better.
fn first_fit(problem: &Problem<'_>, found: &Hypothesis) -> Result<Option<Fitted>, Error> {
    let as_found = problem.fit_linear(found)?;
    let stop = if found.effects.saturation.is_some() { own_limits(problem, found)? } else { None };
    Ok(as_found.into_iter().chain(stop).min_by(|a, b| a.squares.total_cmp(&b.squares)))
}

/// Returns the finer basis without one cause, everything else refitted. Parameters are not refitted if the cause is
/// clearly not needed without that.
fn without(triangle: &Problem<'_>, best: &Trial, cause: Cause, noise: f64, seed: u64) -> Result<Option<Trial>, Error> {
    let less = best.fit.hypothesis.without(cause);
    let Some(kept) = triangle.fit_linear(&less)?.and_then(|f| Trial::of(triangle, f)) else { return Ok(None) };
    if !score::judge(triangle, &kept, best, noise, seed).accepted() {
        return Ok(Some(kept));
    }
    let refitted = triangle.fit(&less)?.and_then(|f| Trial::of(triangle, f));
    Ok(Some(refitted.filter(|t| t.total() < kept.total()).unwrap_or(kept)))
}

/// Lets the finer basis decide between each named effect and its close rivals: a clearly better rival takes over the
/// name.
fn decide_rivals(triangle: &Problem<'_>, found: &mut Search, best: &mut Trial, seed: u64) -> Result<(), Error> {
    for n in 0..found.named.len() {
        for i in 0..found.named[n].rivals.len() {
            let other = found.named[n].rivals[i].clone();
            // Only if the other effects of both sets are the same: another rival may have been named since.
            let stands = best.fit.hypothesis.without(Cause::Effect(found.named[n].effect)).causes()
                == other.hypothesis.without(Cause::Effect(other.effect)).causes();
            let near = other.tie
                || (other.judgement.explains_enough() && other.cv_rmse <= LARGE_RATIO * found.named[n].cv_with);
            // In a single loop no basis can tell one late effect from another.
            if !near || !stands || triangle.only_loop.is_some() {
                continue;
            }
            let Some(trial) = triangle.fit(&other.hypothesis)?.and_then(|f| Trial::of(triangle, f)) else { continue };
            let named = &mut found.named[n];
            // A difference that is negligible beside what both explain decides nothing, however constant it is.
            let difference = (best.total() - trial.total()).abs() / best.fit.rows.max(1) as f64;
            let explained = named.cv_without.powi(2) - named.cv_with.powi(2);
            let tie = difference < NEGLIGIBLE_SHARE * explained || score::undecided(best, &trial, seed);
            named.rivals[i].tie = tie;
            if !tie && other.judgement.explains_enough() && score::clearly_better(best, &trial, seed) {
                let was = &mut named.rivals[i];
                (was.effect, was.cv_rmse, was.judgement) = (named.effect, named.cv_with, named.judgement);
                was.hypothesis = best.fit.hypothesis.clone();
                (named.effect, named.cv_with, named.judgement) = (other.effect, other.cv_rmse, other.judgement);
                *best = trial;
            }
        }
        found.named[n].rivals.sort_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
    }
    found.named.sort_by_key(|n| n.effect);
    Ok(())
}

fn is_named(found: &Search, effect: Effect) -> bool {
    found.named.iter().any(|n| n.effect == effect)
}

/// Searches a coarser triangle for further effects. Returns the result if that triangle also predicts far better and
/// finds a new name; `None` otherwise.
fn search_coarser_triangle(
    problem: &Problem<'_>,
    triangle: &Problem<'_>,
    found: &Search,
    already: &[Cause],
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Option<Search>, Error> {
    let basis = PreisachBasis::for_samples(problem.samples, SEARCHED_CELLS);
    let coarser = Problem::new(triangle.samples, &basis, triangle.blocks, triangle.zero_per_file).widening_as(problem);
    let rough = first_fit(&coarser, &found.best.fit.hypothesis)?;
    let from = rough.map(|rough| coarser.fit(&rough.hypothesis)).transpose()?.flatten();
    let from = from.and_then(|f| Trial::of(&coarser, f));
    let Some(from) = from.filter(|t| score::is_far_better(&found.best, t)) else { return Ok(None) };
    let mut anew = search_with_noise(&coarser, from.fit, already, found.noise, seed, progress)?;
    drop_small_next_to_unlisted(&coarser, &mut anew, already)?;
    // A new wander alone does not count: the triangle's own misfit looks like one.
    let news = anew.named.iter().any(|n| !is_named(found, n.effect));
    Ok((news && !may_be_rate_dependence(problem, found, &anew)?).then_some(anew))
}

/// Returns whether a late effect or a creep that only the triangle finds is better explained by rate-dependent
/// hysteresis. The triangle cannot model that, so the screening basis decides.
fn may_be_rate_dependence(problem: &Problem<'_>, found: &Search, anew: &Search) -> Result<bool, Error> {
    let late: Vec<Effect> =
        anew.named.iter().map(|n| n.effect).filter(|e| LATE_OR_SLOW.contains(e) && !is_named(found, *e)).collect();
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

/// Drops effects that are small compared with a zero or gain wander or a slew limit that was found.
fn drop_small_next_to_unlisted(problem: &Problem<'_>, found: &mut Search, already: &[Cause]) -> Result<(), Error> {
    let h = found.best.fit.hypothesis.clone();
    let follows = Hypothesis { slew_limit: None, ..h.clone() };
    let by_less_than_a_sample = |seconds: f64| seconds < problem.samples.period;
    let share = |effect: Effect| match effect {
        Effect::Delay if h.effects.delay.is_some_and(|p| by_less_than_a_sample(p.seconds)) => f64::INFINITY,
        Effect::Lag if h.effects.lag.is_some_and(|p| by_less_than_a_sample(p.seconds)) => f64::INFINITY,
        // A slew limit ends between two samples. Its remaining error looks like an effect of the motion, not of the
        // sensor.
        _ if effect.acts_on_the_motion() => MIN_SHARE_BESIDE_SLEW_LIMIT,
        _ => 0.0,
    };
    drop_below_share(problem, found, already, &follows, &share)?;
    // A wandering zero or gain is interpolated between few points; its remaining error looks like many effects.
    let still = Hypothesis { zero_wanders: false, gain_wanders: false, ..found.best.fit.hypothesis.clone() };
    drop_below_share(problem, found, already, &still, &|_| MINOR_SHARE)
}

/// Drops late and slow effects next to a rate-dependence if a free law of the rate explains the record without them.
/// The misfit of the formula for rate-dependence would otherwise be named a lag or a creep.
fn drop_misfit_of_rate_law(
    problem: &Problem<'_>,
    found: &mut Search,
    already: &[Cause],
    seed: u64,
) -> Result<(), Error> {
    loop {
        let h = found.best.fit.hypothesis.clone();
        let new = new_causes(&h, already);
        let late: Vec<Cause> =
            LATE_OR_SLOW.map(Cause::Effect).into_iter().filter(|cause| new.contains(cause)).collect();
        if late.is_empty() || !new.contains(&Cause::Effect(Effect::RateDependence)) {
            return Ok(());
        }
        // A widening has its own time over which it averages the rate.
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
        let stays = new_causes(&found.best.fit.hypothesis, already);
        found.named.retain(|n| stays.contains(&Cause::Effect(n.effect)));
    }
}

/// Drops effects that explain less than a share of what the causes missing in `less` explain.
fn drop_below_share(
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
        if enough || n.judgement.sensor_tone {
            return true;
        }
        // The judgement was about the last of two modes. If the other one stays, the name stays.
        let cause = Cause::Effect(n.effect);
        kept = kept.without(cause);
        new_causes(&kept, already).contains(&cause)
    });
    if kept != *h
        && let Some(trial) = problem.fit(&kept)?.and_then(|f| Trial::of(problem, f))
    {
        found.best = trial;
    }
    Ok(())
}
