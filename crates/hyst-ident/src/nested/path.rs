//! The stages around the hysteresis, applied to whole columns.

use std::borrow::Cow;
use std::sync::OnceLock;

use hyst_core::{
    Asymmetry, Build, Creep, CurveSide, Delay, Env, Error, Invert, Lag, LoadParams, MAX_DEAD_ZONES, Rate, Resonance,
    Sampling, Saturation, SaturationInverse, Stage, Temperature, TemperatureParams, Widening,
};

use super::Hypothesis;
use crate::Samples;
use crate::base::SIDE_BY_SIDE;
use crate::model::InputSide;
use crate::model::capacity::{CREEP, DELAY};
use crate::samples::PerSegment;
use crate::widened;

/// The stages before and behind the hysteresis, for one hypothesis.
pub(crate) struct SignalPath<'a> {
    samples: &'a Samples,
    /// Slope limit of the amplifier \[V/s\].
    slew_limit: Option<f64>,
    /// Limits of the drive.
    rails: Option<Saturation<f64>>,
    delay: Option<PerSegment<Delay<f64, DELAY>>>,
    lag: Option<PerSegment<Lag<f64>>>,
    rate: Option<PerSegment<Rate<f64>>>,
    curve: Option<Asymmetry<f64, MAX_DEAD_ZONES>>,
    /// Drive of the hysteresis; computed on first use.
    drive: OnceLock<Vec<f64>>,
    widening: Option<PerSegment<Widening<f64>>>,
    /// Columns of the play operators of the widening, with weight one; computed on first use.
    widening_columns: OnceLock<Vec<Vec<f64>>>,
    thermal_state: Option<ThermalState>,
    creep: Option<PerSegment<Creep<f64, CREEP>>>,
    /// Factor of the gain under the load in each row, if the load changes it.
    load_factor: Option<Vec<f64>>,
    resonances: Vec<PerSegment<Resonance<f64>>>,
    stop: Option<Stop>,
}

/// Saturation of the motion and its inverse.
struct Stop {
    forward: Saturation<f64>,
    inverse: SaturationInverse<f64>,
    /// Step of the difference quotients.
    step: f64,
}

impl<'a> SignalPath<'a> {
    pub(crate) fn new(samples: &'a Samples, h: &Hypothesis) -> Result<Self, Error> {
        let effects = &h.effects;
        let InputSide { saturation, delay, lag, rate, curve } = effects.input_side();
        let thermal_state = effects.temperature.as_ref().map(|p| thermal_state(samples, p)).transpose()?;
        let stop = effects.limits(CurveSide::Output).map(|p| {
            let forward: Saturation<f64> = p.build(&())?;
            Ok(Stop { forward, inverse: forward.invert()?, step: 1e-6 * (p.high - p.low) })
        });
        Ok(Self {
            samples,
            slew_limit: h.slew_limit,
            rails: saturation.map(|p| p.build(&())).transpose()?,
            delay: delay.map(|p| for_each(samples, &p)).transpose()?,
            lag: lag.map(|p| for_each(samples, &p)).transpose()?,
            rate: rate.map(|p| for_each(samples, &p)).transpose()?,
            curve: curve.map(|p| p.build(&())).transpose()?,
            drive: OnceLock::new(),
            widening_columns: OnceLock::new(),
            widening: effects.widening.as_ref().map(|p| for_each(samples, p)).transpose()?,
            thermal_state: thermal_state.flatten(),
            load_factor: effects.load.and_then(|p| load_factor(samples, &p)),
            creep: effects.creep.as_ref().map(|p| for_each(samples, p)).transpose()?,
            resonances: effects.resonances.iter().map(|p| for_each(samples, p)).collect::<Result<_, _>>()?,
            stop: stop.transpose()?,
        })
    }

    /// Returns the drive of the hysteresis.
    pub(crate) fn input_side(&self) -> &[f64] {
        self.drive.get_or_init(|| self.computed_input_side())
    }

    fn computed_input_side(&self) -> Vec<f64> {
        let mut drive = self.samples.input.clone();
        if let Some(rails) = &self.rails {
            drive.iter_mut().for_each(|u| *u = rails.step(&mut (), &Env::default(), *u));
        }
        if let Some(v_per_s) = self.slew_limit {
            limit_slope(&mut drive, self.samples, v_per_s);
        }
        if let Some(delay) = &self.delay {
            self.filter(delay, &mut [&mut drive]);
        }
        if let Some(lag) = &self.lag {
            self.filter(lag, &mut [&mut drive]);
        }
        if let Some(rate) = &self.rate {
            self.filter(rate, &mut [&mut drive]);
        }
        if let Some(curve) = &self.curve {
            drive.iter_mut().for_each(|u| *u = curve.step(&mut (), &Env::default(), *u));
        }
        drive
    }

    /// Returns the drive history of the hysteresis before each segment. It is slow, so all stages before the hysteresis
    /// but limits and a curve pass it unchanged.
    pub(crate) fn pasts(&self) -> Cow<'a, [Vec<f64>]> {
        if self.rails.is_none() && self.curve.is_none() {
            return Cow::Borrowed(&self.samples.pasts);
        }
        let env = Env::default();
        let limited = |u: f64| self.rails.as_ref().map_or(u, |rails| rails.reset(&mut (), &env, u));
        let bent = |u: f64| self.curve.as_ref().map_or(u, |curve| curve.reset(&mut (), &env, u));
        let through = |past: &Vec<f64>| past.iter().map(|u| bent(limited(*u))).collect();
        Cow::Owned(self.samples.pasts.iter().map(through).collect())
    }

    /// Returns the output column of each play operator of the widening, with weight one; empty without a widening.
    pub(crate) fn widening(&self) -> &[Vec<f64>] {
        // Computed outside of the cell, because a thread that waits inside may execute another job that enters here
        // again.
        if self.widening_columns.get().is_none() {
            let _ = self.widening_columns.set(self.computed_widening());
        }
        self.widening_columns.get().map_or(&[], Vec::as_slice)
    }

    fn computed_widening(&self) -> Vec<Vec<f64>> {
        let Some(stages) = &self.widening else { return Vec::new() };
        let (drive, segments) = (self.input_side(), &self.samples.segments);
        let stage = |i| Some(stages.of(i));
        widened::columns(stages.of(0).plays(), stage, drive, segments, &self.pasts(), self.samples.falls)
    }

    /// Adds the widening with these weights.
    pub(super) fn widen(&self, operator: &mut [f64], weights: &[f64]) {
        for (column, w) in self.widening().iter().zip(weights) {
            operator.iter_mut().zip(column).for_each(|(v, x)| *v += w * x);
        }
    }

    /// Returns whether a stage behind the hysteresis has a memory. Otherwise
    /// [`output_side`](Self::output_side) multiplies each row by its [factors](Self::factors).
    pub(super) fn remembers_output(&self) -> bool {
        self.creep.is_some() || !self.resonances.is_empty()
    }

    /// Returns the factors of each row: those of the temperature, then those of the load.
    pub(super) fn factors(&self) -> impl Iterator<Item = &[f64]> {
        let thermal = self.thermal_state.as_ref().map(|state| state.factor.as_slice());
        thermal.into_iter().chain(self.load_factor.as_deref())
    }

    /// Passes the output of the hysteresis through the stages up to the saturation, in place.
    pub(crate) fn output_side(&self, v: &mut [f64]) {
        self.carry([v]);
    }

    /// Passes several columns through the stages.
    pub(crate) fn output_side_of(&self, columns: &mut [Vec<f64>]) {
        for columns in columns.chunks_mut(SIDE_BY_SIDE) {
            match columns {
                [a, b, c, d] => self.carry([a, b, c, d]),
                [a, b, c] => self.carry([a, b, c]),
                [a, b] => self.carry([a, b]),
                columns => columns.iter_mut().for_each(|v| self.carry([v])),
            }
        }
    }

    fn carry<const N: usize>(&self, mut columns: [&mut [f64]; N]) {
        if let Some(ThermalState { factor, .. }) = &self.thermal_state {
            for v in &mut columns {
                v.iter_mut().zip(factor).for_each(|(v, f)| *v *= f);
            }
        }
        self.behind_the_gain(&mut columns);
    }

    /// Passes columns through the stages behind the temperature.
    fn behind_the_gain<const N: usize>(&self, columns: &mut [&mut [f64]; N]) {
        if let Some(creep) = &self.creep {
            self.creep(creep, columns);
        }
        if let Some(factor) = &self.load_factor {
            for v in columns.iter_mut() {
                v.iter_mut().zip(factor).for_each(|(v, f)| *v *= f);
            }
        }
        self.modes(columns);
    }

    /// Returns the contribution of a thermal expansion of one unit per kelvin to the motion.
    pub(crate) fn expansion(&self) -> Option<Vec<f64>> {
        let mut shift = self.thermal_state.as_ref()?.kelvin.clone();
        self.behind_the_gain(&mut [&mut shift]);
        Some(shift)
    }

    /// Returns the contribution of a gain beside the hysteresis of one unit per kelvin to the motion.
    pub(crate) fn direct(&self) -> Option<Vec<f64>> {
        let kelvin = &self.thermal_state.as_ref()?.kelvin;
        let sign = if self.samples.falls { -1.0 } else { 1.0 };
        let mut beside: Vec<f64> = self.input_side().iter().zip(kelvin).map(|(u, kelvin)| sign * kelvin * u).collect();
        self.behind_the_gain(&mut [&mut beside]);
        Some(beside)
    }

    /// Passes a deflection through the modes, in place.
    pub(crate) fn structure(&self, v: &mut [f64]) {
        self.modes(&mut [v]);
    }

    fn modes<const N: usize>(&self, columns: &mut [&mut [f64]; N]) {
        self.resonances.iter().for_each(|mode| self.filter(mode, columns));
    }

    /// Returns the saturated output for a motion, and its slope.
    pub(crate) fn saturated(&self, motion: f64) -> (f64, f64) {
        let Some(Stop { forward, step, .. }) = &self.stop else { return (motion, 1.0) };
        let at = |m: f64| forward.step(&mut (), &Env::default(), m);
        (at(motion), (at(motion + step) - at(motion - step)) / (2.0 * step))
    }

    /// Returns the motion for a saturated output; outside of the limits, the limit.
    pub(crate) fn unsaturated(&self, output: f64) -> f64 {
        self.stop.as_ref().map_or(output, |s| s.inverse.step(&mut (), &Env::default(), output))
    }

    fn creep<const N: usize>(&self, creep: &PerSegment<Creep<f64, CREEP>>, columns: &mut [&mut [f64]; N]) {
        for (i, segment) in self.samples.segments.iter().enumerate().filter(|(_, s)| !s.is_empty()) {
            let creep = creep.of(i);
            let mut columns = columns.each_mut().map(|c| &mut c[segment.clone()]);
            let (mut state, first) = creep.reset_side_by_side(columns.each_ref().map(|c| c[0]));
            columns.iter_mut().zip(first).for_each(|(column, y)| column[0] = y);
            for k in 1..segment.len() {
                let y = creep.step_side_by_side(&mut state, columns.each_ref().map(|c| c[k]));
                columns.iter_mut().zip(y).for_each(|(column, y)| column[k] = y);
            }
        }
    }

    fn filter<G: Stage<f64>, const N: usize>(&self, stages: &PerSegment<G>, columns: &mut [&mut [f64]; N]) {
        let env = Env::default();
        let mut states: [G::State; N] = std::array::from_fn(|_| stages.of(0).state());
        for (i, segment) in self.samples.segments.iter().enumerate() {
            let stage = stages.of(i);
            let mut columns = columns.each_mut().map(|c| &mut c[segment.clone()]);
            for (state, column) in states.iter_mut().zip(&mut columns) {
                if let Some(first) = column.first_mut() {
                    *first = stage.reset(state, &env, *first);
                }
            }
            for k in 1..segment.len() {
                for (state, column) in states.iter_mut().zip(&mut columns) {
                    column[k] = stage.step(state, &env, column[k]);
                }
            }
        }
    }
}

/// Effect of the temperature in each row.
pub(crate) struct ThermalState {
    /// Gain factor.
    factor: Vec<f64>,
    /// Temperature of the actuator above the reference \[K\].
    pub(crate) kelvin: Vec<f64>,
}

/// Returns the effect of the temperature; `None` without a temperature column. Each segment starts in equilibrium at
/// its first temperature.
pub(crate) fn thermal_state(samples: &Samples, p: &TemperatureParams) -> Result<Option<ThermalState>, Error> {
    if samples.temperature.is_none() {
        return Ok(None);
    }
    let stages: PerSegment<Temperature<f64>> = for_each(samples, &TemperatureParams { expansion: 1.0, ..*p })?;
    let mut state = stages.of(0).state();
    let rows = samples.segments.iter().enumerate().flat_map(|(i, s)| s.clone().map(move |k| (i, k == s.start, k)));
    let thermal_state = rows.map(|(i, first, k)| match first {
        true => stages.of(i).reset_felt(&mut state, &samples.env(k)),
        false => stages.of(i).step_felt(&mut state, &samples.env(k)),
    });
    let (factor, kelvin) = thermal_state.unzip();
    Ok(Some(ThermalState { factor, kelvin }))
}

/// Returns the factor of the gain under the load in each row; `None` without a load column or without a change.
fn load_factor(samples: &Samples, p: &LoadParams) -> Option<Vec<f64>> {
    let load = samples.load.as_ref().filter(|_| p.gain_per_newton != 0.0)?;
    Some(load.iter().map(|newtons| 1.0 + p.gain_per_newton * newtons).collect())
}

/// Builds a stage for each segment.
fn for_each<S, P: Build<S, Context = Sampling>>(samples: &Samples, params: &P) -> Result<PerSegment<S>, Error> {
    PerSegment::new(samples, |period| params.build(&Sampling { period }))
}

/// Limits the slope of a drive to `v_per_s` \[V/s\], as an amplifier does that has rested at the first voltage of each
/// segment.
pub(crate) fn limit_slope(drive: &mut [f64], samples: &Samples, v_per_s: f64) {
    for (i, rows) in samples.segments.iter().enumerate() {
        let most = v_per_s * samples.period_of(i);
        let drive = &mut drive[rows.clone()];
        let Some(mut now) = drive.first().copied() else { continue };
        for u in drive {
            now += (*u - now).clamp(-most, most);
            *u = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Effects;
    use hyst_core::{CreepParams, ResonanceParams, WideningParams};

    /// The weighted play operators add up to the chain's stage, also after a drive history.
    #[test]
    fn a_widening_matches_the_stage_of_the_chain() {
        let input: Vec<f64> = (0..600).map(|k| 20.0 * (0.002 * f64::from(k * k) / 10.0).sin()).collect();
        let past = vec![35.0, -20.0];
        let samples = Samples {
            segments: vec![0..250, 250..600],
            file_of_segment: vec![0, 0],
            pasts: vec![past.clone(), Vec::new()],
            ..Samples::of_columns(1e-3, input.clone(), input.clone())
        };
        let widening = WideningParams {
            growth: 0.4,
            exponent: 0.5,
            reference_rate: 300.0,
            seconds: 4e-3,
            thresholds: vec![3.0, 8.0],
            weights: vec![0.02, 0.05],
        };
        let h = Hypothesis::of(Effects { widening: Some(widening.clone()), ..Effects::default() });
        let mut found = vec![0.0; input.len()];
        SignalPath::new(&samples, &h).unwrap().widen(&mut found, &widening.weights);
        let stage: Widening<f64> = widening.build(&Sampling { period: 1e-3 }).unwrap();
        let mut state = stage.state();
        for (k, u) in input.iter().enumerate() {
            let expected = match k {
                0 => {
                    past.iter().chain([u]).for_each(|u| stage.rest(&mut state, *u));
                    0.0
                }
                250 => stage.reset(&mut state, &Env::default(), *u),
                _ => stage.step(&mut state, &Env::default(), *u),
            };
            assert!((found[k] - expected).abs() < 1e-15, "row {k}: {} {expected}", found[k]);
        }
        assert!(found.iter().any(|y| y.abs() > 0.1 * widening.extra_half_width()));
    }

    #[test]
    fn columns_processed_together_equal_single_columns() {
        let rows = 500;
        let signal = |c: usize| (0..rows).map(|k| (0.05 * (c + 1) as f64 * k as f64).sin()).collect::<Vec<f64>>();
        let samples = Samples {
            temperature: Some((0..rows).map(|k| 23.0 + 0.01 * k as f64).collect()),
            segments: vec![0..1, 1..200, 200..rows],
            file_of_segment: vec![0, 0, 0],
            ..Samples::of_columns(1e-3, signal(0), signal(1))
        };
        let mode = |hz| ResonanceParams { hz, damping: 0.05, gain: 0.8 };
        let h = Hypothesis::of(Effects {
            temperature: Some(TemperatureParams {
                per_kelvin: 0.01,
                reference_degc: 23.0,
                seconds: 0.4,
                ..Default::default()
            }),
            creep: Some(CreepParams { seconds: vec![0.02, 0.3], shares: vec![0.05, 0.02] }),
            resonances: vec![mode(60.0), mode(140.0)],
            ..Effects::default()
        });
        let path = SignalPath::new(&samples, &h).unwrap();
        for count in 1..=9 {
            let mut together: Vec<Vec<f64>> = (0..count).map(signal).collect();
            path.output_side_of(&mut together);
            for (c, column) in together.iter().enumerate() {
                let mut alone = signal(c);
                path.output_side(&mut alone);
                assert_eq!(*column, alone, "column {c} of {count}");
                assert_ne!(alone, signal(c));
            }
        }
    }
}
