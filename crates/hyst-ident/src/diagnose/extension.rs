//! Extends the user's model with the effects found and checks whether that improves it.

use std::collections::BTreeMap;

use hyst_core::Error;

use super::follow::followed;
use super::own_model::{FINAL_ROWS, OwnModel, SHAPE_ROWS};
use super::search::with_best_laws;
use super::settled::{Settled, unless_followed};
use super::trial::Trial;
use super::{score, shape, uncertainty};
use crate::base::LinearisedBasis;
use crate::criteria::{LARGE_RATIO, RMSE_TOLERANCE};
use crate::fit::{BasisOf, FitError, to_model};
use crate::lsq::{BLOCKS, Blocks};
use crate::model::Model;
use crate::nested::{Fitted, Hypothesis, Problem, without_sensor_effects};
use crate::samples::Samples;
use crate::settle::start_up_rows;
use crate::simulate::{Simulation, Zero, simulate};

/// A model extended by the effects found.
pub(super) struct Extension {
    pub(super) hypothesis: Hypothesis,
    pub(super) errors: BTreeMap<String, f64>,
    /// The record with re-estimated starts of its segments, if the model was fitted to that.
    pub(super) restarted: Option<Samples>,
    pub(super) model: Model,
    /// Simulation of the training record.
    pub(super) after: Simulation,
}

impl OwnModel<'_> {
    /// Returns the model's base, moved to these effects if it is not linear in its parameters. `fit` fits what may
    /// change on a linearisation; `holds` keeps load, temperature, drift and tone at their values.
    fn followed_basis(
        &self,
        hypothesis: &Hypothesis,
        blocks: &Blocks,
        holds: bool,
        fit: impl Fn(&Problem<'_>, &Hypothesis) -> Result<Option<Fitted>, Error>,
    ) -> Result<BasisOf, FitError> {
        let BasisOf::Linearised(plane) = self.basis else { return Ok(self.basis.clone()) };
        let on = |basis: &LinearisedBasis, solve: &dyn Fn(&Problem<'_>) -> Result<Option<Fitted>, Error>| {
            let problem = Problem::new(self.samples, basis, blocks, self.per_record);
            solve(&if holds { problem.with_linear_effects_fixed() } else { problem }).map_err(|e| self.stage(e))
        };
        let fit = |basis: &LinearisedBasis, h: &Hypothesis| on(basis, &|problem| fit(problem, h));
        let solve = |basis: &LinearisedBasis, h: &Hypothesis| on(basis, &|problem| problem.fit_linear(h));
        let followed = followed(plane, hypothesis, fit, solve)?;
        Ok(BasisOf::Linearised(Box::new(followed.map_or_else(|| plane.as_ref().clone(), |(there, _)| there))))
    }

    /// Refits the effects beyond `known` on the model's own base. Returns `None` unless that base then follows the
    /// record about as well as the screening basis. A screening basis takes up a part of each effect, so its parameters
    /// are biased.
    pub(super) fn refitted_effects(
        &self,
        known: &Hypothesis,
        hypothesis: &Hypothesis,
        richest: f64,
        noise: f64,
        seed: u64,
    ) -> Result<Option<Fitted>, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let stage = |e| self.stage(e);
        let basis = self.followed_basis(hypothesis, &blocks, false, |problem, h| problem.fit(h))?;
        let problem = self.on(&basis, &blocks);
        let held = shape::plain(&self.on(&basis, &blocks).with_linear_effects_fixed(), hypothesis).map_err(stage)?;
        let follows = |trial: &Trial| {
            let cv_rmse = trial.cv_rmse();
            let is_worth = || held.as_ref().is_none_or(|held| score::is_worth(held, trial));
            let is_near = cv_rmse <= shape::MAX_RATIO_RESELECTED * richest
                || cv_rmse <= shape::MAX_RATIO_TO_SCREENING * richest && is_worth();
            // Or the effects explain something else on this base than on the screening basis.
            let is_another = || held.as_ref().is_some_and(|held| score::is_far_better(held, trial));
            (is_near || is_another()) && score::sensible(&problem, trial)
        };
        let fit = problem.fit(hypothesis).map_err(stage)?;
        let Some(mut trial) = fit.and_then(|fit| Trial::of(&problem, fit)) else { return Ok(None) };
        if trial.cv_rmse() > shape::MAX_RATIO_RESELECTED * richest {
            trial = with_best_laws(&problem, trial, &known.causes(), noise, seed).map_err(stage)?;
        }
        Ok(Some(trial).filter(follows).map(|trial| trial.fit))
    }

    /// Returns the extension with the smallest error over all rows, among those that improve the model and transfer to
    /// other experiments.
    /// The candidates combine the parameters from the screening basis or from the model's own base with the known or
    /// the re-estimated starts. A start to which the model cannot be brought is skipped.
    pub(super) fn best(
        &self,
        known: &Hypothesis,
        found: (&Hypothesis, &BTreeMap<String, f64>),
        (richest, noise, seed): (f64, f64, u64),
        zero: Zero,
    ) -> Result<Extension, FitError> {
        let restarted = self.start(found.0, noise)?;
        let mut extensions = Vec::new();
        for restarted in std::iter::once(None).chain(restarted.map(Some)) {
            let own = OwnModel { samples: restarted.as_ref().unwrap_or(self.samples), ..*self };
            let of = |hypothesis: &Hypothesis, errors: BTreeMap<String, f64>| {
                let model = own.extended(hypothesis, &errors, restarted.is_some())?;
                let after = simulate(&model, self.train, zero)?;
                Ok::<_, FitError>(Extension {
                    hypothesis: hypothesis.clone(),
                    errors,
                    restarted: restarted.clone(),
                    model,
                    after,
                })
            };
            extensions.push(of(found.0, found.1.clone())?);
            if let Some(fit) = own.refitted_effects(known, found.0, richest, noise, seed)? {
                extensions.push(of(&fit.hypothesis, uncertainty::standard_errors(&fit, self.samples.time[0]))?);
            }
        }
        let left = |e: &Extension| e.after.errors.as_ref().map_or(f64::INFINITY, |errors| errors.rmse_all_rows);
        extensions.sort_by(|a, b| left(a).total_cmp(&left(b)));
        let mut best = 0;
        for (at, e) in extensions.iter().enumerate() {
            let own = OwnModel { samples: e.restarted.as_ref().unwrap_or(self.samples), ..*self };
            if own.is_improved(self.before, &e.after) && own.transfers(known, &e.hypothesis)? {
                best = at;
                break;
            }
        }
        Ok(extensions.swap_remove(best))
    }

    /// Returns the model with these effects and their standard errors. The effects keep the parameters from the
    /// screening basis: refitted on a coarser base they would take up its misfit. Only the weights and the zero are
    /// solved again. `restarted` says that the starts of the segments were re-estimated with these effects.
    fn extended(
        &self,
        hypothesis: &Hypothesis,
        errors: &BTreeMap<String, f64>,
        restarted: bool,
    ) -> Result<Model, FitError> {
        self.refitted(hypothesis, errors, true, restarted)
    }

    /// Returns the same model with all its linear unknowns solved again.
    pub(super) fn refitted_base(&self, hypothesis: &Hypothesis) -> Result<Model, FitError> {
        self.refitted(hypothesis, &BTreeMap::new(), false, false)
    }

    fn refitted(
        &self,
        hypothesis: &Hypothesis,
        errors: &BTreeMap<String, f64>,
        holds: bool,
        restarted: bool,
    ) -> Result<Model, FitError> {
        let mut motion = without_sensor_effects(self.samples, &hypothesis.effects);
        let mut moving = Hypothesis { zero_wanders: false, gain_wanders: false, ..hypothesis.clone() };
        (moving.effects.drift, moving.effects.interference) = (None, None);
        let blocks = Blocks::new(&motion, BLOCKS, FINAL_ROWS);
        let mut fitted = |settling: &[bool]| {
            motion.settling.copy_from_slice(settling);
            let problem = Problem::new(&motion, self.basis.as_ref(), &blocks, self.per_record);
            let problem = if holds { problem.with_linear_effects_fixed() } else { problem };
            let Some(fit) = problem.fit_linear(&moving).map_err(|e| self.stage(e))? else { return Ok(None) };
            let residual = problem.residual(&fit).map_err(|e| self.stage(e))?;
            let starting = start_up_rows(&motion, &residual);
            Ok::<_, FitError>(Some((fit, starting)))
        };
        // A start-up row of the unextended model may be an ordinary row for the extended one, which may need it. With
        // re-estimated starts, the start-up rows are those of that estimate.
        let starting = if restarted { &self.samples.settling } else { &self.before.settling };
        let known = Settled::from(starting.clone(), &mut fitted)?;
        let known = known.ok_or_else(|| FitError::Unsolvable { record: self.train.name() })?;
        let Settled { fit, settling } = unless_followed(self.samples, known, &mut fitted)?;
        motion.settling = settling;
        let (basis, fit) = match self.basis {
            BasisOf::Linearised(plane) => {
                let solve = |basis: &LinearisedBasis, hypothesis: &Hypothesis| {
                    let problem = Problem::new(&motion, basis, &blocks, self.per_record);
                    let problem = if holds { problem.with_linear_effects_fixed() } else { problem };
                    problem.fit_linear(hypothesis).map_err(|e| self.stage(e))
                };
                let followed = followed(plane, &moving, solve, solve)?;
                let (there, fit) = followed.ok_or_else(|| FitError::Unsolvable { record: self.train.name() })?;
                (BasisOf::Linearised(Box::new(there)), fit)
            }
            other => (other.clone(), fit),
        };
        // The output range is that of the motion, without the sensor's effects.
        let mut extended = to_model(self.train, &motion, &basis, &fit, self.model.seed);
        extended.effects.drift = hypothesis.effects.drift;
        extended.effects.interference = hypothesis.effects.interference;
        extended.between_samples = self.model.between_samples;
        if extended.base == self.model.base {
            // The parameters of an operator that is not refitted keep their standard errors.
            let of_operator = format!("{}.", self.model.base.kind().name());
            let own = |name: &&String| name.starts_with(&of_operator);
            let errors = self.model.std_errors.iter().filter(|(name, _)| own(name));
            extended.std_errors = errors.map(|(name, error)| (name.clone(), *error)).collect();
            extended.undetermined = self.model.undetermined.iter().filter(own).cloned().collect();
        }
        extended.std_errors.extend(errors.clone());
        Ok(extended)
    }

    /// Returns whether the error `after` the extension is smaller than `before`, over the rows that count for the
    /// search or over the rows that the extended model was fitted to. A model without a saturation, for example, marks
    /// the saturated rows as start-up.
    /// In addition the error must not grow by more than [`RMSE_TOLERANCE`] over the rows that are start-up for neither
    /// model, and not by more than [`LARGE_RATIO`] over all rows that the sensor shows.
    pub(super) fn is_improved(&self, before: &Simulation, after: &Simulation) -> bool {
        let samples = self.samples;
        let errs_less = |counts: &dyn Fn(usize) -> bool| {
            let rows = || (0..samples.len()).filter(|k| !samples.settling[*k] && counts(*k));
            let squares = |s: &Simulation| rows().map(|k| (samples.output[k] - s.predicted[k]).powi(2)).sum::<f64>();
            squares(after) < squares(before)
        };
        let both = |k: usize| !before.settling[k] && !after.settling[k];
        let stays_within = |most: f64, counts: &dyn Fn(usize) -> bool| {
            let squares = |s: &Simulation| {
                let rows = (0..samples.len()).filter(|k| counts(*k));
                rows.map(|k| (samples.output[k] - s.predicted[k]).powi(2)).sum::<f64>()
            };
            squares(after) <= most * most * squares(before)
        };
        (errs_less(&|_| true) || errs_less(&|k| !after.settling[k]))
            && stays_within(RMSE_TOLERANCE, &both)
            && stays_within(LARGE_RATIO, &|k| !samples.blind[k])
    }

    /// Returns whether the model's own base predicts experiments outside its fit at least as well with these effects as
    /// without. A model that predicts worse is rejected.
    pub(super) fn transfers(&self, start: &Hypothesis, found: &Hypothesis) -> Result<bool, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        // The wander is no part of the model; the slew limit applies to both.
        let model_of = |h: &Hypothesis| Hypothesis {
            zero_wanders: false,
            gain_wanders: false,
            slew_limit: found.slew_limit,
            ..h.clone()
        };
        let solved = |h: &Hypothesis| {
            let h = model_of(h);
            let fit = match self.basis {
                // At the parameters that were fitted without the effects, the base would misjudge them.
                BasisOf::Linearised(_) => {
                    let basis = self.followed_basis(&h, &blocks, true, |problem, h| problem.fit_linear(h))?;
                    self.on(&basis, &blocks).with_linear_effects_fixed().fit_linear(&h)
                }
                _ => problem.fit_linear(&h),
            };
            fit.map_err(|e| self.stage(e))
        };
        let (Some(before), Some(after)) = (solved(start)?, solved(found)?) else { return Ok(true) };
        Ok(problem.transferred([&before, &after]).is_none_or(|[before, after]| after <= before))
    }
}
