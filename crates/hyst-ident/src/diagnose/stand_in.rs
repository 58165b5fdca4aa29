//! Confirms on the model's own base a curve that was found on play operators.
//!
//! A base that is not linear in its parameters was fitted without the curve, so its parameters have taken up a part of
//! it. Play operators replace it in the search for a curve: they are odd, so they cannot take up the curve, and their
//! weights are solved again with it. The curve is then fitted on the model's own base. It is named only if that base
//! predicts clearly better with it, because some bases bend by themselves. The judgement and the rivals of the name
//! are those of the play operators.

use super::curve_search::CurveSearch;
use super::own_model::{OwnModel, SHAPE_ROWS};
use super::trial::Trial;
use super::{score, shape};
use crate::fit::FitError;
use crate::lsq::{BLOCKS, Blocks};
use crate::model::Effect;
use crate::nested::Cause;

impl OwnModel<'_> {
    /// Returns the result of a search on play operators, with the curve fitted to the model's own base. Nothing is
    /// found if that base does not need the curve.
    pub(super) fn confirmed_curve(&self, found: CurveSearch) -> Result<CurveSearch, FitError> {
        let CurveSearch { curve: Some((curve, fit)), searched, .. } = found else { return Ok(CurveSearch::default()) };
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        let stage = |e| self.stage(e);
        let bare = fit.hypothesis.without(Cause::Effect(curve.effect));
        let Some(plain) = shape::plain(&problem, &bare).map_err(stage)? else { return Ok(CurveSearch::default()) };
        let with = match &fit.hypothesis.effects.asymmetry {
            Some(asymmetry) if curve.effect == Effect::Asymmetry => {
                let bent = shape::bent(&problem, &bare, &plain.fit, asymmetry.side).map_err(stage)?;
                bent.filter(|bent| bent.is_asymmetric).map(|bent| bent.trial)
            }
            _ => {
                let stopped = shape::own_limits(&problem, &fit.hypothesis).map_err(stage)?;
                stopped.and_then(|fit| Trial::of(&problem, fit))
            }
        };
        let Some(with) = with.filter(|with| score::is_worth(&plain, with)) else { return Ok(CurveSearch::default()) };
        // Standard errors need the derivatives.
        let fit = problem.with_slopes(&with.fit).map_err(stage)?.unwrap_or(with.fit);
        Ok(CurveSearch { curve: Some((curve, fit)), basis: None, searched })
    }
}
