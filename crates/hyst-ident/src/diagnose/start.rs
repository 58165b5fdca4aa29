//! Estimates the start of each segment again, on the model's own base with the effects found.
//!
//! The search uses the start that its basis found before the effects were known. With the effects, or with a curve that
//! may be missing, the model's own base estimates again: the drive history before the segment, the last reversals, and
//! the start-up rows.

use hyst_core::{CurveSide, Error};

use super::own_model::{OwnModel, SHAPE_ROWS};
use super::shape;
use super::trial::Trial;
use crate::fit::FitError;
use crate::lsq::{BLOCKS, Blocks};
use crate::memory;
use crate::nested::{Hypothesis, Problem};
use crate::samples::Samples;
use crate::settle::{start_up_rows, started, without_beginnings};

/// Maximum number of estimates of the last reversals, each from the previous one.
const RECALLS: usize = 2;

/// A record with the starts of its segments, and the cross-validated RMSE of the model's base with a curve \[y\].
struct Start {
    samples: Samples,
    cv_rmse: f64,
}

impl OwnModel<'_> {
    /// Returns the record with the starts that the model's base shows together with a missing curve; `None` if they are
    /// unchanged. Without the curve, its residual hides the starts.
    pub(super) fn start_beside_a_curve(
        &self,
        hypothesis: &Hypothesis,
        richest: f64,
    ) -> Result<Option<Samples>, FitError> {
        let behind = self.started(hypothesis, richest, Some(CurveSide::Output))?;
        // A curve before the hysteresis has to be searched. This is done only if one behind it leaves a large error.
        let before = match &behind {
            Some(behind) if behind.cv_rmse > shape::MAX_RATIO_TO_SCREENING * richest => {
                self.started(hypothesis, richest, Some(CurveSide::Input))?
            }
            _ => None,
        };
        let better = [behind, before].into_iter().flatten().min_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
        let is_another = |start: &Samples| start.settling != self.samples.settling || start.pasts != self.samples.pasts;
        Ok(better.map(|start| start.samples).filter(is_another))
    }

    /// Returns the record with the starts that the model's base shows with the effects found; `None` if the extended
    /// model would take these by itself.
    pub(super) fn start(&self, hypothesis: &Hypothesis, noise: f64) -> Result<Option<Samples>, FitError> {
        // The error of the rich base is no measure: it does not know the start either. If rows are left out as
        // start-up, even a model that leaves only noise in the other rows may be improved.
        let least = if started(self.samples, &self.samples.settling).contains(&true) { 0.0 } else { noise };
        let start = self.started(hypothesis, least, None)?.map(|start| start.samples);
        Ok(start.filter(|start| start.settling != self.before.settling || start.pasts != self.samples.pasts))
    }

    /// Estimates the start of each segment, with a curve on one side if given. Returns `None` if the error is not above
    /// `least`, or if no curve can be fitted.
    fn started(&self, hypothesis: &Hypothesis, least: f64, side: Option<CurveSide>) -> Result<Option<Start>, FitError> {
        let stage = |e| self.stage(e);
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let plain = shape::plain(&self.on(self.basis, &blocks), hypothesis).map_err(stage)?;
        if plain.is_none_or(|plain| shape::is_complete(&plain, least)) {
            return Ok(None);
        }
        // Near 0 V only if nothing but the start is unknown.
        let asked = match side {
            Some(_) => memory::away(self.samples),
            None => vec![true; self.samples.segments.len()],
        };
        // Fits with another start: returns the trial, the residual of each row, and the reversals before the record
        // that they suggest.
        let fitted = |samples: &Samples, recalls: bool| {
            let blocks = Blocks::new(samples, BLOCKS, SHAPE_ROWS);
            let problem = Problem::new(samples, self.basis.as_ref(), &blocks, self.per_record);
            let Some(plain) = problem.fit_linear(hypothesis)? else { return Ok(None) };
            let fit = match side {
                Some(side) => shape::bent(&problem, hypothesis, &plain, side)?.map(|bent| bent.trial.fit),
                None => Some(plain),
            };
            let Some(fit) = fit else { return Ok(None) };
            let residual = problem.residual(&fit)?;
            let asked: Vec<bool> = asked.iter().map(|asked| recalls && *asked).collect();
            let motion_in = |samples: &Samples| problem.motion_in(&fit, samples);
            let pasts = memory::recalled(samples, &residual, &asked, &memory::away(samples), motion_in)?;
            Ok::<_, Error>(Trial::of(&problem, fit).map(|trial| (trial, residual, pasts)))
        };
        let squares = |samples: &Samples| {
            let fitted = fitted(samples, false).map_err(stage)?;
            Ok::<_, FitError>(fitted.map_or(f64::INFINITY, |(trial, ..)| trial.fit.squares))
        };
        // A part of the history shows in the whole record. Each history is judged by its own fit to the rows after the
        // start-up windows.
        let late = without_beginnings(self.samples);
        let mut known = memory::with_histories(&late, &asked, &mut |samples| squares(samples))?;
        // Then the last reversals, as far as the first rows show them. The remaining rows are start-up.
        let all = |samples: &Samples| squares(&Samples { settling: samples.blind.clone(), ..samples.clone() });
        for _ in 0..RECALLS {
            let Some((.., pasts)) = fitted(&known, true).map_err(stage)? else { break };
            let next = Samples { pasts: memory::kept(&known.pasts, pasts), ..known.clone() };
            if next.pasts == known.pasts || all(&next)? >= all(&known)? {
                break;
            }
            known = next;
        }
        // A new history may explain rows that were start-up before.
        let mut settling = self.samples.settling.clone();
        if known.pasts != self.samples.pasts {
            settling.copy_from_slice(&known.blind);
            known.settling.copy_from_slice(&known.blind);
        }
        let Some((trial, residual, _)) = fitted(&known, false).map_err(stage)? else { return Ok(None) };
        let starting = start_up_rows(&known, &residual);
        known.settling = settling.iter().zip(starting).map(|(known, starts)| *known || starts).collect();
        Ok(Some(Start { samples: known, cv_rmse: trial.cv_rmse() }))
    }
}
