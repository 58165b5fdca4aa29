//! The temperature's course in the lab and what the thermometer reads of it.

use std::f64::consts::TAU;

use super::config::{self, TemperatureShape};
use super::rng::{Draws, Purpose};

/// Temperature as a function of the lab's time, and the noise of its measurement.
#[derive(Debug, Clone)]
pub(crate) struct Climate {
    mean: f64,
    reference: f64,
    per_k: f64,
    waves: Vec<Wave>,
    thermometer: Option<Thermometer>,
}

#[derive(Debug, Clone)]
struct Wave {
    amplitude: f64,
    radian_per_s: f64,
    phase: f64,
}

#[derive(Debug, Clone)]
struct Thermometer {
    noise: f64,
    draws: Draws,
}

/// Frequencies of a wander over that of its slowest wave; no ratio of two is a small fraction.
const WANDER: [f64; 5] = [1.0, 1.617, 2.713, 3.911, 5.233];

impl Climate {
    pub(crate) fn new(seed: u64, config: &config::Temperature) -> Self {
        let mut draws = Draws::new(seed, Purpose::TemperatureProfile);
        let ratios: &[f64] = match config.shape {
            TemperatureShape::Sine => &WANDER[..1],
            TemperatureShape::Wander => &WANDER,
        };
        let waves = match config.period_s {
            Some(period) if config.swing_k > 0.0 => waves(&mut draws, ratios, config.swing_k, period),
            _ => Vec::new(),
        };
        let thermometer = config
            .recorded
            .then(|| Thermometer { noise: config.noise_k, draws: Draws::new(seed, Purpose::TemperatureNoise) });
        Self { mean: config.mean_degc, reference: config.reference_degc, per_k: config.per_k, waves, thermometer }
    }

    /// True temperature at lab time `t` (°C).
    pub(crate) fn at(&self, t: f64) -> f64 {
        self.waves.iter().fold(self.mean, |sum, w| sum + w.amplitude * libm::sin(w.radian_per_s * t + w.phase))
    }

    /// Factor on the displacement at lab time `t`.
    pub(crate) fn factor(&self, t: f64) -> f64 {
        if self.per_k == 0.0 { 1.0 } else { 1.0 + self.per_k * (self.at(t) - self.reference) }
    }

    /// What is recorded at lab time `t` (°C).
    pub(crate) fn measure(&mut self, t: f64) -> Option<f64> {
        let truth = self.at(t);
        self.thermometer.as_mut().map(|thermometer| truth + thermometer.noise * thermometer.draws.normal())
    }

    pub(crate) fn is_recorded(&self) -> bool {
        self.thermometer.is_some()
    }
}

/// Waves whose amplitudes sum to half of `swing`: the course never leaves the swing.
fn waves(draws: &mut Draws, ratios: &[f64], swing: f64, period: f64) -> Vec<Wave> {
    let mut waves: Vec<Wave> = ratios
        .iter()
        .map(|ratio| Wave {
            // Slow waves are larger.
            amplitude: draws.between(0.5, 1.0) / ratio,
            radian_per_s: TAU * ratio / period,
            phase: draws.between(0.0, TAU),
        })
        .collect();
    let sum: f64 = waves.iter().map(|wave| wave.amplitude).sum();
    for wave in &mut waves {
        wave.amplitude *= 0.5 * swing / sum;
    }
    waves
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> config::Temperature {
        config::Temperature {
            per_k: 0.005,
            reference_degc: 22.0,
            mean_degc: 24.0,
            swing_k: 10.0,
            period_s: Some(40.0),
            shape: TemperatureShape::Sine,
            recorded: true,
            noise_k: 0.0,
        }
    }

    fn extremes(climate: &Climate, seconds: u32) -> (f64, f64) {
        (0..seconds * 10)
            .map(|k| climate.at(0.1 * f64::from(k)))
            .fold((f64::MAX, f64::MIN), |(low, high), t| (low.min(t), high.max(t)))
    }

    #[test]
    fn sine_swings_as_declared_and_returns_after_its_period() {
        let climate = Climate::new(3, &config());
        let (low, high) = extremes(&climate, 40);
        assert!((high - low - 10.0).abs() < 0.01 && (high + low - 48.0).abs() < 0.01, "{low} {high}");
        assert!((climate.at(3.0) - climate.at(43.0)).abs() < 1e-9);
        assert!((climate.factor(3.0) - (1.0 + 0.005 * (climate.at(3.0) - 22.0))).abs() < 1e-15);
    }

    #[test]
    fn wander_stays_within_its_swing_and_uses_much_of_it() {
        for seed in 0..20 {
            let climate = Climate::new(seed, &config::Temperature { shape: TemperatureShape::Wander, ..config() });
            let (low, high) = extremes(&climate, 400);
            assert!(low >= 19.0 && high <= 29.0 && high - low > 5.0, "{seed}: {low} {high}");
        }
    }

    #[test]
    fn recorded_or_not_effective_or_not() {
        let hidden = config::Temperature { recorded: false, ..config() };
        assert_eq!(Climate::new(3, &hidden).measure(1.0), None);
        let idle = config::Temperature { per_k: 0.0, noise_k: 0.02, ..config() };
        let mut climate = Climate::new(3, &idle);
        assert_eq!(climate.factor(7.0), 1.0);
        let read = climate.measure(7.0).unwrap();
        assert!(read != climate.at(7.0) && (read - climate.at(7.0)).abs() < 0.2);
        let constant = config::Temperature { swing_k: 0.0, period_s: None, ..config() };
        assert_eq!(Climate::new(3, &constant).measure(5.0), Some(24.0));
    }
}
