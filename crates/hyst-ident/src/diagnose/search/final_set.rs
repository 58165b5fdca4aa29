//! The set that a search ends with: every effect is needed, none is better in another's place, and each name is more
//! probably right than wrong.

use hyst_core::Error;

use super::elimination::eliminate;
use super::judge::Judge;
use super::result::Named;
use super::swaps::swaps;
use crate::diagnose::probability::SUSPECTED;
use crate::diagnose::trial::Trial;
use crate::model::Effect;
use crate::nested::Cause;

/// Returns the final set and its names, starting from `best`. A set that was `left` is never entered again, so the loops
/// end. `instead` returns the set that replaces one with an unlisted cause, if one does.
pub(super) fn final_set(
    judge: &Judge<'_>,
    best: Trial,
    already: &[Cause],
    left: &mut Vec<Vec<Cause>>,
    instead: &dyn Fn(&Trial) -> Result<Option<Trial>, Error>,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<(Trial, Vec<Named>), Error> {
    let (mut best, mut list) = unchanged(judge, best, already, left, instead, progress)?;
    while let Some(doubtful) = least_probable(judge, &best, &list) {
        let Some(less) = judge.without(&best, Cause::Effect(doubtful), already)? else { break };
        left.push(best.fit.hypothesis.causes());
        (best, list) = unchanged(judge, less, already, left, instead, progress)?;
    }
    Ok((best, list))
}

/// Eliminates and swaps until neither changes anything; returns the set and its names.
fn unchanged(
    judge: &Judge<'_>,
    from: Trial,
    already: &[Cause],
    left: &mut Vec<Vec<Cause>>,
    instead: &dyn Fn(&Trial) -> Result<Option<Trial>, Error>,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<(Trial, Vec<Named>), Error> {
    let mut best = from;
    loop {
        progress("checking whether each effect is needed");
        let mut change = eliminate(judge, &best, already)?;
        if change.is_none() {
            progress("trying other effects in place of those found");
            let (better, list) = swaps(judge, &best, already, left)?;
            change = better.map_or_else(|| judge.drift_instead_of_expansion(&best), |better| Ok(Some(better)))?;
            // The elimination may have left an unlisted cause in the place of an effect.
            let is_left = |set: &Trial| left.contains(&set.fit.hypothesis.causes());
            change = change.map_or_else(|| instead(&best), |change| Ok(Some(change)))?.filter(|set| !is_left(set));
            if change.is_none() {
                return Ok((best, list));
            }
        }
        if let Some(other) = change {
            left.push(best.fit.hypothesis.causes());
            best = other;
        }
    }
}

/// Returns the least probable name, if it is more probably wrong than right.
fn least_probable(judge: &Judge<'_>, best: &Trial, list: &[Named]) -> Option<Effect> {
    let left = best.cv_rmse() / judge.noise.max(f64::MIN_POSITIVE);
    let probable = |named: &Named| named.evidence(left).probability();
    let least = list.iter().min_by(|a, b| probable(a).total_cmp(&probable(b)))?;
    (probable(least) < SUSPECTED).then_some(least.effect)
}
