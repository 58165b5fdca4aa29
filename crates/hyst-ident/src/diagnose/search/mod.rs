//! Search for effects: forward with a beam, then elimination, then swaps.

mod drift;
mod elimination;
mod final_set;
mod judge;
mod race;
mod result;
mod swaps;

use hyst_core::Error;
use rayon::prelude::*;

pub(super) use result::{Named, NearMiss, Rival, Search};

use super::causes::{candidates, new_causes};
use super::scan::Scan;
use super::score::{self, Judgement};
use super::trial::Trial;
use crate::criteria::{LARGE_RATIO, MIN_RMSE_RATIO};
use crate::nested::{Cause, Fitted, Problem};
use crate::noise::{noise_floor, quantisation};
use drift::drift_instead_of_wander;
use final_set::final_set;
use judge::Judge;
use swaps::swaps;

/// Maximum number of effects found in one record.
const MAX_EFFECTS: usize = 5;

/// Searches for effects, starting from a fit that may contain more than the causes in `already`.
pub(crate) fn search(
    problem: &Problem<'_>,
    base: Fitted,
    already: &[Cause],
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Search, Error> {
    search_with_noise(problem, base, already, f64::INFINITY, seed, progress)
}

/// Searches as [`search`] does; the noise is `known` to be at most this \[output unit\].
pub(super) fn search_with_noise(
    problem: &Problem<'_>,
    base: Fitted,
    already: &[Cause],
    known: f64,
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Search, Error> {
    let steps = quantisation(&problem.samples.output);
    let noise = noise_floor(&problem.residual(&base)?, &problem.samples.segments).min(known).max(steps);
    let mut judge = Judge::new(problem, noise, seed);
    let Some(start) = Trial::of(problem, base.clone()) else {
        // Without cross-validation nothing can be named.
        let nothing = Trial { blocks: vec![base.squares], fit: base };
        return Ok(Search { best: nothing, named: Vec::new(), noise, near: Vec::new(), cv_rmse_with_wander: None });
    };

    let mut beam = vec![start.clone()];
    let mut best = start;
    // The best set without unlisted causes.
    let mut named = best.clone();
    let unlisted = |t: &Trial| t.fit.hypothesis.causes().iter().any(|cause| cause.is_unlisted());
    // Causes that nearly qualified, and the set that they were added to.
    let mut near = (best.fit.hypothesis.causes(), Vec::new());
    for round in 1..=MAX_EFFECTS {
        if judge.nothing_to_gain(if unlisted(&best) { &named } else { &best }) {
            break;
        }
        progress(&format!("searching for effects, round {round}"));
        let scans: Vec<Scan<'_>> = beam.iter().map(|t| judge.scan(&t.fit)).collect::<Result<_, _>>()?;
        let parents = || beam.iter().zip(&scans);
        let jobs: Vec<(&Trial, &Scan<'_>, Cause)> = parents()
            .flat_map(|(t, scan)| candidates(problem, &t.fit).into_iter().map(move |c| (t, scan, c)))
            .collect();
        let raced: Vec<(&Scan<'_>, Cause)> = jobs.iter().map(|(_, scan, cause)| (*scan, *cause)).collect();
        let trials = judge.race(&raced)?;
        let judged: Vec<Option<Judgement>> = jobs
            .par_iter()
            .zip(&trials)
            .map(|((parent, ..), trial)| trial.as_ref().map(|t| judge.judge(parent, t)))
            .collect();
        let mut next: Vec<Trial> = Vec::new();
        let parent = beam[0].fit.hypothesis.causes();
        near = (parent.clone(), Vec::new());
        for ((trial, judgement), (from, _, cause)) in trials.into_iter().zip(judged).zip(&jobs) {
            let (Some(trial), Some(judgement)) = (trial, judgement) else { continue };
            // A set that is worse than a smaller one leads nowhere. Sets with unlisted causes are not compared with
            // sets without.
            let least = if unlisted(&trial) { best.total() } else { named.total() };
            if trial.total() >= least || !judgement.accepted() {
                let counts = judgement.is_sure() && from.fit.hypothesis.causes() == parent;
                let effect = cause.effect().filter(|_| counts);
                near.1.extend(effect.map(|effect| NearMiss { effect, cv_rmse: trial.cv_rmse(), judgement }));
                continue;
            }
            // Of two ways to the same set of effects, keep the better.
            let names = trial.fit.hypothesis.causes();
            match next.iter_mut().find(|t| t.fit.hypothesis.causes() == names) {
                Some(same) if same.total() > trial.total() => *same = trial,
                Some(_) => {}
                None => next.push(trial),
            }
        }
        if next.is_empty() {
            break;
        }
        next.sort_by(|a, b| a.total().total_cmp(&b.total()));
        if next[0].total() < best.total() {
            best = next[0].clone();
        }
        if let Some(better) = next.iter().find(|t| !unlisted(t) && t.total() < named.total()) {
            named = better.clone();
        }
        // An unlisted cause has many numbers and explains nearly anything. It must not end the search among the listed
        // effects.
        let far = LARGE_RATIO * best.total();
        let second = next.iter().skip(1).find(|t| unlisted(&next[0]) && !unlisted(t));
        let second = second.or_else(|| next.iter().skip(1).find(|t| t.total() <= far)).cloned();
        // The residual of a smaller model may look like noise. The floor is only ever lowered.
        judge.noise = judge.noise.min(noise_floor(&problem.residual(&best.fit)?, &problem.samples.segments)).max(steps);
        beam = std::iter::once(next[0].clone()).chain(second).collect();
    }

    // An unlisted cause has to be worth its many numbers, against several effects as against one. If effects found
    // without it explain nearly as much as it adds to its own set, it only explained their misfit.
    let is_listed_enough = |best: &Trial| -> Result<bool, Error> {
        let causes = best.fit.hypothesis.causes().into_iter().filter(|c| c.is_unlisted());
        let bare = judge.refit(&causes.fold(best.fit.hypothesis.clone(), |h, c| h.without(c)))?;
        let takes_nearly_all = |bare: Trial| score::explains_nearly_all(bare.total(), named.total(), best.total());
        Ok(!score::is_worth(&named, best) || bare.is_some_and(takes_nearly_all))
    };
    if unlisted(&best) && is_listed_enough(&best)? {
        best = named.clone();
    }
    let mut left: Vec<Vec<Cause>> = Vec::new();
    let instead = |best: &Trial| Ok((unlisted(best) && is_listed_enough(best)?).then(|| named.clone()));
    let (best, list) = final_set(&judge, best, already, &mut left, &instead, progress)?;
    let noise = judge.noise;
    let near = if near.0 == best.fit.hypothesis.causes() { near.1 } else { Vec::new() };
    if let Some(even) = drift_instead_of_wander(&judge, &best, already)? {
        let (_, named) = swaps(&judge, &even, already, &left)?;
        return Ok(Search { cv_rmse_with_wander: Some(best.cv_rmse()), best: even, named, noise, near });
    }
    Ok(Search { best, named: list, noise, near, cv_rmse_with_wander: None })
}

/// Returns whether one more cause may make a set predict far better, as far as probes show.
pub(super) fn may_be_far_better(problem: &Problem<'_>, set: &Trial, noise: f64, seed: u64) -> Result<bool, Error> {
    let judge = Judge::new(problem, noise, seed);
    let least = set.fit.squares * (1.0 - MIN_RMSE_RATIO.powi(-2));
    let scan = Scan::new(problem, &set.fit, least)?;
    judge.may_win(&scan, &candidates(problem, &set.fit))
}

/// Replaces the law of each cause beyond `already` by the law that fits best on this basis, everything else refitted.
/// Another basis may have taken up a part of an effect and so favoured another law.
pub(super) fn with_best_laws(
    problem: &Problem<'_>,
    set: Trial,
    already: &[Cause],
    noise: f64,
    seed: u64,
) -> Result<Trial, Error> {
    let judge = Judge::new(problem, noise, seed);
    let mut best = set;
    for cause in new_causes(&best.fit.hypothesis, already) {
        let Some(less) = problem.fit(&best.fit.hypothesis.without(cause))? else { continue };
        let with = judge.trials(&judge.scan(&less)?, cause)?;
        if let Some(with) = with.filter(|with| score::is_worth(&best, with) && score::sensible(problem, with)) {
            best = with;
        }
    }
    Ok(best)
}
