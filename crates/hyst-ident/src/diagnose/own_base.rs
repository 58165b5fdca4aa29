//! Searches the model's own base if the screening basis predicts badly.
//!
//! If the drive has few turning points, a screening basis takes up a part of each of several effects. It predicts badly
//! and no effect shows alone. With all effects found, the own base is compared with it. If it has fewer unknowns and
//! predicts as well, the additional unknowns are useless. If it has more and predicts better, the screening basis lacks
//! a part of the hysteresis. In both cases the own base is searched too. Its result replaces the first one if it
//! predicts far better.
//!
//! The own base is also searched if the search needed no effect: with much memory a basis can imitate an effect.

use hyst_core::Error;

use super::own_model::{OwnModel, SHAPE_ROWS};
use super::score;
use super::search::{Search, may_be_far_better, search_with_noise};
use super::shape::{self, MAX_RATIO_RESELECTED, is_near};
use super::trial::Trial;
use crate::criteria::{DOMINANT_SHARE, MIN_RMSE_DROP};
use crate::fit::FitError;
use crate::lsq::{BLOCKS, Blocks};
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
    // Another set that predicts far better has an effect that explains much beside those found too.
    if !may_be_far_better(own, &as_found, found.noise, seed)? {
        return Ok(None);
    }
    progress("searching on the model's own base");
    let Some(from) = own.fit(start)? else { return Ok(None) };
    let seen = search_with_noise(own, from, &already, found.noise, seed, progress)?;
    let differs = seen.best.fit.hypothesis.causes() != hypothesis.causes();
    // The gain must come from the effects, not from the basis alone.
    let gains = [&found.best, &as_found].into_iter().all(|other| score::is_far_better(other, &seen.best));
    Ok(Some(seen).filter(|seen| differs && gains && !seen.named.is_empty()))
}

impl OwnModel<'_> {
    /// Searches the model's own base for effects after the screening basis needed none. Returns `None` unless the
    /// result explains the record as well as the screening basis.
    pub(super) fn closing(
        &self,
        found: &Hypothesis,
        start: &Hypothesis,
        richest: f64,
        noise: f64,
        seed: u64,
        progress: &(dyn Fn(&str) + Sync),
    ) -> Result<Option<Search>, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks);
        let stage = |e| self.stage(e);
        let Some(plain) = shape::plain(&problem, found).map_err(stage)? else { return Ok(None) };
        // A wander or a slow amplifier is no misfit of a base.
        let unlisted = found.causes().iter().any(|cause| cause.is_unlisted());
        if unlisted || shape::is_complete(&plain, richest) {
            return Ok(None);
        }
        let (before, floor) = (plain.total(), plain.fit.rows as f64 * noise * noise);
        let search = search_with_noise(&problem, plain.fit, &start.causes(), noise, seed, progress).map_err(stage)?;
        let closes = search.best.cv_rmse() <= MAX_RATIO_RESELECTED * richest
            && before - search.best.total() >= DOMINANT_SHARE * (before - floor);
        Ok(Some(search).filter(|s| closes && !s.named.is_empty()))
    }
}
