//! What was found, on the finest base at hand: parameters refitted, and names that this base does not need taken back.
//!
//! The base of the search is rich but smooth. Where a Preisach triangle predicts the record better, what the search took for an effect
//! may have been the base's own misfit, and what it found may be bent by it.

use std::collections::BTreeMap;

use hyst_core::Error;

use super::score;
use super::search::{Search, beyond};
use super::trial::Trial;
use super::uncertainty::standard_errors;
use crate::base::PreisachBasis;
use crate::lsq::Blocks;
use crate::nested::{Cause, Hypothesis, Problem};
use crate::samples::Samples;
use crate::settle::start_up_rows;

/// An RMSE of this many noise floors counts as the floor.
pub(super) const AT_FLOOR: f64 = 1.3;
/// An RMSE of this many noise floors leaves a finer base nothing to find.
const NOTHING_LEFT: f64 = 1.1;
/// Error from which on the finer base is the better one.
const BETTER: f64 = 0.9;
/// Cells along an edge of the triangle.
const CELLS: usize = 24;
/// Rows that the comparison uses.
const ROWS: usize = 8_000;
/// Error of the search up to which the finer base is asked about another effect in the place of one that was named.
const NEAR: f64 = 3.0;
/// Beside a wandering that explains much, an effect has to explain at least this share of as much (variance): the wandering is not
/// modelled to the last digit, and what it leaves sounds like anything.
const BESIDE_WANDERING: f64 = 0.1;

/// What is known in the end.
pub(super) struct Finer {
    pub(super) hypothesis: Hypothesis,
    pub(super) errors: BTreeMap<String, f64>,
    /// Cross-validated error that the finest base leaves \[y\].
    pub(super) cv_rmse: f64,
}

/// Takes names back that the finest base does not need, and refits the others there.
pub(super) fn refine(
    problem: &Problem<'_>,
    found: &mut Search,
    already: &[Cause],
    samples: &Samples,
    seed: u64,
) -> Result<Finer, Error> {
    beside_wandering(problem, found, already)?;
    let of = |trial: &Trial| Finer {
        hypothesis: trial.fit.hypothesis.clone(),
        errors: standard_errors(&trial.fit, samples.time[0]),
        cv_rmse: trial.cv_rmse(),
    };
    // The triangle has no drag.
    if found.best.cv_rmse() <= NOTHING_LEFT * found.noise || found.best.fit.hypothesis.drag.is_some() {
        return Ok(of(&found.best));
    }
    let blocks = Blocks::new(samples, problem.blocks.rows.len(), ROWS);
    let basis = PreisachBasis::for_samples(samples, CELLS);
    let mut settled = samples.clone();
    let first = Problem::new(samples, &basis, &blocks, problem.zero_per_file);
    let Some(rough) = first.fit_linear(&found.best.fit.hypothesis)? else { return Ok(of(&found.best)) };
    // A triangle that keeps every turn in its memory also shows how long an unknown start lasts.
    let starting = start_up_rows(samples, &first.residual(&rough)?);
    settled.settling.iter_mut().zip(starting).for_each(|(known, starts)| *known |= starts);
    drop(first);
    let triangle = Problem::new(&settled, &basis, &blocks, problem.zero_per_file);
    let fitted = |h: &Hypothesis| Ok::<_, Error>(triangle.fit(h)?.and_then(|f| Trial::of(&triangle, f)));
    let Some(mut best) = fitted(&found.best.fit.hypothesis)? else { return Ok(of(&found.best)) };
    if best.cv_rmse() >= BETTER * found.best.cv_rmse() {
        return Ok(of(&found.best));
    }
    decide_rivals(&triangle, found, &mut best, seed)?;
    loop {
        let mut least: Option<Trial> = None;
        for cause in beyond(&best.fit.hypothesis, already) {
            let Some(without) = without(&triangle, &best, cause, found.noise, seed)? else { continue };
            if !score::judge(&triangle, &without, &best, found.noise, seed).accepted()
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
            let near = other.tie || (other.judgement.accepted() && other.cv_rmse <= NEAR * found.named[n].cv_with);
            // In one loop no base can tell what is late from what is late otherwise.
            if !near || !stands || triangle.only_loop.is_some() {
                continue;
            }
            let Some(trial) = triangle.fit(&other.hypothesis)?.and_then(|f| Trial::of(triangle, f)) else { continue };
            let named = &mut found.named[n];
            named.instead[i].tie = score::undecided(best, &trial, seed);
            if other.judgement.accepted() && score::clearly_better(best, &trial, seed) {
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

/// Takes back what is small beside a wandering that was found.
fn beside_wandering(problem: &Problem<'_>, found: &mut Search, already: &[Cause]) -> Result<(), Error> {
    let h = &found.best.fit.hypothesis;
    let mut still = h.clone();
    (still.zero_wanders, still.gain_wanders) = (false, false);
    if still == *h {
        return Ok(());
    }
    let Some(without) = problem.fit_linear(&still)?.and_then(|f| Trial::of(problem, f)) else { return Ok(()) };
    let explained = without.cv_rmse().powi(2) - found.best.cv_rmse().powi(2);
    let mut kept = h.clone();
    found.named.retain(|n| {
        let enough = n.cv_without.powi(2) - n.cv_with.powi(2) >= BESIDE_WANDERING * explained;
        if enough {
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
