//! Extends the user's model with the effects found and checks whether that improves it.

use std::collections::BTreeMap;

use hyst_core::{CurveSide, Error};

use super::follow::followed;
use super::search::{Named, Search, search_with_noise, with_best_laws};
use super::shape::CurveFits;
use super::trial::Trial;
use super::{FINAL_ROWS, SHAPE_ROWS, score, shape, uncertainty};
use crate::base::{Drag, LinearisedBasis, PiBasis};
use crate::criteria::{DOMINANT_SHARE, LARGE_RATIO, RMSE_TOLERANCE};
use crate::fit::{BLOCKS, BasisOf, FitError, to_model};
use crate::lsq::Blocks;
use crate::model::{Effect, Model};
use crate::nested::{Cause, Fitted, Hypothesis, Problem, limit_slope, without_sensor_effects};
use crate::record::Record;
use crate::samples::Samples;
use crate::settle::{Settled, start_up_rows, unless_followed};
use crate::simulate::{Simulation, Zero, simulate};

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
    pub(super) fn stage(&self, source: Error) -> FitError {
        FitError::Stage { record: self.train.name(), source }
    }

    /// Refits a saturation limit on the model's own base.
    pub(super) fn stop(&self, hypothesis: &mut Hypothesis, errors: &mut BTreeMap<String, f64>) -> Result<(), FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        if let Some(fit) = shape::own_stop(&problem, hypothesis).map_err(|e| self.stage(e))? {
            self.take(Effect::Saturation, &fit, errors);
            *hypothesis = fit.hypothesis;
        }
        Ok(())
    }

    /// Returns the problem on a basis, over the rows that count for the search.
    pub(super) fn on<'b>(&self, basis: &'b BasisOf, blocks: &'b Blocks) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem::new(self.samples, basis.as_ref(), blocks, self.per_record)
    }

    /// Copies the standard errors of one effect's parameters from a fit.
    pub(super) fn take(&self, effect: Effect, fit: &Fitted, errors: &mut BTreeMap<String, f64>) {
        let of_fit = uncertainty::standard_errors(fit, self.samples.time[0]);
        errors.extend(of_fit.into_iter().filter(|(key, _)| key.split('.').next() == Some(effect.name())));
    }

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
            // A curve behind the operator is linear in its weights. One before the operator has to be searched. It is tried
            // unless the first one leaves only noise: the right curve may predict better than the rich base.
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
        let basis = shape.anew.and_then(|at| bases.swap_remove(at));
        let searched = searched.filter(|search| search.best.fit.hypothesis == shape.hypothesis);
        Ok(CurveSearch { curve: Some((shape.named, shape.fit)), basis, searched })
    }

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
        let closes = search.best.cv_rmse() <= shape::MAX_RATIO_RESELECTED * richest
            && before - search.best.total() >= DOMINANT_SHARE * (before - floor);
        Ok(Some(search).filter(|s| closes && !s.named.is_empty()))
    }

    /// Returns the model's base with thresholds chosen with these effects known, if they predict clearly better and are
    /// no more than before. The original thresholds were chosen before the effects were known.
    pub(super) fn with_better_thresholds(&self, hypothesis: &Hypothesis) -> Result<Option<BasisOf>, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, FINAL_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        let fit = problem.fit_linear(hypothesis).map_err(|e| self.stage(e))?;
        fit.map(|fit| self.reselected(&problem, &fit)).transpose().map(Option::flatten)
    }

    fn reselected(&self, problem: &Problem<'_>, fit: &Fitted) -> Result<Option<BasisOf>, FitError> {
        let BasisOf::Pi(plays) = self.basis else { return Ok(None) };
        let seen = problem.tangent(fit).map_err(|e| self.stage(e))?;
        let drag = fit.hypothesis.drag.map_or(Drag::NONE, |p| p.over(self.samples));
        Ok(plays.chosen(&seen.samples, &drag, &|plays| seen.through(plays), None).map(BasisOf::Pi))
    }

    /// Returns even thresholds over the drive of the operator, as at the start of a fit.
    fn even(&self, problem: &Problem<'_>, fit: &Fitted) -> Result<Option<BasisOf>, FitError> {
        let BasisOf::Pi(_) = self.basis else { return Ok(None) };
        let seen = problem.tangent(fit).map_err(|e| self.stage(e))?;
        Ok(Some(BasisOf::Pi(PiBasis::for_samples(&seen.samples))))
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
        let basis = match self.basis {
            BasisOf::Linearised(plane) => {
                let on = |basis: &LinearisedBasis, solve: &dyn Fn(Problem<'_>) -> Result<Option<Fitted>, Error>| {
                    solve(Problem::new(self.samples, basis, &blocks, self.per_record)).map_err(stage)
                };
                let fit = |basis: &LinearisedBasis, h: &Hypothesis| on(basis, &|problem| problem.fit(h));
                let solve = |basis: &LinearisedBasis, h: &Hypothesis| on(basis, &|problem| problem.fit_linear(h));
                let followed = followed(plane, hypothesis, fit, solve)?;
                BasisOf::Linearised(Box::new(followed.map_or_else(|| plane.as_ref().clone(), |(there, _)| there)))
            }
            other => other.clone(),
        };
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
        let solved = |h: &Hypothesis| problem.fit_linear(&model_of(h)).map_err(|e| self.stage(e));
        let (Some(before), Some(after)) = (solved(start)?, solved(found)?) else { return Ok(true) };
        Ok(problem.transferred([&before, &after]).is_none_or(|[before, after]| after <= before))
    }

    /// Returns the record with its drive limited to this slope \[V/s\], as by a slow amplifier.
    pub(super) fn amplified(&self, v_per_s: f64) -> Record {
        let mut drive = self.train.input().to_vec();
        limit_slope(&mut drive, self.samples, v_per_s);
        self.train.driven_by(drive)
    }
}
