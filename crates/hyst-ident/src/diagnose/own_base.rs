//! Searches the model's own base if the screening basis predicts badly.
//!
//! If the drive has few turning points, a screening basis takes up a part of each of several effects. It predicts badly
//! and no effect shows alone. With all effects found, the own base is compared with it. If it has fewer unknowns and
//! predicts as well, the additional unknowns are useless. If it has more and predicts better, the screening basis lacks a
//! part of the hysteresis. In both cases the own base is searched too. Its result replaces the first one if it predicts far
//! better.

use hyst_core::Error;

use super::score;
use super::search::{Search, search_with_noise};
use super::shape::{MAX_RATIO_RESELECTED, is_near};
use super::trial::Trial;
use crate::criteria::MIN_RMSE_DROP;
use crate::nested::{Cause, Hypothesis, Problem};

/// Searches the `own` base from a start, for causes beyond `already`. Returns the result if it predicts far better than
/// `found`, the result on the screening basis with this number of `unknowns`.
pub(super) fn search(
    own: &Problem<'_>,
    unknowns: usize,
    found: &Search,
    (start, already): (&Hypothesis, Vec<Cause>),
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Option<Search>, Error> {
    let (rich, hypothesis) = (found.best.cv_rmse(), &found.best.fit.hypothesis);
    if is_near(rich, found.noise) {
        return Ok(None);
    }
    let has_more = own.basis.len() >= unknowns;
    let largest = if has_more { rich / (1.0 + MIN_RMSE_DROP) } else { MAX_RATIO_RESELECTED * rich };
    let predicts = |trial: &Trial| trial.cv_rmse() <= largest;
    // With many unknowns, one linear fit first: the fit of the effects' parameters needs many.
    if has_more && !own.fit_linear(hypothesis)?.and_then(|f| Trial::of(own, f)).is_some_and(|trial| predicts(&trial)) {
        return Ok(None);
    }
    let as_found = own.fit(hypothesis)?.and_then(|f| Trial::of(own, f));
    let Some(as_found) = as_found.filter(predicts) else { return Ok(None) };
    progress("searching on the model's own base");
    let Some(from) = own.fit(start)? else { return Ok(None) };
    let seen = search_with_noise(own, from, &already, found.noise, seed, progress)?;
    let differs = seen.best.fit.hypothesis.causes() != hypothesis.causes();
    // The gain must come from the effects, not from the basis alone.
    let gains = [&found.best, &as_found].into_iter().all(|other| score::is_far_better(other, &seen.best));
    Ok(Some(seen).filter(|seen| differs && gains && !seen.named.is_empty()))
}
