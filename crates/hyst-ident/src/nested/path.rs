//! The stages around the hysteresis, over whole columns.

use hyst_core::{Build, Creep, Delay, Env, Error, Lag, Resonance, Sampling, Stage};

use crate::Samples;
use crate::model::Effects;
use crate::model::capacity::{CREEP, DELAY};

/// What leads to the hysteresis and what follows it, for one set of effects.
pub(crate) struct SignalPath<'a> {
    samples: &'a Samples,
    delay: Option<Delay<f64, DELAY>>,
    lag: Option<Lag<f64>>,
    factor: Option<Vec<f64>>,
    creep: Option<Creep<f64, CREEP>>,
    resonances: Vec<Resonance<f64>>,
}

impl<'a> SignalPath<'a> {
    pub(crate) fn new(samples: &'a Samples, effects: &Effects) -> Result<Self, Error> {
        let cx = Sampling { period: samples.period };
        let factor = match (&effects.temperature, &samples.temperature) {
            (Some(p), Some(t)) => Some(t.iter().map(|t| 1.0 + p.per_kelvin * (t - p.reference_degc)).collect()),
            _ => None,
        };
        Ok(Self {
            samples,
            delay: effects.delay.as_ref().map(|p| p.build(&cx)).transpose()?,
            lag: effects.lag.as_ref().map(|p| p.build(&cx)).transpose()?,
            factor,
            creep: effects.creep.as_ref().map(|p| p.build(&cx)).transpose()?,
            resonances: effects.resonances.iter().map(|p| p.build(&cx)).collect::<Result<_, _>>()?,
        })
    }

    /// What the hysteresis is driven with.
    pub(crate) fn input_side(&self) -> Vec<f64> {
        let mut drive = self.samples.input.clone();
        self.filter(&self.delay, &mut drive);
        self.filter(&self.lag, &mut drive);
        drive
    }

    /// Carries what the hysteresis gives on to the sensor, in place.
    pub(crate) fn output_side(&self, v: &mut [f64]) {
        if let Some(factor) = &self.factor {
            v.iter_mut().zip(factor).for_each(|(v, f)| *v *= f);
        }
        self.filter(&self.creep, v);
        for mode in &self.resonances {
            self.filter(&Some(*mode), v);
        }
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
