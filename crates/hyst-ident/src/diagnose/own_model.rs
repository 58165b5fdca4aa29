//! The user's model as a base of the diagnosis: the record on which it is extended, and its thresholds.

use std::collections::BTreeMap;

use hyst_core::Error;

use super::{shape, uncertainty};
use crate::base::{Drag, PiBasis};
use crate::fit::{BasisOf, FitError};
use crate::lsq::{BLOCKS, Blocks};
use crate::model::{Effect, Model};
use crate::nested::{Fitted, Hypothesis, Problem, limit_slope};
use crate::record::Record;
use crate::samples::Samples;
use crate::simulate::Simulation;

/// Maximum number of rows of the search for a curve on the model's base.
pub(super) const SHAPE_ROWS: usize = 8_000;
/// Maximum number of rows of the final fit.
pub(super) const FINAL_ROWS: usize = 40_000;

/// The user's model and the record on which it is extended.
#[derive(Clone, Copy)]
pub(super) struct OwnModel<'a> {
    pub(super) model: &'a Model,
    pub(super) train: &'a Record,
    /// The record, with the rows that count for the search.
    pub(super) samples: &'a Samples,
    /// Basis of the model's own base.
    pub(super) basis: &'a BasisOf,
    /// Simulation of the training record with the unextended model.
    pub(super) before: &'a Simulation,
    /// Whether each file has its own sensor zero.
    pub(super) per_record: bool,
}

impl<'a> OwnModel<'a> {
    /// Returns the error of a stage that cannot be built.
    pub(super) fn stage(&self, source: Error) -> FitError {
        FitError::Stage { record: self.train.name(), source }
    }

    /// Returns the problem on a basis, over the rows that count for the search.
    pub(super) fn on<'b>(&self, basis: &'b BasisOf, blocks: &'b Blocks) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem::new(self.samples, basis.as_ref(), blocks, self.per_record)
    }

    /// Refits a saturation limit on the model's own base.
    pub(super) fn stop(&self, hypothesis: &mut Hypothesis, errors: &mut BTreeMap<String, f64>) -> Result<(), FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        if let Some(fit) = shape::own_limits(&problem, hypothesis).map_err(|e| self.stage(e))? {
            self.take(Effect::Saturation, &fit, errors);
            *hypothesis = fit.hypothesis;
        }
        Ok(())
    }

    /// Copies the standard errors of one effect's parameters from a fit.
    pub(super) fn take(&self, effect: Effect, fit: &Fitted, errors: &mut BTreeMap<String, f64>) {
        let of_fit = uncertainty::standard_errors(fit, self.samples.time[0]);
        errors.extend(of_fit.into_iter().filter(|(key, _)| key.split('.').next() == Some(effect.name())));
    }

    /// Returns the model's base with thresholds chosen with these effects known, if they predict clearly better and are
    /// no more than before. The original thresholds were chosen before the effects were known.
    pub(super) fn with_better_thresholds(&self, hypothesis: &Hypothesis) -> Result<Option<BasisOf>, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, FINAL_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        let fit = problem.fit_linear(hypothesis).map_err(|e| self.stage(e))?;
        fit.map(|fit| self.reselected(&problem, &fit)).transpose().map(Option::flatten)
    }

    /// Returns the model's base with thresholds chosen around a fit; `None` if the original ones are kept.
    pub(super) fn reselected(&self, problem: &Problem<'_>, fit: &Fitted) -> Result<Option<BasisOf>, FitError> {
        let BasisOf::Pi(plays) = self.basis else { return Ok(None) };
        let seen = problem.tangent(fit).map_err(|e| self.stage(e))?;
        let drag = fit.hypothesis.drag.map_or(Drag::NONE, |p| p.over(self.samples));
        Ok(plays.chosen(&seen.samples, &drag, &|plays| seen.through(plays), None).map(BasisOf::Pi))
    }

    /// Returns even thresholds over the drive of the operator, as at the start of a fit.
    pub(super) fn even(&self, problem: &Problem<'_>, fit: &Fitted) -> Result<Option<BasisOf>, FitError> {
        let BasisOf::Pi(_) = self.basis else { return Ok(None) };
        let seen = problem.tangent(fit).map_err(|e| self.stage(e))?;
        Ok(Some(BasisOf::Pi(PiBasis::for_samples(&seen.samples))))
    }

    /// Returns the record with its drive limited to this slope \[V/s\], as by a slow amplifier.
    pub(super) fn amplified(&self, v_per_s: f64) -> Record {
        let mut drive = self.train.input().to_vec();
        limit_slope(&mut drive, self.samples, v_per_s);
        self.train.driven_by(drive)
    }
}
