//! The user's own model with what was found, and whether that helps it.

use std::collections::BTreeMap;

use hyst_core::{CurveSide, Error};

use super::follow::followed;
use super::search::{Named, Search, further, with_own_laws};
use super::shape::Bent;
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

/// What the own base was found to lack beside what was found before.
#[derive(Default)]
pub(super) struct Shaped {
    /// A curve or a stop, and the fit with it and with all that is known then.
    pub(super) curve: Option<(Named, Fitted)>,
    /// The base, if its plays were chosen anew.
    pub(super) basis: Option<BasisOf>,
    /// What was found once more beside the curve, in the place of all that was found before.
    pub(super) searched: Option<Search>,
}

/// A model with what was found.
pub(super) struct Extension {
    pub(super) hypothesis: Hypothesis,
    pub(super) errors: BTreeMap<String, f64>,
    /// The record with other starts of its segments, if it was fitted to that.
    pub(super) begun: Option<Samples>,
    pub(super) model: Model,
    /// What it says of the record.
    pub(super) after: Simulation,
}

/// A model and the record that it is extended on.
#[derive(Clone, Copy)]
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

impl<'a> Own<'a> {
    pub(super) fn stage(&self, source: Error) -> FitError {
        FitError::Stage { record: self.train.name(), source }
    }

    /// Places a stop that was found where the own base meets it.
    pub(super) fn stop(&self, hypothesis: &mut Hypothesis, errors: &mut BTreeMap<String, f64>) -> Result<(), FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).holding();
        if let Some(fit) = shape::own_stop(&problem, hypothesis).map_err(|e| self.stage(e))? {
            self.take(Effect::Saturation, &fit, errors);
            *hypothesis = fit.hypothesis;
        }
        Ok(())
    }

    /// A problem on a base, over the rows that count for the search.
    pub(super) fn on<'b>(&self, basis: &'b BasisOf, blocks: &'b Blocks) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem::new(self.samples, basis.as_ref(), blocks, self.per_record)
    }

    /// Standard errors of an effect's parameters.
    pub(super) fn take(&self, effect: Effect, fit: &Fitted, errors: &mut BTreeMap<String, f64>) {
        let of_fit = uncertainty::standard_errors(fit, self.samples.time[0]);
        errors.extend(of_fit.into_iter().filter(|(key, _)| key.split('.').next() == Some(effect.name())));
    }

    /// Looks on the own base for what only it can show: whether it lacks a curve. `known` is what the model held already, `hypothesis` what was found
    /// beyond it.
    pub(super) fn shape(
        &self,
        known: &Hypothesis,
        hypothesis: &Hypothesis,
        richest: f64,
        noise: f64,
        seed: u64,
        progress: &(dyn Fn(&str) + Sync),
    ) -> Result<Shaped, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).holding();
        let stage = |e| self.stage(e);
        let plain = shape::plain(&problem, hypothesis).map_err(stage)?;
        let Some(plain) = plain.filter(|plain| !shape::is_complete(plain, richest)) else {
            return Ok(Shaped::default());
        };
        let (mut bent, mut bases): (Vec<Bent>, Vec<Option<BasisOf>>) = (Vec::new(), Vec::new());
        let complete = |curved: &shape::Curved| shape::is_complete(&curved.trial, richest);
        for side in [CurveSide::Output, CurveSide::Input] {
            // A curve behind the operator is solved for. One before it has to be searched, unless the first one leaves no more than noise: to predict as
            // well as the rich base is not enough, since the right curve may predict better.
            if bent.iter().flat_map(Bent::curves).any(|curved| shape::is_complete(&curved.trial, noise)) {
                break;
            }
            let own = shape::bent(&problem, hypothesis, &plain.fit, side).map_err(stage)?;
            let anew = own.as_ref().map(|bent| self.rechosen(&problem, &bent.trial.fit)).transpose()?.flatten();
            // The own plays were chosen without the curve, and follow what it makes of the drive.
            let anew = match (anew, &own) {
                (None, Some(bent)) if !complete(bent) => self.even(&problem, &bent.trial.fit)?,
                (anew, _) => anew,
            };
            let mut here = Bent { own, anew: None };
            if let Some(basis) = &anew {
                let behind = self.on(basis, &blocks).beside(&problem).holding();
                match shape::plain(&behind, hypothesis).map_err(stage)? {
                    // Other plays alone were missing, no curve.
                    Some(plain) if shape::is_complete(&plain, richest) => {
                        return Ok(Shaped { basis: anew, ..Shaped::default() });
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
        // What was found on another base, without the curve, has taken a part of it: all is searched once more with the curve.
        let all = bent.iter().enumerate().flat_map(|(at, bent)| bent.curves().map(move |curved| (at, curved)));
        let best = all.min_by(|(_, a), (_, b)| a.trial.total().total_cmp(&b.trial.total()));
        let mut searched = None;
        if let Some((at, curved)) = best.filter(|(_, curved)| !complete(curved) && curved.takes(&plain, noise)) {
            let is_anew = bent[at].own.as_ref().is_none_or(|own| !std::ptr::eq(own, curved));
            let basis = bases[at].as_ref().filter(|_| is_anew).unwrap_or(self.basis);
            let free = self.on(basis, &blocks).beside(&problem);
            let already: Vec<Cause> = known.causes().into_iter().chain([Cause::Effect(Effect::Asymmetry)]).collect();
            if let Some(from) = free.fit(&curved.trial.fit.hypothesis).map_err(stage)? {
                progress("searching with the curve that the model's own base lacks");
                let search = further(&free, from, &already, noise, seed, progress).map_err(stage)?;
                let with = shape::Curved { trial: search.best.clone(), is_lopsided: curved.is_lopsided };
                let plain = bent[at].anew.as_ref().filter(|_| is_anew).map(|(plain, _)| plain.clone());
                bent.push(match plain {
                    Some(plain) => Bent { own: None, anew: Some((plain, with)) },
                    None => Bent { own: Some(with), anew: None },
                });
                bases.push(if is_anew { bases[at].clone() } else { None });
                searched = Some(search);
            }
        }
        let found = shape::shape(&problem, hypothesis, &plain, bent, richest, noise, seed).map_err(stage)?;
        let Some(shape) = found else { return Ok(Shaped::default()) };
        let basis = shape.anew.and_then(|at| bases.swap_remove(at));
        let searched = searched.filter(|search| search.best.fit.hypothesis == shape.hypothesis);
        Ok(Shaped { curve: Some((shape.named, shape.fit)), basis, searched })
    }

    /// What a search on the own base finds where the rich one needs nothing; none unless it explains the record as well as that.
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
        // What a wandering or a slow amplifier leaves is no base's.
        let nameless = found.causes().iter().any(|cause| cause.is_nameless());
        if nameless || shape::is_complete(&plain, richest) {
            return Ok(None);
        }
        let (before, floor) = (plain.total(), plain.fit.rows as f64 * noise * noise);
        let search = further(&problem, plain.fit, &start.causes(), noise, seed, progress).map_err(stage)?;
        let closes = search.best.cv_rmse() <= shape::CLOSED_ANEW * richest
            && before - search.best.total() >= DOMINANT_SHARE * (before - floor);
        Ok(Some(search).filter(|s| closes && !s.named.is_empty()))
    }

    /// The own base with plays where the record calls for them once these effects are known, if they predict clearly better than those
    /// it has and are no more: those were placed while the effects stood in the record.
    pub(super) fn on_better_plays(&self, hypothesis: &Hypothesis) -> Result<Option<BasisOf>, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, FINAL_ROWS);
        let problem = self.on(self.basis, &blocks).holding();
        let fit = problem.fit_linear(hypothesis).map_err(|e| self.stage(e))?;
        fit.map(|fit| self.rechosen(&problem, &fit)).transpose().map(Option::flatten)
    }

    fn rechosen(&self, problem: &Problem<'_>, fit: &Fitted) -> Result<Option<BasisOf>, FitError> {
        let BasisOf::Pi(plays) = self.basis else { return Ok(None) };
        let seen = problem.tangent(fit).map_err(|e| self.stage(e))?;
        let drag = fit.hypothesis.drag.map_or(Drag::NONE, |p| p.over(self.samples));
        Ok(plays.chosen(&seen.samples, &drag, &|plays| seen.through(plays), None).map(BasisOf::Pi))
    }

    /// Plays spread evenly over what drives them, as a fit begins with.
    fn even(&self, problem: &Problem<'_>, fit: &Fitted) -> Result<Option<BasisOf>, FitError> {
        let BasisOf::Pi(_) = self.basis else { return Ok(None) };
        let seen = problem.tangent(fit).map_err(|e| self.stage(e))?;
        Ok(Some(BasisOf::Pi(PiBasis::for_samples(&seen.samples))))
    }

    /// What was found beyond what is `known`, all refitted on the own base; none unless that misses next to nothing of what the rich one shows. A rich
    /// base takes a part of what it is searched for, and its own parameters say less.
    pub(super) fn refound(
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
        let held = shape::plain(&self.on(&basis, &blocks).holding(), hypothesis).map_err(stage)?;
        let follows = |trial: &Trial| {
            let cv_rmse = trial.cv_rmse();
            let is_worth = || held.as_ref().is_none_or(|held| score::is_worth(held, trial));
            let is_near = cv_rmse <= shape::CLOSED_ANEW * richest || cv_rmse <= shape::CLOSED * richest && is_worth();
            // Or what it takes is not what the rich one gives it at all.
            let is_another = || held.as_ref().is_some_and(|held| score::is_far_better(held, trial));
            (is_near || is_another()) && score::sensible(&problem, trial)
        };
        let fit = problem.fit(hypothesis).map_err(stage)?;
        let Some(mut trial) = fit.and_then(|fit| Trial::of(&problem, fit)) else { return Ok(None) };
        if trial.cv_rmse() > shape::CLOSED_ANEW * richest {
            trial = with_own_laws(&problem, trial, &known.causes(), noise, seed).map_err(stage)?;
        }
        Ok(Some(trial).filter(follows).map(|trial| trial.fit))
    }

    /// The model with what was found beyond what is `known`: of several extensions the one that leaves least of the record, if it helps the model and
    /// transfers. With the parameters of the rich base or those of the own one, and with the starts as they were known or as they show now; a start that
    /// the model cannot be brought to says nothing.
    pub(super) fn best(
        &self,
        known: &Hypothesis,
        found: (&Hypothesis, &BTreeMap<String, f64>),
        (richest, noise, seed): (f64, f64, u64),
        zero: Zero,
    ) -> Result<Extension, FitError> {
        let begun = self.start(found.0, noise)?;
        let mut extensions = Vec::new();
        for begun in std::iter::once(None).chain(begun.map(Some)) {
            let own = Own { samples: begun.as_ref().unwrap_or(self.samples), ..*self };
            let of = |hypothesis: &Hypothesis, errors: BTreeMap<String, f64>| {
                let model = own.extended(hypothesis, &errors, begun.is_some())?;
                let after = simulate(&model, self.train, zero)?;
                Ok::<_, FitError>(Extension {
                    hypothesis: hypothesis.clone(),
                    errors,
                    begun: begun.clone(),
                    model,
                    after,
                })
            };
            extensions.push(of(found.0, found.1.clone())?);
            if let Some(fit) = own.refound(known, found.0, richest, noise, seed)? {
                extensions.push(of(&fit.hypothesis, uncertainty::standard_errors(&fit, self.samples.time[0]))?);
            }
        }
        let left = |e: &Extension| e.after.errors.as_ref().map_or(f64::INFINITY, |errors| errors.rmse_all_rows);
        extensions.sort_by(|a, b| left(a).total_cmp(&left(b)));
        let mut best = 0;
        for (at, e) in extensions.iter().enumerate() {
            let own = Own { samples: e.begun.as_ref().unwrap_or(self.samples), ..*self };
            if own.is_helped(self.before, &e.after) && own.transfers(known, &e.hypothesis)? {
                best = at;
                break;
            }
        }
        Ok(extensions.swap_remove(best))
    }

    /// The model with these effects and their standard errors: they keep the parameters that the rich base gave them, since refitted on a
    /// coarser base they would take up its misfit. Only the base's weights and the zero are solved again. `begun` says that the start of the record was
    /// found beside these effects.
    fn extended(
        &self,
        hypothesis: &Hypothesis,
        errors: &BTreeMap<String, f64>,
        begun: bool,
    ) -> Result<Model, FitError> {
        self.refitted(hypothesis, errors, true, begun)
    }

    /// The model as it is with all solved again that it is linear in.
    pub(super) fn fitted_anew(&self, hypothesis: &Hypothesis) -> Result<Model, FitError> {
        self.refitted(hypothesis, &BTreeMap::new(), false, false)
    }

    fn refitted(
        &self,
        hypothesis: &Hypothesis,
        errors: &BTreeMap<String, f64>,
        holds: bool,
        begun: bool,
    ) -> Result<Model, FitError> {
        let mut motion = without_sensor_effects(self.samples, &hypothesis.effects);
        let mut moving = Hypothesis { zero_wanders: false, gain_wanders: false, ..hypothesis.clone() };
        (moving.effects.drift, moving.effects.interference) = (None, None);
        let blocks = Blocks::new(&motion, BLOCKS, FINAL_ROWS);
        let mut fitted = |settling: &[bool]| {
            motion.settling.copy_from_slice(settling);
            let problem = Problem::new(&motion, self.basis.as_ref(), &blocks, self.per_record);
            let problem = if holds { problem.holding() } else { problem };
            let Some(fit) = problem.fit_linear(&moving).map_err(|e| self.stage(e))? else { return Ok(None) };
            let residual = problem.residual(&fit).map_err(|e| self.stage(e))?;
            let starting = start_up_rows(&motion, &residual);
            Ok::<_, FitError>(Some((fit, starting)))
        };
        // What was a start-up for the model as it was need be none for the extended one, which may have to see those rows to follow them.
        // One that was found beside what was found lasts as long as it did there.
        let starting = if begun { &self.samples.settling } else { &self.before.settling };
        let known = Settled::from(starting.clone(), &mut fitted)?;
        let known = known.ok_or_else(|| FitError::Unsolvable { record: self.train.name() })?;
        let Settled { fit, settling } = unless_followed(self.samples, known, &mut fitted)?;
        motion.settling = settling;
        let (basis, fit) = match self.basis {
            BasisOf::Linearised(plane) => {
                let solve = |basis: &LinearisedBasis, hypothesis: &Hypothesis| {
                    let problem = Problem::new(&motion, basis, &blocks, self.per_record);
                    let problem = if holds { problem.holding() } else { problem };
                    problem.fit_linear(hypothesis).map_err(|e| self.stage(e))
                };
                let followed = followed(plane, &moving, solve, solve)?;
                let (there, fit) = followed.ok_or_else(|| FitError::Unsolvable { record: self.train.name() })?;
                (BasisOf::Linearised(Box::new(there)), fit)
            }
            other => (other.clone(), fit),
        };
        // Its reach is that of the motion, not of the sensor.
        let mut extended = to_model(self.train, &motion, &basis, &fit, self.model.seed);
        extended.effects.drift = hypothesis.effects.drift;
        extended.effects.interference = hypothesis.effects.interference;
        extended.between_samples = self.model.between_samples;
        if extended.base == self.model.base {
            // What is known of an operator that stays as it is stays known.
            let of_operator = format!("{}.", self.model.base.kind().name());
            let own = |name: &&String| name.starts_with(&of_operator);
            let errors = self.model.std_errors.iter().filter(|(name, _)| own(name));
            extended.std_errors = errors.map(|(name, error)| (name.clone(), *error)).collect();
            extended.undetermined = self.model.undetermined.iter().filter(own).cloned().collect();
        }
        extended.std_errors.extend(errors.clone());
        Ok(extended)
    }

    /// Whether it errs less `after` than `before`, over the rows that count for the search: a model that misses a stop, say, takes
    /// the rows on it for a start-up. Or over those that it was fitted to itself: what an unknown start hides from it says nothing of the rest.
    /// In any case it may not err more, by [`RMSE_TOLERANCE`], over the rows that are a start-up for neither, nor by [`LARGE_RATIO`] over all that the
    /// sensor shows.
    pub(super) fn is_helped(&self, before: &Simulation, after: &Simulation) -> bool {
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

    /// Whether the own base predicts experiments that it was not fitted to at least as well with these effects as without: a model that does
    /// worse there is not handed out.
    pub(super) fn transfers(&self, start: &Hypothesis, found: &Hypothesis) -> Result<bool, FitError> {
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).holding();
        // A wandering is no part of the model; the amplifier is the same for both.
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

    /// The record with what an amplifier makes of its drive that follows no steeper slope than this \[V/s\].
    pub(super) fn amplified(&self, v_per_s: f64) -> Record {
        let mut drive = self.train.input().to_vec();
        limit_slope(&mut drive, self.samples, v_per_s);
        self.train.driven_by(drive)
    }
}
