//! What was found, on the finest base at hand: parameters refitted, and names that this base does not need taken back.
//!
//! The base of the search is rich but smooth. Where a Preisach triangle predicts the record better, what the search took for an effect
//! may have been the base's own misfit, and what it found may be bent by it.

use std::collections::BTreeMap;

use hyst_core::Error;

use super::score;
use super::search::Search;
use super::trial::Trial;
use super::uncertainty::standard_errors;
use crate::base::PreisachBasis;
use crate::lsq::Blocks;
use crate::nested::{Cause, Hypothesis, Problem};
use crate::samples::Samples;

/// An RMSE of this many noise floors counts as the floor.
pub(super) const AT_FLOOR: f64 = 1.3;
/// Error from which on the finer base is the better one.
const BETTER: f64 = 0.9;
/// Cells along an edge of the triangle.
const CELLS: usize = 24;
/// Rows that the comparison uses.
const ROWS: usize = 8_000;
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
    beside_wandering(problem, found)?;
    let of = |trial: &Trial| Finer {
        hypothesis: trial.fit.hypothesis.clone(),
        errors: standard_errors(&trial.fit),
        cv_rmse: trial.cv_rmse(),
    };
    // The triangle has no drag.
    if found.best.cv_rmse() <= AT_FLOOR * found.noise || found.best.fit.hypothesis.drag.is_some() {
        return Ok(of(&found.best));
    }
    let blocks = Blocks::new(samples, problem.blocks.rows.len(), ROWS);
    let basis = PreisachBasis::for_samples(samples, CELLS);
    let triangle = Problem::new(samples, &basis, &blocks, problem.zero_per_file);
    let fitted = |h: &Hypothesis| Ok::<_, Error>(triangle.fit(h)?.and_then(|f| Trial::of(&triangle, f)));
    let Some(mut best) = fitted(&found.best.fit.hypothesis)? else { return Ok(of(&found.best)) };
    if best.cv_rmse() >= BETTER * found.best.cv_rmse() {
        return Ok(of(&found.best));
    }
    loop {
        let mut least: Option<(Cause, Trial)> = None;
        for cause in best.fit.hypothesis.causes().into_iter().filter(|c| !already.contains(c)) {
            let without = triangle.fit_linear(&best.fit.hypothesis.without(cause))?;
            let Some(without) = without.and_then(|f| Trial::of(&triangle, f)) else { continue };
            let judgement = score::judge(samples, &without, &best, found.noise, seed);
            if judgement.accepted() {
                if let Some(named) = found.named.iter_mut().find(|n| cause.effect() == Some(n.effect)) {
                    (named.cv_without, named.cv_with) = (without.cv_rmse(), best.cv_rmse());
                    named.judgement = judgement;
                }
            } else if least.as_ref().is_none_or(|(_, l)| without.total() < l.total()) {
                least = Some((cause, without));
            }
        }
        let Some((cause, without)) = least else { break };
        found.named.retain(|n| cause.effect() != Some(n.effect));
        best = fitted(&without.fit.hypothesis)?.unwrap_or(without);
    }
    Ok(of(&best))
}

/// Takes back what is small beside a wandering that was found.
fn beside_wandering(problem: &Problem<'_>, found: &mut Search) -> Result<(), Error> {
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
        if !enough {
            kept = kept.without(Cause::Effect(n.effect));
        }
        enough
    });
    if kept != *h
        && let Some(trial) = problem.fit(&kept)?.and_then(|f| Trial::of(problem, f))
    {
        found.best = trial;
    }
    Ok(())
}
