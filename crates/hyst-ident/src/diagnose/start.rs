//! How each segment begins, as the model's own base shows it with what was found.
//!
//! The search takes a start as its rich base saw it while the effects stood in the record. Once these are known, or beside a curve that may be missing,
//! the own base is asked again: for the histories that may have led there, for the last turns, and for what is a start-up then.

use hyst_core::{CurveSide, Error};

use super::extension::Own;
use super::trial::Trial;
use super::{SHAPE_ROWS, shape};
use crate::fit::{BLOCKS, FitError};
use crate::lsq::Blocks;
use crate::memory;
use crate::nested::{Hypothesis, Problem};
use crate::samples::Samples;
use crate::settle::{start_up_rows, started, without_beginnings};

/// How often a start is looked for, each time with what is known of it.
const RECALLS: usize = 2;

/// A record with the start of each segment, and what the own base with a curve leaves of it then, cross-validated \[y\].
struct Start {
    samples: Samples,
    cv_rmse: f64,
}

impl Own<'_> {
    /// The record with the start of each segment as the own base shows it once it has the curve that it may lack: beneath what a missing curve leaves
    /// everywhere no start stands out. None if that is as it was known.
    pub(super) fn start_beside_a_curve(
        &self,
        hypothesis: &Hypothesis,
        richest: f64,
    ) -> Result<Option<Samples>, FitError> {
        let behind = self.started(hypothesis, richest, Some(CurveSide::Output))?;
        // A curve before the hysteresis has to be searched: only where one behind it leaves much.
        let before = match &behind {
            Some(behind) if behind.cv_rmse > shape::CLOSED * richest => {
                self.started(hypothesis, richest, Some(CurveSide::Input))?
            }
            _ => None,
        };
        let better = [behind, before].into_iter().flatten().min_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
        let is_another = |start: &Samples| start.settling != self.samples.settling || start.pasts != self.samples.pasts;
        Ok(better.map(|start| start.samples).filter(is_another))
    }

    /// The same as the own base shows it with what was found.
    pub(super) fn start(&self, hypothesis: &Hypothesis, noise: f64) -> Result<Option<Samples>, FitError> {
        // Not what the rich base misses: it does not know the start either. And what misses no more than noise of the other rows may miss a start-up.
        let least = if started(self.samples, &self.samples.settling).contains(&true) { 0.0 } else { noise };
        let start = self.started(hypothesis, least, None)?.map(|start| start.samples);
        // Another than the extended model would take by itself.
        Ok(start.filter(|start| start.settling != self.before.settling || start.pasts != self.samples.pasts))
    }

    /// The start of each segment, beside a curve on one side; none where no more than `least` is missed, or where no curve can be fitted.
    fn started(&self, hypothesis: &Hypothesis, least: f64, side: Option<CurveSide>) -> Result<Option<Start>, FitError> {
        let stage = |e| self.stage(e);
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let plain = shape::plain(&self.on(self.basis, &blocks), hypothesis).map_err(stage)?;
        if plain.is_none_or(|plain| shape::is_complete(&plain, least)) {
            return Ok(None);
        }
        // Near 0 V only where everything is known but the start.
        let asked = match side {
            Some(_) => memory::away(self.samples),
            None => vec![true; self.samples.segments.len()],
        };
        // What a fit with another start leaves, what it leaves in each row, and the turns of the drive before that these call for.
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
            let pasts = memory::recalled(&problem, &fit, &residual, &asked, &memory::away(samples))?;
            Ok::<_, Error>(Trial::of(&problem, fit).map(|trial| (trial, residual, pasts)))
        };
        let squares = |samples: &Samples| {
            let fitted = fitted(samples, false).map_err(stage)?;
            Ok::<_, FitError>(fitted.map_or(f64::INFINITY, |(trial, ..)| trial.fit.squares))
        };
        // Of what came before, a part is seen all through the record: each history is judged by a fit of its own, to the rows in which no start-up can
        // lie.
        let late = without_beginnings(self.samples);
        let mut known = memory::with_histories(&late, &asked, &mut |samples| squares(samples))?;
        // Then the turns, as far as the first rows show them; what is left is a start-up.
        let all = |samples: &Samples| squares(&Samples { settling: samples.blind.clone(), ..samples.clone() });
        for _ in 0..RECALLS {
            let Some((.., pasts)) = fitted(&known, true).map_err(stage)? else { break };
            let next = Samples { pasts: memory::kept(&known.pasts, pasts), ..known.clone() };
            if next.pasts == known.pasts || all(&next)? >= all(&known)? {
                break;
            }
            known = next;
        }
        // What was a start-up before is none after a past that explains it.
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
