//! Search for effects: forward with a beam, then elimination, then swaps.

use std::sync::Mutex;

use hyst_core::Error;
use rayon::prelude::*;

use super::probability::Evidence;
use super::scan::Scan;
use super::score::{self, Judgement, judge};
use super::trial::Trial;
use super::uncertainty::Undetermined;
use super::{hidden, starts};
use crate::criteria::{
    DOMINANT_SHARE, LARGE_RATIO, LAW_ACCURACY, MAX_ZERO_STEP, MIN_NOISE_FLOORS, MIN_RMSE_DROP, NEGLIGIBLE_SHARE,
};
use crate::metrics::rms;
use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Problem};
use crate::noise::{noise_floor, quantisation};

/// Effects of one kind: those that delay the output or widen the loop with rate, and those that bend it. A second one of
/// a kind must explain more than a small share of what the first explains.
const KINDS: [&[Effect]; 2] =
    [&[Effect::Delay, Effect::Lag, Effect::RateDependence], &[Effect::Asymmetry, Effect::Saturation]];
/// Maximum number of effects found in one record.
const MAX_EFFECTS: usize = 5;

/// A named effect with its evidence.
pub(crate) struct Named {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE without it, everything else refitted.
    pub(crate) cv_without: f64,
    /// Cross-validated RMSE with it.
    pub(crate) cv_with: f64,
    /// The best result of each other candidate instead, best first.
    pub(crate) rivals: Vec<Rival>,
    pub(crate) judgement: Judgement,
}

impl Named {
    /// Returns the evidence for the name; `left` is the final cross-validated error in noise floors.
    pub(crate) fn evidence(&self, left: f64) -> Evidence {
        let others = self.rivals.iter().filter(|i| i.judgement.sensible).map(|i| i.cv_rmse);
        let next_best = others.fold(self.cv_without, f64::min) / self.cv_with.max(f64::MIN_POSITIVE);
        Evidence { judgement: self.judgement, next_best, left }
    }
}

/// Another effect instead of a named one.
#[derive(Clone)]
pub(crate) struct Rival {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE with it.
    pub(crate) cv_rmse: f64,
    /// Whether the record cannot tell the two apart.
    pub(crate) tie: bool,
    /// The whole set, with its parameters.
    pub(crate) hypothesis: Hypothesis,
    pub(crate) judgement: Judgement,
}

/// An effect that improves a set, but too little to be named.
#[derive(Clone)]
pub(crate) struct NearMiss {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE with it \[output unit\].
    pub(crate) cv_rmse: f64,
    pub(crate) judgement: Judgement,
}

/// Result of a search.
pub(crate) struct Search {
    pub(crate) best: Trial,
    pub(crate) named: Vec<Named>,
    /// Standard deviation of the white noise \[output unit\].
    pub(crate) noise: f64,
    /// Effects that improve the best set in every part of the record, but too little to be named.
    pub(crate) near: Vec<NearMiss>,
    /// Cross-validated RMSE with a zero wander in addition to the drift of the best set, if there is one \[output
    /// unit\].
    pub(crate) cv_rmse_with_wander: Option<f64>,
}

pub(super) const DRIFT: Cause = Cause::Effect(Effect::Drift);

/// Shared context of all judgements.
pub(super) struct Judge<'a> {
    pub(super) problem: &'a Problem<'a>,
    noise: f64,
    pub(super) seed: u64,
    /// Results of adding a cause to a set. It is read before a race and written in it, so the result does not depend on
    /// threads.
    pub(super) known: Mutex<Vec<(Hypothesis, Cause, Option<Hypothesis>)>>,
}

impl Judge<'_> {
    /// Scans a fit for causes that may be added.
    pub(super) fn scan<'b>(&'b self, from: &'b Fitted) -> Result<Scan<'b>, Error> {
        Scan::new(self.problem, from, score::least_gain_from(from.rows as f64, from.squares, self.noise))
    }

    pub(super) fn refit(&self, effects: &Hypothesis) -> Result<Option<Trial>, Error> {
        Ok(self.problem.fit(effects)?.and_then(|f| Trial::of(self.problem, f)))
    }

    /// Returns whether even a perfect model would gain less than an effect has to.
    fn nothing_to_gain(&self, best: &Trial) -> bool {
        let above = best.total() / best.fit.rows.max(1) as f64 - self.noise * self.noise;
        above < (MIN_NOISE_FLOORS * self.noise).powi(2)
    }

    /// Returns a set without one cause. A small drag next to a creep may be a creep that is faster than the elements of
    /// the search: such elements are then added.
    fn without(&self, set: &Trial, cause: Cause, already: &[Cause]) -> Result<Option<Trial>, Error> {
        let less = set.fit.hypothesis.without(cause);
        let Some(plain) = self.refit(&less)? else { return Ok(None) };
        let drags = cause == Cause::Effect(Effect::RateDependence);
        let creeps = less.effects.creep.is_some() && !already.contains(&Cause::Effect(Effect::Creep));
        let judged = self.judge(&plain, set);
        if !drags || !creeps || !judged.accepted() || judged.over_noise >= LARGE_RATIO {
            return Ok(Some(plain));
        }
        let faster = self.refit(&starts::with_faster_creep(self.problem.samples, &plain.fit.hypothesis))?;
        let better = faster.filter(|t| t.total() < plain.total() && score::sensible(self.problem, t));
        Ok(Some(better.unwrap_or(plain)))
    }

    fn judge(&self, without: &Trial, with: &Trial) -> Judgement {
        judge(self.problem, without, with, self.noise, self.seed)
    }
}

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
    let mut judge = Judge { problem, noise, seed, known: Mutex::default() };
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
    if unlisted(&best) {
        let names_alone = best.fit.hypothesis.causes().into_iter().filter(|c| c.is_unlisted());
        let bare = judge.refit(&names_alone.fold(best.fit.hypothesis.clone(), |h, c| h.without(c)))?;
        let takes_nearly_all = |bare: Trial| explains_nearly_all(bare.total(), named.total(), best.total());
        if !score::is_worth(&named, &best) || bare.is_some_and(takes_nearly_all) {
            best = named;
        }
    }
    // Eliminate and swap until neither changes anything. A set that was left is never entered again, so the loop ends.
    let mut left: Vec<Vec<Cause>> = Vec::new();
    let named = loop {
        progress("checking whether each effect is needed");
        let needed = eliminate(&judge, &best, already)?;
        let change = match needed {
            Some(less) => Some(less),
            None => {
                progress("trying other effects in place of those found");
                let (better, list) = swaps(&judge, &best, already, &left)?;
                match better.map_or_else(|| judge.drift_instead_of_expansion(&best), |better| Ok(Some(better)))? {
                    Some(better) => Some(better),
                    None => break list,
                }
            }
        };
        if let Some(other) = change {
            left.push(best.fit.hypothesis.causes());
            best = other;
        }
    };
    let noise = judge.noise;
    let near = if near.0 == best.fit.hypothesis.causes() { near.1 } else { Vec::new() };
    if let Some(even) = drift_instead_of_wander(&judge, &best, already)? {
        let (_, named) = swaps(&judge, &even, already, &left)?;
        return Ok(Search { cv_rmse_with_wander: Some(best.cv_rmse()), best: even, named, noise, near });
    }
    Ok(Search { best, named, noise, near, cv_rmse_with_wander: None })
}

/// Tries a drift instead of a zero wander. A drift that explains nearly all of the wander is named even if its law is
/// not exact, unless the zero jumps beside it: a zero that moves in steps indicates a slipping mount.
fn drift_instead_of_wander(judge: &Judge<'_>, best: &Trial, already: &[Cause]) -> Result<Option<Trial>, Error> {
    let h = &best.fit.hypothesis;
    if !new_causes(h, already).contains(&Cause::ZeroWanders) || h.effects.drift.is_some() {
        return Ok(None);
    }
    let Some(still) = judge.refit(&h.without(Cause::ZeroWanders))? else { return Ok(None) };
    let Some(even) = judge.trials(&judge.scan(&still.fit)?, DRIFT)? else { return Ok(None) };
    let Some(drift) = even.fit.hypothesis.effects.drift else { return Ok(None) };
    let takes_nearly_all = explains_nearly_all(still.total(), even.total(), best.total());
    let is_even = follows(&judge.problem.wandered_zero(&best.fit), |time_s| drift.at(time_s));
    Ok((takes_nearly_all && is_even && judge.judge(&still, &even).accepted()).then_some(even))
}

/// Returns whether one set explains nearly all that another explains of the residual without either (Σ residual²).
fn explains_nearly_all(without: f64, one: f64, other: f64) -> bool {
    without - one >= DOMINANT_SHARE * (without - other)
}

/// Returns whether a wandering zero, given as times and heights, follows a drift without jumps. The first and the last
/// height are those of few rows, perhaps of a start-up, and do not count.
fn follows(zero: &[(f64, f64)], drift: impl Fn(f64) -> f64) -> bool {
    let [_, zero @ .., _] = zero else { return true };
    let way: f64 = zero.windows(2).map(|z| (z[1].1 - z[0].1).abs()).sum();
    let beside = |(time, height): (f64, f64)| height - drift(time);
    zero.windows(3).all(|z| (beside(z[2]) - beside(z[0])).abs() <= MAX_ZERO_STEP * way)
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
    let judge = Judge { problem, noise, seed, known: Mutex::default() };
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

/// Returns the causes that may be added to a fit. A curve is not among them: this basis bends by itself. The model's
/// own base is checked for a curve at the end.
fn candidates(problem: &Problem<'_>, fit: &Fitted) -> Vec<Cause> {
    let effects = Effect::ALL.into_iter().filter(|e| *e != Effect::Asymmetry).map(Cause::Effect);
    effects
        .chain([Cause::ZeroWanders, Cause::GainWanders, Cause::InitialState, Cause::SlewLimit])
        .filter(|c| fit.hypothesis.has_room(*c) && hidden(*c, problem).is_none())
        .collect()
}

/// Returns the causes of a set beyond those in `already`, each once.
pub(super) fn new_causes(h: &Hypothesis, already: &[Cause]) -> Vec<Cause> {
    let mut names = h.causes();
    for known in already {
        if let Some(at) = names.iter().position(|n| n == known) {
            names.remove(at);
        }
    }
    names.dedup();
    names
}

/// Drops the least needed effect, if there is one that is not needed, whose law the record does not determine, or that
/// explains no more than the misfit of a similar effect's law.
fn eliminate(judge: &Judge<'_>, best: &Trial, already: &[Cause]) -> Result<Option<Trial>, Error> {
    let names = new_causes(&best.fit.hypothesis, already);
    let loose = Undetermined::of(&best.fit, judge.problem.samples.output_span());
    let reduced: Vec<Result<Option<Trial>, Error>> =
        names.par_iter().map(|e| judge.without(best, *e, already)).collect();
    let reduced: Vec<Option<Trial>> = reduced.into_iter().collect::<Result<_, _>>()?;
    let explained = |trial: &Option<Trial>| trial.as_ref().map_or(f64::INFINITY, |t| t.total() - best.total());
    let kind = |cause: &Cause| cause.effect().and_then(|e| KINDS.iter().position(|kind| kind.contains(&e)));
    // No law is exact. A second law of the same kind explains the misfit of the first one or of the base.
    let missed_by_laws = LAW_ACCURACY * rms(&judge.problem.samples.hysteresis().1);
    let size = |trial: &Option<Trial>| {
        trial.as_ref().map_or(f64::INFINITY, |t| (t.cv_rmse().powi(2) - best.cv_rmse().powi(2)).max(0.0).sqrt())
    };
    // A curve that was found before is no candidate here.
    let curve = Cause::Effect(Effect::Asymmetry);
    let is_beside_curve = already.contains(&curve) && names.contains(&Cause::Effect(Effect::Saturation));
    let uncurved = if is_beside_curve { judge.without(best, curve, already)? } else { None };
    let all = || names.iter().zip(&reduced).chain(uncurved.is_some().then_some((&curve, &uncurved)));
    let of_its_kind: Vec<bool> = names
        .iter()
        .zip(&reduced)
        .map(|(cause, own)| {
            let mut others = all().filter(|(other, _)| kind(other) == kind(cause) && *other != cause);
            let is_small =
                |t: &Option<Trial>| explained(own) < NEGLIGIBLE_SHARE * explained(t) || size(own) < missed_by_laws;
            kind(cause).is_some() && others.any(|(_, t)| is_small(t))
        })
        .collect();
    let mut least: Option<Trial> = None;
    for ((cause, trial), is_misfit) in names.iter().zip(reduced).zip(of_its_kind) {
        // If the others become implausible without an effect, the effect is needed.
        let Some(trial) = trial.filter(|t| score::sensible(judge.problem, t)) else { continue };
        let is_loose = loose.contradicts(*cause, || score::is_far_better(&trial, best));
        if (is_loose || is_misfit || !judge.judge(&trial, best).accepted())
            && least.as_ref().is_none_or(|l| trial.total() < l.total())
        {
            least = Some(trial);
        }
    }
    Ok(least)
}

/// Tries every other effect instead of each one. Returns a better set that was not left before, if there is one, and
/// the ranking of the others for each effect.
fn swaps(
    judge: &Judge<'_>,
    best: &Trial,
    already: &[Cause],
    left: &[Vec<Cause>],
) -> Result<(Option<Trial>, Vec<Named>), Error> {
    let mut named = Vec::new();
    let mut better: Option<Trial> = None;
    for cause in new_causes(&best.fit.hypothesis, already) {
        let Some(without) = judge.without(best, cause, already)? else { continue };
        let mut others = candidates(judge.problem, &without.fit);
        let one_loop = judge.problem.only_loop.is_some() && is_late(cause);
        if one_loop {
            let also = [Effect::RateDependence, Effect::Resonance].map(Cause::Effect);
            others.extend(also.into_iter().filter(|c| without.fit.hypothesis.has_room(*c)));
        }
        others.retain(|c| *c != cause);
        let scan = judge.scan(&without.fit)?;
        let jobs: Vec<(&Scan<'_>, Cause)> = others.iter().map(|other| (&scan, *other)).collect();
        let mut rivals = Vec::new();
        for (other, trial) in others.iter().zip(judge.race(&jobs)?) {
            let Some(trial) = trial else { continue };
            let judgement = judge.judge(&without, &trial);
            // A tone that was accepted only for its prominence replaces no effect.
            let accepted = judgement.explains_enough();
            // In a single loop all late effects look alike.
            let alike = one_loop && is_late(*other) && trial.cv_rmse() < (1.0 + MIN_RMSE_DROP) * best.cv_rmse();
            let tie = judgement.sensible && (alike || tie(judge, best, &trial));
            let (cv_rmse, hypothesis) = (trial.cv_rmse(), trial.fit.hypothesis.clone());
            rivals.extend(other.effect().map(|effect| Rival { effect, cv_rmse, tie, hypothesis, judgement }));
            // An unlisted cause has to be worth its many numbers. It is not if it gains next to nothing over an effect.
            let unlisted = || cause.is_unlisted() && !judge.judge(&trial, best).accepted();
            let numbers = |trial: &Trial, cause: Cause| trial.fit.hypothesis.complexity(cause);
            let is_smaller = numbers(&trial, *other) < numbers(best, cause);
            // More parameters have to be worth as much as an effect: a law with several explains more of the base's
            // misfit than a law with one.
            let is_larger = numbers(&trial, *other) > numbers(best, cause);
            let simpler = accepted && is_smaller && (tie || unlisted() || !score::is_worth(&trial, best));
            let clearly =
                accepted && !tie && trial.total() < best.total() && (!is_larger || score::is_worth(best, &trial));
            let fresh = !left.contains(&trial.fit.hypothesis.causes());
            if fresh && (simpler || clearly) && better.as_ref().is_none_or(|b| trial.total() < b.total()) {
                better = Some(trial);
            }
        }
        rivals.sort_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
        if let Some(effect) = cause.effect() {
            named.push(Named {
                effect,
                cv_without: without.cv_rmse(),
                cv_with: best.cv_rmse(),
                judgement: judge.judge(&without, best),
                rivals,
            });
        }
    }
    Ok((better, named))
}

/// Returns whether a cause delays the output.
fn is_late(cause: Cause) -> bool {
    let late = [Effect::Delay, Effect::Lag, Effect::RateDependence, Effect::Resonance];
    cause.effect().is_some_and(|e| late.contains(&e))
}

/// Returns whether the record cannot tell two sets apart: their difference is small against the noise, or neither is
/// better in nearly every bootstrap draw.
fn tie(judge: &Judge<'_>, a: &Trial, b: &Trial) -> bool {
    let per_row = (a.total() - b.total()).abs() / a.fit.rows.max(1) as f64;
    let below_noise =
        per_row < (MIN_NOISE_FLOORS * judge.noise).powi(2) && (a.total() / b.total()).ln().abs() < MIN_RMSE_DROP;
    below_noise || score::undecided(a, b, judge.seed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Effects;
    use hyst_core::{LagParams, ResonanceParams};

    /// Returns a zero with these heights at these times.
    fn zero(times: impl Iterator<Item = f64>, height: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        times.map(|t| (t, height(t))).collect()
    }

    #[test]
    fn a_settling_zero_follows_a_drift_and_a_slipping_one_does_not() {
        let evenly = || (0..17).map(|k| 2.0 * f64::from(k));
        let settles = |t: f64| 1.0 - (-t / 20.0).exp();
        assert!(follows(&zero(evenly(), settles), settles));
        // A root, and the law that is nearest to it.
        assert!(follows(&zero(evenly(), f64::sqrt), |t| 0.1 * t + 2.4 * (1.0 - (-t / 4.0).exp())));
        let slips = |t: f64| [9.0, 17.0, 25.0].into_iter().filter(|at| t > *at).count() as f64;
        assert!(!follows(&zero(evenly(), slips), |t| 0.125 * (t - 5.0)));
    }

    #[test]
    fn a_zero_may_move_further_over_a_gap() {
        let paused = || (0..17).map(|k| 2.0 * f64::from(k) + if k > 8 { 60.0 } else { 0.0 });
        let line = |t: f64| 0.1 * t;
        assert!(follows(&zero(paused(), line), line));
        assert!(!follows(&zero(paused(), |t| if t > 16.0 { line(t) + 6.0 } else { line(t) }), line));
    }

    #[test]
    fn a_strong_effect_does_not_count_as_explaining_another() {
        // Of a residual of 1000 a creep leaves 50, and a zero wander in addition leaves 10: the creep explains nothing
        // of the wander's part.
        assert!(!explains_nearly_all(50.0, 50.0, 10.0));
        // From a residual of 1000, three effects explain what the wander explained.
        assert!(explains_nearly_all(1000.0, 12.0, 10.0));
    }

    #[test]
    fn a_zero_of_few_heights_follows_any_drift() {
        assert!(follows(&[], |_| 0.0));
        assert!(follows(&[(0.0, 1.0), (2.0, 9.0)], |_| 0.0));
    }

    #[test]
    fn one_of_two_modes_may_be_known_before() {
        let mode = |hz| ResonanceParams { hz, damping: 0.02, gain: 1.0 };
        let lag = Some(LagParams { seconds: 0.01 });
        let h = Hypothesis::of(Effects { lag, resonances: vec![mode(40.0), mode(90.0)], ..Effects::default() });
        let (lag, resonance) = (Cause::Effect(Effect::Lag), Cause::Effect(Effect::Resonance));
        assert_eq!(new_causes(&h, &[]), [lag, resonance]);
        assert_eq!(new_causes(&h, &[resonance]), [lag, resonance]);
        assert_eq!(new_causes(&h, &[resonance, lag]), [resonance]);
        assert_eq!(new_causes(&h, &[resonance, resonance]), [lag]);
        assert_eq!(new_causes(&h.without(resonance), &[resonance]), [lag]);
    }
}
