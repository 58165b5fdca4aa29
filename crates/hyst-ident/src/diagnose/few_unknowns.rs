//! What a base with fewer unknowns shows where the rich one leaves much.
//!
//! Where the drive has turned seldom, a rich base takes up a part of each of several effects. It predicts badly, and no effect shows by itself. If the
//! model's own base, with all that was found, predicts as well as the rich one, the additional unknowns are worth nothing. Then the own base is searched
//! too. Its result replaces the first one if it predicts far better.

use hyst_core::Error;

use super::score;
use super::search::{Search, further};
use super::shape::{CLOSED_ANEW, is_near};
use super::trial::Trial;
use crate::nested::{Cause, Hypothesis, Problem};

/// What a search from a start, beyond what was there `already`, finds on a base with `few` unknowns, if it predicts far better than what was `found` on
/// a rich one.
pub(super) fn search(
    few: &Problem<'_>,
    found: &Search,
    (start, already): (&Hypothesis, Vec<Cause>),
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Option<Search>, Error> {
    let (rich, hypothesis) = (found.best.cv_rmse(), &found.best.fit.hypothesis);
    if is_near(rich, found.noise) {
        return Ok(None);
    }
    let as_found = few.fit(hypothesis)?.and_then(|f| Trial::of(few, f));
    let Some(as_found) = as_found.filter(|own| own.cv_rmse() <= CLOSED_ANEW * rich) else { return Ok(None) };
    progress("searching on the model's own base, which has fewer unknowns");
    let Some(from) = few.fit(start)? else { return Ok(None) };
    let seen = further(few, from, &already, found.noise, seed, progress)?;
    let differs = seen.best.fit.hypothesis.causes() != hypothesis.causes();
    // By what was found there, not by the base alone.
    let predicts = [&found.best, &as_found].into_iter().all(|other| score::is_far_better(other, &seen.best));
    Ok(Some(seen).filter(|seen| differs && predicts && !seen.named.is_empty()))
}
