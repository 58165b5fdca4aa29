//! The user's own model with what was found, and whether that helps it.

use std::collections::BTreeMap;

use super::{FINAL_ROWS, SHAPE_ROWS, shape, uncertainty};
use crate::fit::{BLOCKS, BasisOf, FitError, to_model};
use crate::lsq::Blocks;
use crate::model::{Effect, Model};
use crate::nested::{Hypothesis, Problem};
use crate::record::Record;
use crate::samples::Samples;
use crate::settle::start_up_rows;
use crate::simulate::Simulation;

/// A model and the record that it is extended on.
pub(super) struct Own<'a> {
    pub(super) model: &'a Model,
    pub(super) train: &'a Record,
    /// The record with the rows that count for the search.
    pub(super) samples: &'a Samples,
    /// The model's own base.
    pub(super) basis: &'a BasisOf,
    /// The model as it was, on the record.
    pub(super) before: &'a Simulation,
    /// One zero for each file.
    pub(super) per_record: bool,
}

impl Own<'_> {
    fn stage(&self, source: hyst_core::Error) -> FitError {
        FitError::Stage { record: self.train.name(), source }
    }

    /// Looks on the own base for what only it can show: where it meets a stop that was found, and whether it lacks a curve.
    /// Changes what was found accordingly, and gives the curve.
    pub(super) fn shape(
        &self,
        hypothesis: &mut Hypothesis,
        errors: &mut BTreeMap<String, f64>,
        stop_is_new: bool,
        richest: f64,
        noise: f64,
        seed: u64,
    ) -> Result<Option<super::search::Named>, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = Problem::new(self.samples, self.basis.as_ref(), &blocks, self.per_record);
        let mut take = |effect: Effect, fit: &crate::nested::Fitted| {
            let of_fit = uncertainty::standard_errors(fit, self.samples.time[0]);
            errors.extend(of_fit.into_iter().filter(|(key, _)| key.split('.').next() == Some(effect.name())));
        };
        if stop_is_new && let Some(fit) = shape::own_stop(&problem, hypothesis).map_err(|e| self.stage(e))? {
            take(Effect::Saturation, &fit);
            *hypothesis = fit.hypothesis;
        }
        let found = shape::shape(&problem, hypothesis, richest, noise, seed).map_err(|e| self.stage(e))?;
        Ok(found.map(|shape| {
            take(shape.named.effect, &shape.fit);
            *hypothesis = shape.hypothesis;
            shape.named
        }))
    }

    /// The model with these effects: they keep the parameters that the rich base gave them, since refitted on a coarser base they would
    /// take up its misfit. Only the base's weights and the zero are solved again.
    pub(super) fn extended(&self, hypothesis: &Hypothesis) -> Result<Model, FitError> {
        let mut motion = without_sensor_effects(self.samples, hypothesis);
        let mut moving = Hypothesis { zero_wanders: false, gain_wanders: false, ..hypothesis.clone() };
        (moving.effects.drift, moving.effects.interference) = (None, None);
        // What was a start-up for the model as it was need be none for the extended one.
        motion.settling.clone_from(&self.before.settling);
        let blocks = Blocks::new(&motion, BLOCKS, FINAL_ROWS);
        let fitted = |motion: &Samples| {
            let problem = Problem::new(motion, self.basis.as_ref(), &blocks, self.per_record);
            let fit = problem.fit_linear(&moving).map_err(|e| self.stage(e))?;
            let fit = fit.ok_or_else(|| FitError::Unsolvable { record: self.train.name() })?;
            let starting = start_up_rows(motion, &problem.residual(&fit).map_err(|e| self.stage(e))?);
            Ok::<_, FitError>((fit, starting))
        };
        let (mut fit, starting) = fitted(&motion)?;
        if starting != motion.settling {
            motion.settling = starting;
            fit = fitted(&motion)?.0;
        }
        // Its reach is that of the motion, not of the sensor.
        let mut extended = to_model(self.train, &motion, self.basis, &fit, self.model.seed);
        extended.effects.drift = hypothesis.effects.drift;
        extended.effects.interference = hypothesis.effects.interference;
        Ok(extended)
    }

    /// Whether it errs less than the model as it was, over the rows that count for the search: a model that misses a stop, say, takes
    /// the rows on it for a start-up.
    pub(super) fn is_helped(&self, after: &Simulation) -> bool {
        let samples = self.samples;
        let rows = || (0..samples.len()).filter(|k| !samples.settling[*k]);
        let squares = |s: &Simulation| rows().map(|k| (samples.output[k] - s.predicted[k]).powi(2)).sum::<f64>();
        squares(after) < squares(self.before)
    }
}

/// The record with drift and tone taken from its output.
fn without_sensor_effects(samples: &Samples, h: &Hypothesis) -> Samples {
    let (mut motion, effects) = (samples.clone(), &h.effects);
    for (k, y) in motion.output.iter_mut().enumerate() {
        let t = samples.time[k];
        if let Some(drift) = effects.drift {
            *y -= drift.per_second * t;
        }
        if let Some(tone) = effects.interference {
            *y -= tone.amplitude * (2.0 * std::f64::consts::PI * (tone.hz * t).fract() + tone.phase).sin();
        }
    }
    motion
}
