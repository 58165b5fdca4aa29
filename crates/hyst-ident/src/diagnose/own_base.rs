//! What the model's own base shows where the rich one leaves much.
//!
//! Where the drive has turned seldom, a rich base takes up a part of each of several effects. It predicts badly, and no effect shows by itself. The own
//! base is searched too if it has fewer unknowns and, with all that was found, predicts as well as the rich one, whose additional unknowns are worth
//! nothing then; or if it has more unknowns and predicts better, since the rich one lacks something of its hysteresis then. The result replaces the first
//! one if it predicts far better.

use hyst_core::Error;

use super::score;
use super::search::{Search, further};
use super::shape::{CLOSED_ANEW, is_near};
use super::trial::Trial;
use crate::criteria::MIN_RMSE_DROP;
use crate::nested::{Cause, Hypothesis, Problem};

/// What a search from a start, beyond what was there `already`, finds on the `own` base, if it predicts far better than what was `found` on a rich one
/// of `unknowns`.
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
    let enough = if has_more { rich / (1.0 + MIN_RMSE_DROP) } else { CLOSED_ANEW * rich };
    // Many unknowns are solved for once before the parameters of the effects are.
    if has_more && own.fit_linear(hypothesis)?.and_then(|f| Trial::of(own, f)).is_none_or(|own| own.cv_rmse() > enough)
    {
        return Ok(None);
    }
    let as_found = own.fit(hypothesis)?.and_then(|f| Trial::of(own, f));
    let Some(as_found) = as_found.filter(|own| own.cv_rmse() <= enough) else { return Ok(None) };
    progress("searching on the model's own base");
    let Some(from) = own.fit(start)? else { return Ok(None) };
    let seen = further(own, from, &already, found.noise, seed, progress)?;
    let differs = seen.best.fit.hypothesis.causes() != hypothesis.causes();
    // By what was found there, not by the base alone.
    let predicts = [&found.best, &as_found].into_iter().all(|other| score::is_far_better(other, &seen.best));
    Ok(Some(seen).filter(|seen| differs && predicts && !seen.named.is_empty()))
}
