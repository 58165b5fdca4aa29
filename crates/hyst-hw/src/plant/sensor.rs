//! The position sensor.

use std::f64::consts::TAU;

use super::config::PlantConfig;
use super::rng::{Draws, Purpose};

/// Zero, drift, interference, noise and converter of the position sensor.
#[derive(Debug, Clone)]
pub(crate) struct PositionSensor {
    offset: f64,
    drift_um_per_s: f64,
    /// Amplitude (µm), angular frequency (rad/s), phase (rad).
    wave: Option<(f64, f64, f64)>,
    noise: f64,
    draws: Draws,
    low: f64,
    quantum: f64,
    top_code: f64,
}

impl PositionSensor {
    pub(crate) fn new(config: &PlantConfig) -> Self {
        let sensor = &config.sensor;
        let [low, high] = sensor.range_um;
        let codes = (1_u64 << sensor.bits) as f64;
        Self {
            offset: sensor.offset_um,
            drift_um_per_s: config.drift.as_ref().map_or(0.0, |drift| drift.um_per_s),
            wave: config.interference.as_ref().map(|w| (w.amplitude_um, TAU * w.hz, w.phase_rad)),
            noise: sensor.noise_um,
            draws: Draws::new(config.noise(), Purpose::PositionNoise),
            low,
            quantum: (high - low) / codes,
            top_code: codes - 1.0,
        }
    }

    /// Returns the reading for the displacement `position` at lab time `t` (µm).
    ///
    /// # Errors
    /// The value, if it is outside the range of the converter.
    pub(crate) fn read(&mut self, position: f64, t: f64) -> Result<f64, f64> {
        let wave = self.wave.map_or(0.0, |(amplitude, w, phase)| amplitude * libm::sin(w * t + phase));
        // One draw per sample, so that effects do not change the noise.
        let noise = self.noise * self.draws.normal();
        let value = position + self.offset + self.drift_um_per_s * t + wave + noise;
        let code = ((value - self.low) / self.quantum).round();
        if (0.0..=self.top_code).contains(&code) { Ok(self.low + code * self.quantum) } else { Err(value) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::tests::clean;
    use super::super::config::{Drift, Interference};
    use super::*;

    #[test]
    fn the_converter_has_two_to_the_power_of_bits_levels() {
        let mut config = clean();
        config.sensor.range_um = [-8.0, 8.0];
        config.sensor.bits = 4;
        let mut sensor = PositionSensor::new(&config);
        assert_eq!(sensor.read(0.4, 0.0), Ok(0.0));
        assert_eq!(sensor.read(0.6, 0.0), Ok(1.0));
        assert_eq!(sensor.read(-8.0, 0.0), Ok(-8.0));
        assert_eq!(sensor.read(7.4, 0.0), Ok(7.0));
        // Above the last level there is no reading.
        assert_eq!(sensor.read(7.6, 0.0), Err(7.6));
        assert_eq!(sensor.read(-8.6, 0.0), Err(-8.6));
    }

    #[test]
    fn drift_interference_and_zero_add_up_on_the_lab_clock() {
        let mut config = clean();
        config.sensor.offset_um = -3.0;
        config.drift = Some(Drift { um_per_s: 0.01 });
        config.interference = Some(Interference { amplitude_um: 0.2, hz: 50.0, phase_rad: 0.3 });
        let mut sensor = PositionSensor::new(&config);
        for t in [0.0, 1.234, 77.0] {
            let expected = 5.0 - 3.0 + 0.01 * t + 0.2 * (TAU * 50.0 * t + 0.3).sin();
            assert!((sensor.read(5.0, t).unwrap() - expected).abs() < 1e-9, "{t}");
        }
    }

    #[test]
    fn the_noise_has_the_declared_size_and_does_not_depend_on_effects() {
        let mut config = clean();
        config.sensor.noise_um = 0.01;
        let mut plain = PositionSensor::new(&config);
        config.drift = Some(Drift { um_per_s: 1.0 });
        let mut drifting = PositionSensor::new(&config);
        let noise: Vec<f64> = (0..20_000).map(|_| plain.read(0.0, 0.0).unwrap()).collect();
        assert!(noise.iter().all(|n| drifting.read(0.0, 0.0) == Ok(*n)));
        let rms = (noise.iter().map(|n| n * n).sum::<f64>() / 20_000.0).sqrt();
        assert!((rms / 0.01 - 1.0).abs() < 0.02, "{rms}");
    }
}
