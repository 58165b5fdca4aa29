//! What a base with fewer unknowns shows where the rich one leaves much.
//!
//! Where the drive has turned seldom, a rich base takes up a part of each of several effects, predicts badly, and none of them shows by itself. Where the
//! model's own base predicts as well as the rich one with all that was found on that, the rich one's unknowns are worth nothing: the own one is searched
//! too, and what it finds is what was found if it predicts far better.

use hyst_core::Error;

use super::score;
use super::search::{Search, further};
use super::shape::{CLOSED_ANEW, is_near, plain};
use crate::nested::{Cause, Hypothesis, Problem};

/// What a search from `start` finds on a base with `few` unknowns, if it predicts far better than what was `found` on a rich one.
pub(super) fn search(
    few: &Problem<'_>,
    found: &Search,
    start: &Hypothesis,
    already: &[Cause],
    seed: u64,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Option<Search>, Error> {
    let left = found.best.cv_rmse();
    let Some(as_found) = plain(few, &found.best.fit.hypothesis)? else { return Ok(None) };
    if is_near(left, found.noise) || as_found.cv_rmse() > CLOSED_ANEW * left {
        return Ok(None);
    }
    progress("searching on the model's own base, which has fewer unknowns");
    let Some(from) = few.fit(start)? else { return Ok(None) };
    let seen = further(few, from, already, found.noise, seed, progress)?;
    // By what was found there, not by the base alone.
    let predicts = [&found.best, &as_found].into_iter().all(|other| score::is_far_better(other, &seen.best));
    Ok(Some(seen).filter(|seen| predicts && !seen.named.is_empty()))
}
