//! A simulated actuator with its amplifier and sensor, as a [`Daq`].
//!
//! The plant is made to be identified, so it shares no equation and no discretisation with models
//! of hysteresis that are fitted to records: relays with random thresholds, and differential
//! equations integrated on a grid finer than the samples.

mod chain;
pub(crate) mod config;
mod creep;
pub(crate) mod error;
mod input;
mod random;
mod relays;
mod rng;
mod sensor;
mod structure;
mod temperature;
mod validate;
mod viscous;

use crate::daq::{Capabilities, Daq, OutputUnit, Sample, VoltageRange};
use chain::Chain;
use config::PlantConfig;
use error::PlantError;
use relays::Hysteresis;
use sensor::PositionSensor;
use temperature::Climate;

/// Names of the effects that a plant can have, in the order of the chain.
pub const EFFECTS: [&str; 7] = ["delay", "lag", "temperature", "creep", "resonance", "drift", "interference"];

/// A simulated actuator with amplifier, sensor and lab clock.
///
/// The plant depends on its description alone: the same description gives the same samples to the
/// last bit, whatever the block size. The lab's clock starts at 0, goes on in segments and rests and
/// stands while the plant is stopped. [`start`](Daq::start) finds the device in the virgin state at the
/// rest voltage; [`rest`](Daq::rest) and [`stop`](Daq::stop) bring it back there at once.
#[derive(Debug, Clone)]
pub struct Plant {
    config: PlantConfig,
    capabilities: Capabilities,
    hysteresis: Hysteresis,
    climate: Option<Climate>,
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
    /// Lab time at which the segment began (s).
    begin_s: f64,
    /// Samples since then: time is counted, not summed up, so it stays even.
    samples: u64,
}

impl Plant {
    /// Builds the plant, stopped and at rest.
    ///
    /// # Errors
    /// When the description is not valid.
    pub fn new(config: PlantConfig) -> Result<Self, PlantError> {
        config.validate()?;
        let hysteresis = Hysteresis::new(config.seed, &config.actuator, config.viscosity.as_ref())?;
        let climate = config.temperature.as_ref().map(|t| Climate::new(config.seed, t));
        let actuator = &config.actuator;
        let capabilities = Capabilities {
            device: format!("simulated plant, seed {}", config.seed),
            voltage: VoltageRange { min_v: actuator.min_v, max_v: actuator.max_v, rest_v: actuator.rest_v },
            min_rate_hz: 1.0,
            max_rate_hz: config.sensor.max_rate_hz,
            max_block: 4096,
            output: OutputUnit::Micrometre,
            temperature: climate.as_ref().is_some_and(Climate::is_recorded),
            load: false,
        };
        Ok(Self {
            capabilities,
            hysteresis,
            climate,
            sensor: PositionSensor::new(&config),
            stream: None,
            lab_time_s: 0.0,
            present_v: config.actuator.rest_v,
            config,
        })
    }

    /// The description that the plant was built from.
    #[must_use]
    pub fn config(&self) -> &PlantConfig {
        &self.config
    }

    /// Time on the lab's clock (s).
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
        let chain = Chain::new(&self.config, self.hysteresis.clone(), rate_hz);
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
            let position = stream.chain.advance(volts, self.climate.as_ref(), self.lab_time_s, time_s);
            self.lab_time_s = time_s;
            self.present_v = volts;
            let temperature_degc = self.climate.as_mut().and_then(|climate| climate.measure(time_s));
            let output =
                self.sensor.read(position, time_s).map_err(|value_um| PlantError::SensorRange { time_s, value_um })?;
            measured.push(Sample { time_s, drive_v: volts, output, temperature_degc, load_n: None });
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
            stream.chain.reset();
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

#[cfg(test)]
mod tests {
    use super::*;
    use config::tests::clean;

    fn everything() -> PlantConfig {
        PlantConfig::random_with(5, &EFFECTS).unwrap()
    }

    fn triangle(n: usize, top: f64) -> Vec<f64> {
        (0..n).map(|k| top * (1.0 - (1.0 - (k % 400) as f64 / 200.0).abs())).collect()
    }

    fn play(plant: &mut Plant, drive: &[f64], block: usize) -> Vec<Sample> {
        let mut samples = Vec::new();
        for part in drive.chunks(block) {
            assert_eq!(plant.exchange(part, &mut samples).unwrap(), part.len());
        }
        samples
    }

    #[test]
    fn same_seed_same_bits_in_any_block_size() {
        let drive = triangle(1500, everything().actuator.max_v);
        let run = |block| {
            let mut plant = Plant::new(everything()).unwrap();
            plant.start(1000.0).unwrap();
            let mut samples = play(&mut plant, &drive, block);
            plant.rest(2.5).unwrap();
            samples.extend(play(&mut plant, &drive[..300], block));
            samples
        };
        let whole = run(1000);
        assert_eq!(whole, run(1));
        assert_eq!(whole, run(7));
        assert!(whole.iter().all(|s| s.temperature_degc.is_some() && s.load_n.is_none()));
        let other = Plant::new(PlantConfig { seed: 6, ..everything() }).map(|mut plant| {
            plant.start(1000.0).unwrap();
            play(&mut plant, &drive, 100)
        });
        assert_ne!(other.unwrap(), whole[..1500]);
    }

    #[test]
    fn samples_are_pinned() {
        // A change here changes every simulated record of every user: it needs a very good reason.
        let mut plant = Plant::new(everything()).unwrap();
        plant.start(1000.0).unwrap();
        let samples = play(&mut plant, &triangle(700, 100.0), 700);
        let bits = samples.iter().flat_map(|s| [s.output, s.temperature_degc.unwrap()]).map(f64::to_bits);
        let digest = bits.fold(0, |sum: u64, word| sum.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ word);
        assert_eq!(digest, 15_705_684_028_673_275_075);
    }

    #[test]
    fn clock_goes_on_while_the_device_becomes_virgin_again() {
        let mut config = clean();
        config.actuator.loop_share = 0.13;
        config.lag = Some(config::Lag { seconds: 0.004 });
        config.creep =
            Some(config::Creep { strength: 0.1, tau_min_s: 0.05, tau_max_s: 5.0, exponent: 0.0, elements: 20 });
        config.modes = vec![config::Mode { hz: 60.0, damping: 0.01, gain: 0.9 }];
        let mut plant = Plant::new(config).unwrap();
        plant.start(500.0).unwrap();
        let drive = triangle(700, 100.0);
        let first = play(&mut plant, &drive, 64);
        plant.rest(10.0).unwrap();
        assert_eq!(plant.present_v(), 0.0);
        let second = play(&mut plant, &drive, 64);
        assert!(first.iter().zip(&second).all(|(a, b)| a.output == b.output));
        assert!((first[0].time_s - 0.002).abs() < 1e-15);
        assert!((second[0].time_s - (1.4 + 10.0 + 0.002)).abs() < 1e-12);
        plant.stop().unwrap();
        plant.start(500.0).unwrap();
        let third = play(&mut plant, &drive, 64);
        assert!(first.iter().zip(&third).all(|(a, b)| a.output == b.output));
        assert!((third[0].time_s - second[699].time_s - 0.002).abs() < 1e-12);
    }

    #[test]
    fn refused_drive_changes_nothing() {
        let drive = triangle(300, everything().actuator.max_v);
        let mut plant = Plant::new(everything()).unwrap();
        let mut calm = plant.clone();
        let mut none = Vec::new();
        assert_eq!(plant.exchange(&[0.0], &mut none), Err(PlantError::NotRunning));
        plant.start(1000.0).unwrap();
        calm.start(1000.0).unwrap();
        let mut samples = play(&mut plant, &drive[..100], 50);
        let top = plant.capabilities().voltage.max_v;
        let refused = plant.exchange(&[1.0, 2.0, top + 0.001, 3.0], &mut none);
        assert!(matches!(refused, Err(PlantError::OutOfRange { index: 2, .. })), "{refused:?}");
        let refused = plant.exchange(&[1.0, f64::NAN], &mut none);
        assert!(matches!(refused, Err(PlantError::NonFinite { index: 1, .. })), "{refused:?}");
        assert!(matches!(plant.rest(-1.0), Err(PlantError::Rest { .. })));
        assert_eq!(plant.start(10.0), Err(PlantError::Running));
        assert!(none.is_empty());
        samples.extend(play(&mut plant, &drive[100..], 50));
        assert_eq!(samples, play(&mut calm, &drive, 300));
    }

    #[test]
    fn rates_outside_the_capabilities_are_refused() {
        let mut plant = Plant::new(clean()).unwrap();
        for rate in [0.0, -5.0, 0.5, 1e9, f64::NAN] {
            assert!(matches!(plant.start(rate), Err(PlantError::Rate { .. })), "{rate}");
        }
        assert_eq!(plant.start(20_000.0), Ok(20_000.0));
    }

    #[test]
    fn delay_shifts_the_record_by_whole_samples() {
        let mut config = clean();
        config.actuator.loop_share = 0.12;
        let drive = triangle(900, 90.0);
        let mut prompt = Plant::new(config.clone()).unwrap();
        config.delay = Some(config::Delay { seconds: 0.003 });
        let mut late = Plant::new(config).unwrap();
        prompt.start(1000.0).unwrap();
        late.start(1000.0).unwrap();
        let (prompt, late) = (play(&mut prompt, &drive, 900), play(&mut late, &drive, 900));
        assert!(late[..3].iter().all(|s| s.output.abs() < 1e-9));
        for (a, b) in prompt.iter().zip(&late[3..]) {
            assert_eq!(a.output, b.output);
        }
    }

    #[test]
    fn temperature_scales_the_displacement() {
        let mut config = clean();
        config.temperature = Some(config::Temperature {
            per_k: 0.01,
            reference_degc: 20.0,
            mean_degc: 25.0,
            swing_k: 0.0,
            period_s: None,
            shape: config::TemperatureShape::Sine,
            recorded: false,
            noise_k: 0.0,
        });
        let mut plant = Plant::new(config).unwrap();
        assert!(!plant.capabilities().temperature);
        plant.start(100.0).unwrap();
        let samples = play(&mut plant, &[50.0], 1);
        assert!((samples[0].output - 5.0 * 1.05).abs() < 1e-9);
        assert_eq!(samples[0].temperature_degc, None);
    }

    #[test]
    fn displacement_beyond_the_converter_is_an_error() {
        let mut config = clean();
        config.sensor.range_um = [-1.0, 5.0];
        let mut plant = Plant::new(config).unwrap();
        plant.start(100.0).unwrap();
        let mut samples = Vec::new();
        let error = plant.exchange(&[10.0, 80.0], &mut samples).unwrap_err();
        assert!(error.to_string().contains("sensor.range_um"), "{error}");
        // What was measured before is kept.
        assert_eq!(samples.len(), 1);
    }
}
