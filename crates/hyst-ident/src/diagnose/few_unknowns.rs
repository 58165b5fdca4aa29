//! Searches the model's own base if the screening basis predicts badly.
//!
//! If the drive has few turning points, a screening basis takes up a part of each of several effects. It predicts badly
//! and no effect shows alone. If the model's own base, with all effects found, predicts as well as the screening basis,
//! the additional unknowns are useless. The own base is then searched too. Its result replaces the first one if it
//! predicts far better.

use hyst_core::Error;

use super::score;
use super::search::{Search, search_with_noise};
use super::shape::{MAX_RATIO_RESELECTED, is_near};
use super::trial::Trial;
use crate::nested::{Cause, Hypothesis, Problem};

/// Searches the basis with `few` unknowns from a start, for causes beyond `already`. Returns the result if it predicts
/// far better than `found`, the result on the screening basis.
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
    let Some(as_found) = as_found.filter(|own| own.cv_rmse() <= MAX_RATIO_RESELECTED * rich) else { return Ok(None) };
    progress("searching on the model's own base, which has fewer unknowns");
    let Some(from) = few.fit(start)? else { return Ok(None) };
    let seen = search_with_noise(few, from, &already, found.noise, seed, progress)?;
    let differs = seen.best.fit.hypothesis.causes() != hypothesis.causes();
    // The gain must come from the effects, not from the basis alone.
    let predicts = [&found.best, &as_found].into_iter().all(|other| score::is_far_better(other, &seen.best));
    Ok(Some(seen).filter(|seen| differs && predicts && !seen.named.is_empty()))
}
