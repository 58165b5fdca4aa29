//! Swaps: tries every other effect instead of each one found.

use hyst_core::Error;

use super::judge::Judge;
use super::result::{Named, Rival};
use crate::criteria::{MIN_NOISE_FLOORS, MIN_RMSE_DROP};
use crate::diagnose::causes::{candidates, new_causes};
use crate::diagnose::effects;
use crate::diagnose::scan::Scan;
use crate::diagnose::score;
use crate::diagnose::trial::Trial;
use crate::model::Effect;
use crate::nested::Cause;

/// Tries every other effect instead of each one. Returns a better set that was not left before, if there is one, and
/// the ranking of the others for each effect.
pub(super) fn swaps(
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
            // An unlisted cause explains nearly anything. It takes the place of no effect that explains nearly as much.
            let is_listed_enough = other.is_unlisted()
                && !cause.is_unlisted()
                && score::explains_nearly_all(without.total(), best.total(), trial.total());
            let clearly = accepted
                && !tie
                && !is_listed_enough
                && trial.total() < best.total()
                && (!is_larger || score::is_worth(best, &trial));
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
    cause.effect().is_some_and(|effect| effects::of(effect).is_late())
}

/// Returns whether the record cannot tell two sets apart: their difference is small against the noise, or neither is
/// better in nearly every bootstrap draw.
fn tie(judge: &Judge<'_>, a: &Trial, b: &Trial) -> bool {
    let per_row = (a.total() - b.total()).abs() / a.fit.rows.max(1) as f64;
    let below_noise =
        per_row < (MIN_NOISE_FLOORS * judge.noise).powi(2) && (a.total() / b.total()).ln().abs() < MIN_RMSE_DROP;
    below_noise || score::undecided(a, b, judge.seed)
}
