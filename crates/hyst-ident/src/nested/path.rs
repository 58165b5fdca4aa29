//! The stages around the hysteresis, over whole columns.

use hyst_core::{
    Build, Creep, Delay, Env, Error, Invert, Lag, Resonance, Sampling, Saturation, SaturationInverse, Stage,
};

use super::Hypothesis;
use crate::Samples;
use crate::model::capacity::{CREEP, DELAY};

/// What leads to the hysteresis and what follows it, for one set of causes.
pub(crate) struct SignalPath<'a> {
    samples: &'a Samples,
    delay: Option<Delay<f64, DELAY>>,
    lag: Option<Lag<f64>>,
    factor: Option<Vec<f64>>,
    creep: Option<Creep<f64, CREEP>>,
    resonances: Vec<Resonance<f64>>,
    stop: Option<Stop>,
}

/// A stop of the motion, both ways.
struct Stop {
    forward: Saturation<f64>,
    inverse: SaturationInverse<f64>,
    /// Step of its difference quotients.
    step: f64,
}

impl<'a> SignalPath<'a> {
    pub(crate) fn new(samples: &'a Samples, h: &Hypothesis) -> Result<Self, Error> {
        let cx = Sampling { period: samples.period };
        let effects = &h.effects;
        let factor = match (&effects.temperature, &samples.temperature) {
            (Some(p), Some(t)) => Some(t.iter().map(|t| 1.0 + p.per_kelvin * (t - p.reference_degc)).collect()),
            _ => None,
        };
        let stop = effects.saturation.as_ref().map(|p| {
            let forward: Saturation<f64> = p.build(&())?;
            Ok(Stop { forward, inverse: forward.invert()?, step: 1e-6 * (p.high - p.low) })
        });
        Ok(Self {
            samples,
            delay: effects.delay.as_ref().map(|p| p.build(&cx)).transpose()?,
            lag: effects.lag.as_ref().map(|p| p.build(&cx)).transpose()?,
            factor,
            creep: effects.creep.as_ref().map(|p| p.build(&cx)).transpose()?,
            resonances: effects.resonances.iter().map(|p| p.build(&cx)).collect::<Result<_, _>>()?,
            stop: stop.transpose()?,
        })
    }

    /// What the hysteresis is driven with.
    pub(crate) fn input_side(&self) -> Vec<f64> {
        let mut drive = self.samples.input.clone();
        self.filter(&self.delay, &mut drive);
        self.filter(&self.lag, &mut drive);
        drive
    }

    /// Carries what the hysteresis gives on to the stop, in place.
    pub(crate) fn output_side(&self, v: &mut [f64]) {
        if let Some(factor) = &self.factor {
            v.iter_mut().zip(factor).for_each(|(v, f)| *v *= f);
        }
        self.filter(&self.creep, v);
        self.structure(v);
    }

    /// Carries a deflection through the modes, in place.
    pub(crate) fn structure(&self, v: &mut [f64]) {
        for mode in &self.resonances {
            self.filter(&Some(*mode), v);
        }
    }

    /// Where the motion is stopped, and by how much the output there follows it: value and slope.
    pub(crate) fn stopped(&self, motion: f64) -> (f64, f64) {
        let Some(Stop { forward, step, .. }) = &self.stop else { return (motion, 1.0) };
        let at = |m: f64| forward.step(&mut (), &Env::default(), m);
        (at(motion), (at(motion + step) - at(motion - step)) / (2.0 * step))
    }

    /// The motion that would show this output without the stop; beyond its end, the end.
    pub(crate) fn unstopped(&self, output: f64) -> f64 {
        self.stop.as_ref().map_or(output, |s| s.inverse.step(&mut (), &Env::default(), output))
    }

    fn filter<G: Stage<f64>>(&self, stage: &Option<G>, x: &mut [f64]) {
        let Some(stage) = stage else { return };
        let env = Env::default();
        let mut state = stage.state();
        for segment in &self.samples.segments {
            let mut rows = x[segment.clone()].iter_mut();
            if let Some(first) = rows.next() {
                *first = stage.reset(&mut state, &env, *first);
            }
            for v in rows {
                *v = stage.step(&mut state, &env, *v);
            }
        }
    }
}
