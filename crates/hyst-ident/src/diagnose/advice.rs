//! Advice on the base model: whether another kind explains the record better.

use hyst_core::Error;

use super::findings::BaseAdvice;
use super::trial::Trial;
use crate::base::Basis;
use crate::criteria::MIN_RMSE_DROP;
use crate::fit::{FitError, basis_for};
use crate::lsq::{BLOCKS, Blocks};
use crate::model::Kind;
use crate::nested::{Hypothesis, Problem};
use crate::samples::Samples;

/// Maximum number of rows of the comparison.
const ROWS: usize = 8_000;

/// Returns the kind of model with convex weights that predicts left-out parts of the record best, with all effects
/// found; `None` unless it is clearly better than the model's own base.
pub(super) fn base_advice(
    samples: &Samples,
    own: (Kind, &dyn Basis),
    found: &Hypothesis,
    per_record: bool,
    stage: &dyn Fn(Error) -> FitError,
) -> Result<Option<BaseAdvice>, FitError> {
    let blocks = Blocks::new(samples, BLOCKS, ROWS);
    let cv_rmse = |basis: &dyn Basis| {
        let problem = Problem::new(samples, basis, &blocks, per_record).with_linear_effects_fixed();
        // Only play operators have a drag.
        let known = Hypothesis { drag: found.drag.filter(|_| basis.drags()), ..found.clone() };
        Ok::<_, Error>(problem.fit_linear(&known)?.and_then(|f| Trial::of(&problem, f)).map(|t| t.cv_rmse()))
    };
    let Some(own_cv_rmse) = cv_rmse(own.1).map_err(stage)? else { return Ok(None) };
    let mut best: Option<BaseAdvice> = None;
    for model in [Kind::Pi, Kind::Preisach].into_iter().filter(|kind| *kind != own.0) {
        let error = cv_rmse(basis_for(model, samples)?.as_ref()).map_err(stage)?;
        let least = best.as_ref().map_or((1.0 - MIN_RMSE_DROP) * own_cv_rmse, |b| b.cv_rmse);
        if let Some(cv_rmse) = error.filter(|e| *e < least) {
            best = Some(BaseAdvice { model, cv_rmse, own_cv_rmse });
        }
    }
    Ok(best)
}
