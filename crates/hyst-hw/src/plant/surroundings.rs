//! The influences on the actuator other than its drive, as functions of the lab time.

use super::config::{Disturbance, PlantConfig};
use super::load::AppliedLoad;
use super::temperature::Climate;

/// Temperature, load and steps of the gain, if any.
#[derive(Debug, Clone, Default)]
pub(crate) struct Surroundings {
    climate: Option<Climate>,
    load: Option<AppliedLoad>,
    /// Relative changes of the gain, and their times (s).
    gain_steps: Vec<(f64, f64)>,
}

impl Surroundings {
    pub(crate) fn new(config: &PlantConfig) -> Self {
        let noise = config.noise();
        Self {
            climate: config.temperature.as_ref().map(|t| Climate::new(config.seed, t).with_noise(noise)),
            load: config.load.as_ref().map(|load| AppliedLoad::new(config.seed, load).with_noise(noise)),
            gain_steps: config
                .disturbances
                .iter()
                .filter_map(|disturbance| match disturbance {
                    Disturbance::GainStep { share, at_s } => Some((*share, *at_s)),
                    _ => None,
                })
                .collect(),
        }
    }

    /// Returns the temperature's factor on the displacement at lab time `t`.
    pub(crate) fn factor(&self, t: f64) -> f64 {
        self.climate.as_ref().map_or(1.0, |climate| climate.factor(t))
    }

    /// Returns the factor of all steps of the gain up to lab time `t`.
    pub(crate) fn gain(&self, t: f64) -> f64 {
        self.gain_steps.iter().filter(|(_, at_s)| t >= *at_s).fold(1.0, |gain, (share, _)| gain * (1.0 + share))
    }

    /// Returns the displacement by the load at lab time `t` (µm).
    pub(crate) fn deflection(&self, t: f64) -> f64 {
        self.load.as_ref().map_or(0.0, |load| load.deflection(t))
    }

    /// Returns the measured temperature (°C) and load (N) at lab time `t`.
    pub(crate) fn measure(&mut self, t: f64) -> (Option<f64>, Option<f64>) {
        let temperature = self.climate.as_mut().and_then(|climate| climate.measure(t));
        (temperature, self.load.as_mut().and_then(|load| load.measure(t)))
    }

    /// Returns whether samples contain a temperature, and whether they contain a load.
    pub(crate) fn recorded(&self) -> (bool, bool) {
        let temperature = self.climate.as_ref().is_some_and(Climate::is_recorded);
        (temperature, self.load.as_ref().is_some_and(AppliedLoad::is_recorded))
    }
}
