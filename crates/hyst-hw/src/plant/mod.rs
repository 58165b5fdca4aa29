//! A simulated actuator with its amplifier and sensor, with the interface [`Daq`].
//!
//! The plant is a test object for identification. It shares no equation and no discretisation with the models that are
//! fitted to its records: it has relays with random thresholds, and differential equations that are integrated on a
//! grid finer than the samples. The alternative bed consists of play operators, like Prandtl-Ishlinskii models. It has
//! a thousand or more of them, with random thresholds and weights.

mod asymmetry;
mod chain;
pub(crate) mod config;
mod creep;
mod disturbance;
mod disturbed;
mod effects;
pub(crate) mod error;
mod file;
mod hysteresis;
mod input;
mod load;
mod plays;
mod random;
mod relays;
mod rng;
mod saturation;
mod sensor;
mod structure;
mod surroundings;
mod temperature;
#[cfg(test)]
mod tests;
mod validate;
mod viscous;
mod viscous_plays;
mod waves;

use crate::daq::{Capabilities, Daq, OutputUnit, Sample, VoltageRange};
use chain::Chain;
use config::PlantConfig;
use disturbance::Disturbances;
use error::PlantError;
use hysteresis::Hysteresis;
use sensor::PositionSensor;
use surroundings::Surroundings;

pub use effects::{DISTURBANCES, EFFECTS};

/// A simulated actuator with amplifier, sensor and lab clock.
///
/// The same description gives the same samples, bit by bit, for every block size. The lab clock starts at 0.
/// It runs during segments and rests, and is halted while the plant is stopped. [`start`](Daq::start) begins in the
/// virgin state at the rest voltage; [`rest`](Daq::rest) and [`stop`](Daq::stop) return to this state at once.
#[derive(Debug, Clone)]
pub struct Plant {
    config: PlantConfig,
    capabilities: Capabilities,
    hysteresis: Hysteresis,
    surroundings: Surroundings,
    disturbances: Disturbances,
    sensor: PositionSensor,
    stream: Option<Stream>,
    lab_time_s: f64,
    present_v: f64,
}

/// A running sample clock.
#[derive(Debug, Clone)]
struct Stream {
    chain: Chain,
    rate_hz: f64,
    /// Lab time at the begin of the segment (s).
    begin_s: f64,
    /// Samples since then. The time is computed from this count, so rounding errors do not add up.
    samples: u64,
}

impl Plant {
    /// Builds the plant, stopped and at rest.
    ///
    /// # Errors
    /// If the description is not valid.
    pub fn new(config: PlantConfig) -> Result<Self, PlantError> {
        config.validate()?;
        let hysteresis = Hysteresis::new(config.seed, &config.actuator, config.viscosity.as_ref())?;
        let surroundings = Surroundings::new(&config);
        let (temperature, load) = surroundings.recorded();
        let actuator = &config.actuator;
        let capabilities = Capabilities {
            device: match config.noise_seed {
                None => format!("simulated plant, seed {}", config.seed),
                Some(noise) => format!("simulated plant, seed {}, noise of seed {noise}", config.seed),
            },
            voltage: VoltageRange { min_v: actuator.min_v, max_v: actuator.max_v, rest_v: actuator.rest_v },
            max_slew_v_per_s: f64::INFINITY,
            min_rate_hz: 1.0,
            max_rate_hz: config.sensor.max_rate_hz,
            max_block: 4096,
            output: OutputUnit::Micrometre,
            temperature,
            load,
            queued: false,
        };
        Ok(Self {
            capabilities,
            hysteresis,
            surroundings,
            disturbances: Disturbances::new(&config),
            sensor: PositionSensor::new(&config),
            stream: None,
            lab_time_s: 0.0,
            present_v: config.actuator.rest_v,
            config,
        })
    }

    /// Returns the description of the plant.
    #[must_use]
    pub fn config(&self) -> &PlantConfig {
        &self.config
    }

    /// Returns the time of the lab clock (s).
    #[must_use]
    pub fn lab_time_s(&self) -> f64 {
        self.lab_time_s
    }

    fn check(&self, drive_v: &[f64]) -> Result<(), PlantError> {
        let range = self.capabilities.voltage;
        match drive_v.iter().enumerate().find(|(_, volts)| !range.contains(**volts)) {
            None => Ok(()),
            Some((index, &volts)) if !volts.is_finite() => Err(PlantError::NonFinite { index, volts }),
            Some((index, &volts)) => {
                Err(PlantError::OutOfRange { index, volts, min_v: range.min_v, max_v: range.max_v })
            }
        }
    }
}

impl Daq for Plant {
    type Error = PlantError;

    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn present_v(&self) -> f64 {
        self.present_v
    }

    fn start(&mut self, rate_hz: f64) -> Result<f64, PlantError> {
        if self.stream.is_some() {
            return Err(PlantError::Running);
        }
        let (min_hz, max_hz) = (self.capabilities.min_rate_hz, self.capabilities.max_rate_hz);
        if !(min_hz..=max_hz).contains(&rate_hz) {
            return Err(PlantError::Rate { asked_hz: rate_hz, min_hz, max_hz });
        }
        let mut chain = Chain::new(&self.config, self.hysteresis.clone(), rate_hz);
        chain.rest_at(&self.surroundings, self.lab_time_s);
        self.stream = Some(Stream { chain, rate_hz, begin_s: self.lab_time_s, samples: 0 });
        Ok(rate_hz)
    }

    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, PlantError> {
        self.check(drive_v)?;
        let stream = self.stream.as_mut().ok_or(PlantError::NotRunning)?;
        measured.reserve(drive_v.len());
        for &volts in drive_v {
            stream.samples += 1;
            let time_s = stream.begin_s + stream.samples as f64 / stream.rate_hz;
            let position = stream.chain.advance(volts, &self.surroundings, self.lab_time_s, time_s);
            let disturbed = position + self.disturbances.advance(time_s, self.present_v, volts);
            self.lab_time_s = time_s;
            self.present_v = volts;
            let (temperature_degc, load_n) = self.surroundings.measure(time_s);
            let output =
                self.sensor.read(disturbed, time_s).map_err(|value_um| PlantError::SensorRange { time_s, value_um })?;
            measured.push(Sample { time_s, drive_v: volts, output, temperature_degc, load_n, force_n: None });
        }
        Ok(drive_v.len())
    }

    fn rest(&mut self, seconds: f64) -> Result<(), PlantError> {
        if !(seconds.is_finite() && seconds >= 0.0) {
            return Err(PlantError::Rest { seconds });
        }
        self.lab_time_s += seconds;
        self.present_v = self.capabilities.voltage.rest_v;
        if let Some(stream) = &mut self.stream {
            stream.chain.rest_at(&self.surroundings, self.lab_time_s);
            stream.begin_s = self.lab_time_s;
            stream.samples = 0;
        }
        Ok(())
    }

    fn stop(&mut self) -> Result<(), PlantError> {
        self.stream = None;
        self.present_v = self.capabilities.voltage.rest_v;
        Ok(())
    }
}
