//! Group score tests: which causes are worth a fit.
//!
//! To first order a cause adds some columns to the output. The part of them that a fit cannot imitate determines by how
//! much they would lower Σ residual²; this takes linear algebra only. A cause with a very small gain is not fitted,
//! because refining its parameters cannot raise the gain enough.

use hyst_core::{DelayParams, Error, LagParams, TemperatureParams};

use super::trial_parameters::{PER_DECADE, bank, starting_temperature, stops};
use crate::model::{Effect, Effects, Widening};
use crate::nested::{Cause, Fitted, HATS, Hypothesis, Prober, Problem, SignalPath, hat, initial};
use crate::statistics::range;

/// Minimum first-order gain of a cause, as a share of the gain that an effect needs.
const MIN_GAIN_SHARE: f64 = 0.05;
/// Depths of the saturation limit that are tried, as shares of the stroke.
const SATURATION_DEPTHS: [f64; 3] = [0.01, 0.04, 0.15];

/// A fit, prepared for testing further columns.
pub(super) struct Scan<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) from: &'a Fitted,
    pub(super) residual: Vec<f64>,
    pub(super) motion: Vec<f64>,
    pub(super) prober: Prober<'a>,
    /// Required gain in Σ residual².
    pub(super) least_gain: f64,
    pub(super) promising: f64,
}

impl<'a> Scan<'a> {
    /// Prepares a fit to which a cause with a gain of at least `least` (Σ residual²) is to be added.
    pub(super) fn new(problem: &'a Problem<'a>, from: &'a Fitted, least: f64) -> Result<Self, Error> {
        Ok(Self {
            residual: problem.residual(from)?,
            motion: problem.motion(&from.hypothesis, &from.solution)?,
            prober: Prober::new(problem, from)?,
            least_gain: least,
            promising: MIN_GAIN_SHARE * least,
            problem,
            from,
        })
    }

    /// Returns the gain of a column and its best factor, if the gain is promising and the factor positive.
    pub(super) fn gain(&self, column: &[f64]) -> Option<(f64, f64)> {
        let (gain, amplitude) = self.prober.projector.gain(column, &self.residual);
        (amplitude > 0.0 && gain >= self.promising).then_some((gain, amplitude))
    }

    /// Returns Σ squares of the part of a column that the fit cannot imitate.
    pub(super) fn left(&self, column: &[f64]) -> f64 {
        self.prober.projector.unexplained(column)
    }

    /// Returns the change of the motion with another hypothesis.
    pub(super) fn moved(&self, h: &Hypothesis) -> Result<Vec<f64>, Error> {
        let mut moved = self.problem.motion(h, &self.from.solution)?;
        moved.iter_mut().zip(&self.motion).for_each(|(a, b)| *a -= b);
        Ok(moved)
    }

    /// Returns the joint gain of the play operators of a widening.
    pub(super) fn gain_of_widening(&self, widening: &Widening) -> Result<f64, Error> {
        let mut h = self.from.hypothesis.clone();
        h.effects.widening = Some(widening.clone());
        let path = SignalPath::new(self.problem.samples, &h)?;
        let mut columns = path.widening().to_vec();
        path.output_side_of(&mut columns);
        Ok(self.prober.projector.joint_gain(&columns, &self.residual))
    }

    /// Returns the change of the motion by stages behind it.
    pub(super) fn behind(&self, effects: Effects) -> Result<Vec<f64>, Error> {
        let mut moved = self.motion.clone();
        SignalPath::new(self.problem.samples, &Hypothesis::of(effects))?.output_side(&mut moved);
        moved.iter_mut().zip(&self.motion).for_each(|(a, b)| *a -= b);
        Ok(moved)
    }

    /// Returns a course times the drive, row by row.
    fn times_drive(&self, course: &[f64]) -> Vec<f64> {
        course.iter().zip(&self.problem.samples.input).map(|(x, u)| x * u).collect()
    }

    /// Returns whether a cause would gain enough to be worth a fit. Causes whose start is searched first (mode, slew
    /// limit, rate-dependence, tone) are tested there.
    pub(super) fn is_promising(&self, cause: Cause) -> Result<bool, Error> {
        let columns = match cause {
            Cause::Effect(effect) => self.columns(effect)?,
            Cause::ZeroWanders => Some(self.hats(&|_| 1.0)),
            Cause::GainWanders => Some(self.hats(&|k| self.motion[k])),
            Cause::InitialState => {
                let h = Hypothesis { initial_state: true, ..self.from.hypothesis.clone() };
                Some(initial::columns(self.problem.samples, &h))
            }
            Cause::SlewLimit => None,
        };
        // Of either sign: a fit may start with the other one.
        let takes = |columns: &[Vec<f64>]| self.prober.projector.joint_gain(columns, &self.residual);
        Ok(columns.is_none_or(|columns| !columns.is_empty() && takes(&columns) >= self.promising))
    }

    /// Returns the first-order columns of an effect; `None` if its start is searched first.
    fn columns(&self, effect: Effect) -> Result<Option<Vec<Vec<f64>>>, Error> {
        let s = self.problem.samples;
        let with = |change: &dyn Fn(&mut Effects)| {
            let mut h = self.from.hypothesis.clone();
            change(&mut h.effects);
            self.moved(&h)
        };
        let whole = s.time[s.len() - 1] - s.time[0];
        Ok(Some(match effect {
            Effect::Delay => vec![with(&|e| e.delay = Some(DelayParams { seconds: s.period }))?],
            Effect::Lag => vec![with(&|e| e.lag = Some(LagParams { seconds: s.period }))?],
            Effect::Temperature => {
                let reference_degc = starting_temperature(s);
                let gain = TemperatureParams { per_kelvin: 1e-3, reference_degc, ..TemperatureParams::default() };
                let kelvin: Vec<f64> = s.temperature.iter().flatten().map(|t| t - reference_degc).collect();
                let late = TemperatureParams { seconds: 0.15 * whole, ..gain };
                let of = |p| self.behind(Effects { temperature: Some(p), ..Effects::default() });
                vec![of(gain)?, of(late)?, self.times_drive(&kelvin), kelvin]
            }
            Effect::Creep => {
                // Each element separately: the search may use any of them.
                let all = bank(s, self.problem.only_loop, 0.01 / PER_DECADE);
                let one = |i: usize| {
                    let shares = (0..all.shares.len()).map(|j| if i == j { all.shares[j] } else { 0.0 }).collect();
                    let creep = Some(hyst_core::CreepParams { shares, seconds: all.seconds.clone() });
                    self.behind(Effects { creep, ..Effects::default() })
                };
                (0..all.shares.len()).step_by(2).map(one).collect::<Result<_, _>>()?
            }
            Effect::Load => {
                let gain = |load: &Vec<f64>| load.iter().zip(&self.motion).map(|(f, m)| f * m).collect();
                s.load.iter().flat_map(|load| [load.clone(), gain(load)]).collect()
            }
            Effect::Drift => {
                let passed = |t: &f64| (t - s.time[0]) / whole;
                let settles = |times: f64| s.time.iter().map(|t| 1.0 - (-times * passed(t)).exp()).collect();
                vec![s.time.iter().map(passed).collect(), settles(4.0), settles(16.0)]
            }
            Effect::Saturation => {
                let (low, high) = range(self.motion.iter().copied());
                let beyond = |share: f64| {
                    let depth = share * (high - low);
                    let upper = self.motion.iter().map(|m| (high - depth - m).min(0.0)).collect();
                    let lower = self.motion.iter().map(|m| (low + depth - m).max(0.0)).collect();
                    [upper, lower]
                };
                if stops(s, self.from).is_none() {
                    Vec::new()
                } else {
                    SATURATION_DEPTHS.into_iter().flat_map(beyond).collect()
                }
            }
            Effect::RateDependence | Effect::Resonance | Effect::Interference | Effect::Asymmetry => return Ok(None),
        }))
    }

    /// Returns the hat functions of a wander over the record.
    fn hats(&self, of: &dyn Fn(usize) -> f64) -> Vec<Vec<f64>> {
        let rows = self.problem.samples.len();
        let share = |k: usize| k as f64 / rows.max(2) as f64;
        (0..HATS).map(|j| (0..rows).map(|k| hat(j, share(k)) * of(k)).collect()).collect()
    }
}
