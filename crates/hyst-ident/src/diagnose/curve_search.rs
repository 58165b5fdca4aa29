//! Searches the model's own base for a missing curve, on its thresholds and on thresholds chosen for the curve.

use hyst_core::CurveSide;

use super::own_model::{OwnModel, SHAPE_ROWS};
use super::search::{Named, Search, search_with_noise};
use super::shape::{self, CurveFits};
use crate::base::ScreeningBasis;
use crate::fit::{BasisOf, FitError};
use crate::lsq::{BLOCKS, Blocks};
use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Problem};

/// Result of the search for a curve on the model's base.
#[derive(Default)]
pub(super) struct CurveSearch {
    /// The missing curve or saturation, and the fit with it and all known effects.
    pub(super) curve: Option<(Named, Fitted)>,
    /// The base, if its thresholds were chosen again.
    pub(super) basis: Option<BasisOf>,
    /// The search that was repeated with the curve; it replaces the previous one.
    pub(super) searched: Option<Search>,
}

impl OwnModel<'_> {
    /// Searches the model's own base for a missing curve, which the screening basis cannot show. `known` is what the
    /// model already contains, `hypothesis` adds the effects found.
    pub(super) fn shape(
        &self,
        known: &Hypothesis,
        hypothesis: &Hypothesis,
        richest: f64,
        noise: f64,
        seed: u64,
        progress: &(dyn Fn(&str) + Sync),
    ) -> Result<CurveSearch, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        let stage = |e| self.stage(e);
        let plain = shape::plain(&problem, hypothesis).map_err(stage)?;
        let Some(plain) = plain.filter(|plain| !shape::is_complete(plain, richest)) else {
            return Ok(CurveSearch::default());
        };
        let (mut bent, mut bases): (Vec<CurveFits>, Vec<Option<BasisOf>>) = (Vec::new(), Vec::new());
        let complete = |curved: &shape::CurveFit| shape::is_complete(&curved.trial, richest);
        for side in [CurveSide::Output, CurveSide::Input] {
            // A curve behind the operator is linear in its weights. One before the operator has to be searched. It is
            // tried unless the first one leaves only noise: the right curve may predict better than the rich base.
            if bent.iter().flat_map(CurveFits::curves).any(|curved| shape::is_complete(&curved.trial, noise)) {
                break;
            }
            let own = shape::bent(&problem, hypothesis, &plain.fit, side).map_err(stage)?;
            let anew = own.as_ref().map(|bent| self.reselected(&problem, &bent.trial.fit)).transpose()?.flatten();
            // The model's thresholds were chosen without the curve. Even thresholds over the curved drive may fit
            // better.
            let anew = match (anew, &own) {
                (None, Some(bent)) if !complete(bent) => self.even(&problem, &bent.trial.fit)?,
                (anew, _) => anew,
            };
            let mut here = CurveFits { own, anew: None };
            if let Some(basis) = &anew {
                let behind = self.on(basis, &blocks).with_blocks_of(&problem).with_linear_effects_fixed();
                match shape::plain(&behind, hypothesis).map_err(stage)? {
                    // Only the thresholds were wrong; no curve is missing.
                    Some(plain) if shape::is_complete(&plain, richest) => {
                        return Ok(CurveSearch { basis: anew, ..CurveSearch::default() });
                    }
                    Some(plain) => {
                        let with = shape::bent(&behind, hypothesis, &plain.fit, side).map_err(stage)?;
                        here.anew = with.map(|with| (plain, with));
                    }
                    None => {}
                }
            }
            bent.push(here);
            bases.push(anew);
        }
        // The effects found without the curve may have taken up a part of it. All effects are searched again with the
        // curve.
        let all = bent.iter().enumerate().flat_map(|(at, bent)| bent.curves().map(move |curved| (at, curved)));
        let best = all.min_by(|(_, a), (_, b)| a.trial.total().total_cmp(&b.trial.total()));
        let mut searched = None;
        if let Some((at, curved)) = best.filter(|(_, curved)| !complete(curved) && curved.takes(&plain, noise)) {
            let is_anew = bent[at].own.as_ref().is_none_or(|own| !std::ptr::eq(own, curved));
            let basis = bases[at].as_ref().filter(|_| is_anew).unwrap_or(self.basis);
            let free = self.on(basis, &blocks).with_blocks_of(&problem);
            let already: Vec<Cause> = known.causes().into_iter().chain([Cause::Effect(Effect::Asymmetry)]).collect();
            if let Some(from) = free.fit(&curved.trial.fit.hypothesis).map_err(stage)? {
                progress("searching again with the curve added to the base model");
                let search = search_with_noise(&free, from, &already, noise, seed, progress).map_err(stage)?;
                let with = shape::CurveFit { trial: search.best.clone(), is_asymmetric: curved.is_asymmetric };
                let plain = bent[at].anew.as_ref().filter(|_| is_anew).map(|(plain, _)| plain.clone());
                bent.push(match plain {
                    Some(plain) => CurveFits { own: None, anew: Some((plain, with)) },
                    None => CurveFits { own: Some(with), anew: None },
                });
                bases.push(if is_anew { bases[at].clone() } else { None });
                searched = Some(search);
            }
        }
        let found = shape::shape(&problem, hypothesis, &plain, bent, richest, noise, seed).map_err(stage)?;
        let Some(shape) = found else { return Ok(CurveSearch::default()) };
        if shape.named.effect == Effect::Asymmetry && self.is_symmetric(hypothesis, richest)? {
            return Ok(CurveSearch::default());
        }
        let basis = shape.anew.and_then(|at| bases.swap_remove(at));
        let searched = searched.filter(|search| search.best.fit.hypothesis == shape.hypothesis);
        Ok(CurveSearch { curve: Some((shape.named, shape.fit)), basis, searched })
    }

    /// Returns whether symmetric hysteresis of some law with these effects explains the record as well as the screening
    /// basis. A curve on the model's own base would then take up that base's misfit.
    fn is_symmetric(&self, hypothesis: &Hypothesis, richest: f64) -> Result<bool, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let odd = ScreeningBasis::odd(self.samples, hypothesis.drag.is_some());
        let problem = Problem::new(self.samples, &odd, &blocks, self.per_record).with_linear_effects_fixed();
        let plain = shape::plain(&problem, hypothesis).map_err(|e| self.stage(e))?;
        Ok(plain.is_some_and(|plain| shape::is_complete(&plain, richest)))
    }
}
