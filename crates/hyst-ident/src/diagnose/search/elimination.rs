//! Elimination: drops an effect that is not needed.

use hyst_core::Error;
use rayon::prelude::*;

use super::judge::Judge;
use crate::criteria::{LAW_ACCURACY, NEGLIGIBLE_SHARE};
use crate::diagnose::causes::new_causes;
use crate::diagnose::score;
use crate::diagnose::trial::Trial;
use crate::diagnose::uncertainty::Undetermined;
use crate::metrics::rms;
use crate::model::Effect;
use crate::nested::Cause;

/// Effects of one kind: those that delay the output or widen the loop with rate, and those that bend it. A second one
/// of a kind must explain more than a small share of what the first explains.
const KINDS: [&[Effect]; 2] =
    [&[Effect::Delay, Effect::Lag, Effect::RateDependence], &[Effect::Asymmetry, Effect::Saturation]];

/// Drops the least needed effect, if there is one that is not needed, whose law the record does not determine, or that
/// explains no more than the misfit of a similar effect's law.
pub(super) fn eliminate(judge: &Judge<'_>, best: &Trial, already: &[Cause]) -> Result<Option<Trial>, Error> {
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
