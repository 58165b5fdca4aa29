//! Which effects: forward with a beam, then elimination, then swaps.

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

/// Effects that make the drive arrive late, and the share of what one of them explains (variance) that another beside it has to explain.
const TAKES_TIME: [Effect; 3] = [Effect::Delay, Effect::Lag, Effect::RateDependence];
/// Effects that one record is searched for at most.
const MOST: usize = 5;

/// One named effect with how it was found.
pub(crate) struct Named {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE without it, everything else refitted.
    pub(crate) cv_without: f64,
    /// Cross-validated RMSE with it.
    pub(crate) cv_with: f64,
    /// The best that each other candidate does in its place, best first.
    pub(crate) instead: Vec<Instead>,
    pub(crate) judgement: Judgement,
}

impl Named {
    /// What is known of it where this error is left in the end, in noise floors.
    pub(crate) fn evidence(&self, left: f64) -> Evidence {
        let others = self.instead.iter().filter(|i| i.judgement.sensible).map(|i| i.cv_rmse);
        let next_best = others.fold(self.cv_without, f64::min) / self.cv_with.max(f64::MIN_POSITIVE);
        Evidence { judgement: self.judgement, next_best, left }
    }
}

/// Another effect in the place of a named one.
#[derive(Clone)]
pub(crate) struct Instead {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE with it.
    pub(crate) cv_rmse: f64,
    /// Whether the record cannot tell the two apart.
    pub(crate) tie: bool,
    /// The whole set, with its parameters.
    pub(crate) hypothesis: Hypothesis,
    pub(crate) judgement: Judgement,
}

/// An effect that helps a set, but by too little to be named.
#[derive(Clone)]
pub(crate) struct Near {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE with it \[output unit\].
    pub(crate) cv_rmse: f64,
    pub(crate) judgement: Judgement,
}

/// What a search found.
pub(crate) struct Search {
    pub(crate) best: Trial,
    pub(crate) named: Vec<Named>,
    /// Standard deviation of the white noise \[output unit\].
    pub(crate) noise: f64,
    /// What helps the best set in every part of the record, but by too little to be named.
    pub(crate) near: Vec<Near>,
    /// Where the zero wanders beyond the drift of the best set: the cross-validated error that is left once it may \[output unit\].
    pub(crate) beside_wandering: Option<f64>,
}

pub(super) const DRIFT: Cause = Cause::Effect(Effect::Drift);

/// Context that every judgement needs.
pub(super) struct Judge<'a> {
    pub(super) problem: &'a Problem<'a>,
    noise: f64,
    pub(super) seed: u64,
    /// What came of adding a cause to a set. It is looked up before a race and written in it, so that threads change nothing.
    pub(super) known: Mutex<Vec<(Hypothesis, Cause, Option<Hypothesis>)>>,
}

impl Judge<'_> {
    /// Scans a fit for what may be added to it.
    pub(super) fn scan<'b>(&'b self, from: &'b Fitted) -> Result<Scan<'b>, Error> {
        Scan::new(self.problem, from, score::least_gain_from(from.rows as f64, from.squares, self.noise))
    }

    pub(super) fn refit(&self, effects: &Hypothesis) -> Result<Option<Trial>, Error> {
        Ok(self.problem.fit(effects)?.and_then(|f| Trial::of(self.problem, f)))
    }

    /// Whether even a perfect model would add less than an effect has to.
    fn nothing_to_gain(&self, best: &Trial) -> bool {
        let above = best.total() / best.fit.rows.max(1) as f64 - self.noise * self.noise;
        above < (MIN_NOISE_FLOORS * self.noise).powi(2)
    }

    /// A set without one cause. A small drag beside a creep may be no more than a creep that goes on faster than the elements of the search.
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

/// Searches from a fit that may hold more than what was there `already`.
pub(crate) fn search(
    problem: &Problem<'_>,
    base: Fitted,
    already: &[Cause],
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Search, Error> {
    further(problem, base, already, f64::INFINITY, seed, progress)
}

/// The same where the noise is `known` to be no more \[output unit\].
pub(super) fn further(
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
        return Ok(Search { best: nothing, named: Vec::new(), noise, near: Vec::new(), beside_wandering: None });
    };

    let mut beam = vec![start.clone()];
    let mut best = start;
    // The best set of what has a name.
    let mut named = best.clone();
    let nameless = |t: &Trial| t.fit.hypothesis.causes().iter().any(|cause| cause.is_nameless());
    // What came near to be added, and to which set.
    let mut near = (best.fit.hypothesis.causes(), Vec::new());
    for round in 1..=MOST {
        if judge.nothing_to_gain(if nameless(&best) { &named } else { &best }) {
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
            // A set that is worse than a smaller one found before leads nowhere; what has no name is no measure for what has.
            let least = if nameless(&trial) { best.total() } else { named.total() };
            if trial.total() >= least || !judgement.accepted() {
                let counts = judgement.is_sure() && from.fit.hypothesis.causes() == parent;
                let effect = cause.effect().filter(|_| counts);
                near.1.extend(effect.map(|effect| Near { effect, cv_rmse: trial.cv_rmse(), judgement }));
                continue;
            }
            // Two ways to the same set of effects: keep the better.
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
        if let Some(better) = next.iter().find(|t| !nameless(t) && t.total() < named.total()) {
            named = better.clone();
        }
        // What has no name takes nearly anything with its many numbers, and may not put an end to the search among names.
        let far = LARGE_RATIO * best.total();
        let second = next.iter().skip(1).find(|t| nameless(&next[0]) && !nameless(t));
        let second = second.or_else(|| next.iter().skip(1).find(|t| t.total() <= far)).cloned();
        // Whatever a smaller model leaves over may sound like noise; the floor only ever falls.
        judge.noise = judge.noise.min(noise_floor(&problem.residual(&best.fit)?, &problem.samples.segments)).max(steps);
        beam = std::iter::once(next[0].clone()).chain(second).collect();
    }

    // What has no name has to be worth its many numbers, against several effects as against one. Where effects that were found without it take
    // nearly all that it takes beside its own, it took what they miss of each other.
    if nameless(&best) {
        let names_alone = best.fit.hypothesis.causes().into_iter().filter(|c| c.is_nameless());
        let bare = judge.refit(&names_alone.fold(best.fit.hypothesis.clone(), |h, c| h.without(c)))?;
        let takes_nearly_all = |bare: Trial| nearly_all(bare.total(), named.total(), best.total());
        if !score::is_worth(&named, &best) || bare.is_some_and(takes_nearly_all) {
            best = named;
        }
    }
    // Elimination and swaps until neither changes anything. A set that was left is never entered again,
    // so this ends.
    let mut left: Vec<Vec<Cause>> = Vec::new();
    let named = loop {
        progress("checking whether each effect is needed");
        let needed = eliminate(&judge, &best, already)?;
        let change = match needed {
            Some(less) => Some(less),
            None => {
                progress("trying other effects in place of those found");
                let (better, list) = swaps(&judge, &best, already, &left)?;
                match better.map_or_else(|| judge.drifts_instead(&best), |better| Ok(Some(better)))? {
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
    if let Some(even) = nearly_even_drift(&judge, &best, already)? {
        let (_, named) = swaps(&judge, &even, already, &left)?;
        return Ok(Search { beside_wandering: Some(best.cv_rmse()), best: even, named, noise, near });
    }
    Ok(Search { best, named, noise, near, beside_wandering: None })
}

/// A drift in the place of a zero that wanders, where it takes nearly all of it: one that is not even to the last digit has the name too. Only
/// where nothing else was found, and where the zero goes smoothly: what goes in steps is a mount that slips.
fn nearly_even_drift(judge: &Judge<'_>, best: &Trial, already: &[Cause]) -> Result<Option<Trial>, Error> {
    let h = &best.fit.hypothesis;
    let wanders_alone = beyond(h, already) == [Cause::ZeroWanders] && h.effects.drift.is_none();
    if !wanders_alone || !goes_smoothly(&judge.problem.wandered_zero(&best.fit)) {
        return Ok(None);
    }
    let Some(still) = judge.refit(&h.without(Cause::ZeroWanders))? else { return Ok(None) };
    let Some(even) = judge.trials(&judge.scan(&still.fit)?, DRIFT)? else { return Ok(None) };
    let drift = even.fit.hypothesis.effects.drift;
    if drift.is_some_and(|p| p.seconds > 0.0 && p.per_second != 0.0) {
        return Ok(None);
    }
    let takes_nearly_all = nearly_all(still.total(), even.total(), best.total());
    Ok((takes_nearly_all && judge.judge(&still, &even).accepted()).then_some(even))
}

/// Whether one set takes nearly all that another takes of what is left without either (Σ residual²).
fn nearly_all(without: f64, one: f64, other: f64) -> bool {
    without - one >= DOMINANT_SHARE * (without - other)
}

/// Whether a zero that wanders through these times and heights makes no large part of its way at once; over a gap between segments it may make
/// more.
fn goes_smoothly(zero: &[(f64, f64)]) -> bool {
    let [first, _, .., last] = zero else { return true };
    let way: f64 = zero.windows(2).map(|z| (z[1].1 - z[0].1).abs()).sum();
    let usual = 2.0 * (last.0 - first.0) / (zero.len() - 1) as f64;
    zero.windows(3).all(|z| {
        let longer = ((z[2].0 - z[0].0) / usual).max(1.0);
        (z[2].1 - z[0].1).abs() <= MAX_ZERO_STEP * longer * way
    })
}

/// A set in which each cause beyond what was there `already` follows the law that this base calls for, all else refitted. On another base one law may
/// have been told from another by what that base took of them.
pub(super) fn with_own_laws(
    problem: &Problem<'_>,
    set: Trial,
    already: &[Cause],
    noise: f64,
    seed: u64,
) -> Result<Trial, Error> {
    let judge = Judge { problem, noise, seed, known: Mutex::default() };
    let mut best = set;
    for cause in beyond(&best.fit.hypothesis, already) {
        let Some(less) = problem.fit(&best.fit.hypothesis.without(cause))? else { continue };
        let with = judge.trials(&judge.scan(&less)?, cause)?;
        if let Some(with) = with.filter(|with| score::is_worth(&best, with) && score::sensible(problem, with)) {
            best = with;
        }
    }
    Ok(best)
}

/// What may be added to a fit. A curve behind the hysteresis is not among it: this base has one of its own, and whether the user's
/// needs one is asked at the end.
fn candidates(problem: &Problem<'_>, fit: &Fitted) -> Vec<Cause> {
    let effects = Effect::ALL.into_iter().filter(|e| *e != Effect::Asymmetry).map(Cause::Effect);
    effects
        .chain([Cause::ZeroWanders, Cause::GainWanders, Cause::GoesOn, Cause::SlewLimit])
        .filter(|c| fit.hypothesis.has_room(*c) && hidden(*c, problem).is_none())
        .collect()
}

/// What a set holds beyond what was there already, each once.
pub(super) fn beyond(h: &Hypothesis, already: &[Cause]) -> Vec<Cause> {
    let mut names = h.causes();
    for known in already {
        if let Some(at) = names.iter().position(|n| n == known) {
            names.remove(at);
        }
    }
    names.dedup();
    names
}

/// Drops the effect that is needed least, if there is one that is not needed, whose law the record does not determine, or that takes no more than
/// the misfit of the law of another of its kind.
fn eliminate(judge: &Judge<'_>, best: &Trial, already: &[Cause]) -> Result<Option<Trial>, Error> {
    let names = beyond(&best.fit.hypothesis, already);
    let loose = Undetermined::of(&best.fit);
    let reduced: Vec<Result<Option<Trial>, Error>> =
        names.par_iter().map(|e| judge.without(best, *e, already)).collect();
    let reduced: Vec<Option<Trial>> = reduced.into_iter().collect::<Result<_, _>>()?;
    let explained = |trial: &Option<Trial>| trial.as_ref().map_or(f64::INFINITY, |t| t.total() - best.total());
    let takes_time = |cause: &Cause| cause.effect().is_some_and(|e| TAKES_TIME.contains(&e));
    // No law is the device's to the last digit: a second law of the same kind takes what the first one misses, or what the base misses once that acts.
    let missed_by_laws = LAW_ACCURACY * rms(&judge.problem.samples.hysteresis().1);
    let size = |trial: &Option<Trial>| {
        trial.as_ref().map_or(f64::INFINITY, |t| (t.cv_rmse().powi(2) - best.cv_rmse().powi(2)).max(0.0).sqrt())
    };
    let of_its_kind: Vec<bool> = names
        .iter()
        .zip(&reduced)
        .map(|(cause, own)| {
            let mut others = names.iter().zip(&reduced).filter(|(other, _)| takes_time(other) && *other != cause);
            let is_small =
                |t: &Option<Trial>| explained(own) < NEGLIGIBLE_SHARE * explained(t) || size(own) < missed_by_laws;
            takes_time(cause) && others.any(|(_, t)| is_small(t))
        })
        .collect();
    let mut least: Option<Trial> = None;
    for ((cause, trial), is_misfit) in names.iter().zip(reduced).zip(of_its_kind) {
        // Without one effect another may be driven to nonsense: then the first one is needed.
        let Some(trial) = trial.filter(|t| score::sensible(judge.problem, t)) else { continue };
        let is_loose = loose.speaks_against(*cause, || score::is_far_better(&trial, best));
        if (is_loose || is_misfit || !judge.judge(&trial, best).accepted())
            && least.as_ref().is_none_or(|l| trial.total() < l.total())
        {
            least = Some(trial);
        }
    }
    Ok(least)
}

/// Tries every other effect in the place of each: a better set that was not left before, if there is
/// one, and how each effect stands against the others.
fn swaps(
    judge: &Judge<'_>,
    best: &Trial,
    already: &[Cause],
    left: &[Vec<Cause>],
) -> Result<(Option<Trial>, Vec<Named>), Error> {
    let mut named = Vec::new();
    let mut better: Option<Trial> = None;
    for cause in beyond(&best.fit.hypothesis, already) {
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
        let mut instead = Vec::new();
        for (other, trial) in others.iter().zip(judge.race(&jobs)?) {
            let Some(trial) = trial else { continue };
            let judgement = judge.judge(&without, &trial);
            // A tone that merely stands alone takes nobody's place.
            let accepted = judgement.explains_enough();
            // In one loop all that is late is alike.
            let alike = one_loop && is_late(*other) && trial.cv_rmse() < (1.0 + MIN_RMSE_DROP) * best.cv_rmse();
            let tie = judgement.sensible && (alike || tie(judge, best, &trial));
            let (cv_rmse, hypothesis) = (trial.cv_rmse(), trial.fit.hypothesis.clone());
            instead.extend(other.effect().map(|effect| Instead { effect, cv_rmse, tie, hypothesis, judgement }));
            // What has no name has to be worth its many numbers: not where an effect leaves it next to nothing to take.
            let nameless = || cause.is_nameless() && !judge.judge(&trial, best).accepted();
            let numbers = |trial: &Trial, cause: Cause| trial.fit.hypothesis.complexity(cause);
            let is_smaller = numbers(&trial, *other) < numbers(best, cause);
            // More numbers have to be worth as much as an effect: a law of several takes more of the base's misfit than one of one.
            let is_larger = numbers(&trial, *other) > numbers(best, cause);
            let simpler = accepted && is_smaller && (tie || nameless() || !score::is_worth(&trial, best));
            let clearly =
                accepted && !tie && trial.total() < best.total() && (!is_larger || score::is_worth(best, &trial));
            let fresh = !left.contains(&trial.fit.hypothesis.causes());
            if fresh && (simpler || clearly) && better.as_ref().is_none_or(|b| trial.total() < b.total()) {
                better = Some(trial);
            }
        }
        instead.sort_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
        if let Some(effect) = cause.effect() {
            named.push(Named {
                effect,
                cv_without: without.cv_rmse(),
                cv_with: best.cv_rmse(),
                judgement: judge.judge(&without, best),
                instead,
            });
        }
    }
    Ok((better, named))
}

/// Whether a cause makes the output turn after the drive does.
fn is_late(cause: Cause) -> bool {
    let late = [Effect::Delay, Effect::Lag, Effect::RateDependence, Effect::Resonance];
    cause.effect().is_some_and(|e| late.contains(&e))
}

/// Whether the record cannot tell two sets apart: what separates them is small against the noise, or neither is better in nearly
/// every bootstrap draw.
fn tie(judge: &Judge<'_>, a: &Trial, b: &Trial) -> bool {
    let per_row = (a.total() - b.total()).abs() / a.fit.rows.max(1) as f64;
    let drowned =
        per_row < (MIN_NOISE_FLOORS * judge.noise).powi(2) && (a.total() / b.total()).ln().abs() < MIN_RMSE_DROP;
    drowned || score::undecided(a, b, judge.seed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Effects;
    use hyst_core::{LagParams, ResonanceParams};

    /// A zero at these times, of these heights.
    fn zero(times: impl Iterator<Item = f64>, height: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        times.map(|t| (t, height(t))).collect()
    }

    #[test]
    fn a_zero_that_settles_goes_smoothly_and_one_that_slips_does_not() {
        let evenly = || (0..17).map(|k| 2.0 * f64::from(k));
        assert!(goes_smoothly(&zero(evenly(), |t| 0.1 * t)));
        assert!(goes_smoothly(&zero(evenly(), |t| 1.0 - (-t / 20.0).exp())));
        let slips = |t: f64| [9.0, 17.0, 25.0].into_iter().filter(|at| t > *at).count() as f64;
        assert!(!goes_smoothly(&zero(evenly(), slips)));
    }

    #[test]
    fn over_a_pause_a_zero_may_go_further() {
        let paused = || (0..17).map(|k| 2.0 * f64::from(k) + if k > 8 { 60.0 } else { 0.0 });
        assert!(goes_smoothly(&zero(paused(), |t| 0.1 * t)));
        assert!(!goes_smoothly(&zero((0..17).map(|k| 2.0 * f64::from(k)), |t| if t > 16.0 {
            0.1 * t + 6.0
        } else {
            0.1 * t
        })));
    }

    #[test]
    fn a_strong_effect_does_not_answer_for_what_another_takes() {
        // Of 1000 a creep leaves 50, and a wandering zero beside it 10: the creep takes nothing of what the zero takes.
        assert!(!nearly_all(50.0, 50.0, 10.0));
        // Beside a base that holds nothing else, three names take what the wandering took.
        assert!(nearly_all(1000.0, 12.0, 10.0));
    }

    #[test]
    fn what_has_hardly_a_height_goes_smoothly() {
        assert!(goes_smoothly(&[]));
        assert!(goes_smoothly(&[(0.0, 1.0)]));
        assert!(goes_smoothly(&[(0.0, 1.0), (2.0, 9.0)]));
    }

    #[test]
    fn of_two_modes_one_may_have_been_there() {
        let mode = |hz| ResonanceParams { hz, damping: 0.02, gain: 1.0 };
        let lag = Some(LagParams { seconds: 0.01 });
        let h = Hypothesis::of(Effects { lag, resonances: vec![mode(40.0), mode(90.0)], ..Effects::default() });
        let (lag, resonance) = (Cause::Effect(Effect::Lag), Cause::Effect(Effect::Resonance));
        assert_eq!(beyond(&h, &[]), [lag, resonance]);
        assert_eq!(beyond(&h, &[resonance]), [lag, resonance]);
        assert_eq!(beyond(&h, &[resonance, lag]), [resonance]);
        assert_eq!(beyond(&h, &[resonance, resonance]), [lag]);
        assert_eq!(beyond(&h.without(resonance), &[resonance]), [lag]);
    }
}
