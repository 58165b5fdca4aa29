//! Checks a curve that stand-ins for the model's own base show.
//!
//! A base that is not linear in its parameters was fitted without the curve, and its parameters have taken up a part of
//! it. So play operators stand in for it: they do not bend, and their weights follow the curve exactly. A curve that
//! they show is fitted again on the model's own base, and named only if that base needs it too: some bases bend by
//! themselves.

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
    pub(super) fn of_stand_in(&self, found: CurveSearch) -> Result<CurveSearch, FitError> {
        let CurveSearch { curve: Some((curve, fit)), searched, .. } = found else { return Ok(CurveSearch::default()) };
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        let stage = |e| self.stage(e);
        let bare = fit.hypothesis.without(Cause::Effect(curve.effect));
        let Some(plain) = shape::plain(&problem, &bare).map_err(stage)? else { return Ok(CurveSearch::default()) };
        let with = match &fit.hypothesis.effects.asymmetry {
            Some(asymmetry) if curve.effect == Effect::Asymmetry => {
                let bent = shape::bent(&problem, &bare, &plain.fit, asymmetry.side).map_err(stage)?;
                bent.map(|bent| bent.trial)
            }
            _ => {
                let stopped = shape::own_stop(&problem, &fit.hypothesis).map_err(stage)?;
                stopped.and_then(|fit| Trial::of(&problem, fit))
            }
        };
        let curve = with.filter(|with| score::is_worth(&plain, with)).map(|with| (curve, with.fit));
        let searched = searched.filter(|_| curve.is_some());
        Ok(CurveSearch { curve, basis: None, searched })
    }
}
