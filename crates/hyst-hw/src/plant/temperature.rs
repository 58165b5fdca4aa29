//! The temperature of the lab, and its measurement.

use super::config::{self, TemperatureShape};
use super::rng::{Draws, Purpose};
use super::waves::Waves;

/// Temperature as a function of the lab time, and the noise of its measurement.
#[derive(Debug, Clone)]
pub(crate) struct Climate {
    mean: f64,
    reference: f64,
    per_k: f64,
    waves: Waves,
    thermometer: Option<Thermometer>,
}

#[derive(Debug, Clone)]
struct Thermometer {
    noise: f64,
    draws: Draws,
}

impl Climate {
    pub(crate) fn new(seed: u64, config: &config::Temperature) -> Self {
        let mut draws = Draws::new(seed, Purpose::TemperatureProfile);
        let half_swing = 0.5 * config.swing_k;
        let waves = match (config.period_s.filter(|_| half_swing > 0.0), config.shape) {
            (None, _) => Waves::default(),
            (Some(period), TemperatureShape::Sine) => Waves::sine(&mut draws, half_swing, period),
            (Some(period), TemperatureShape::Wander) => Waves::wander(&mut draws, half_swing, period),
        };
        let thermometer = config
            .recorded
            .then(|| Thermometer { noise: config.noise_k, draws: Draws::new(seed, Purpose::TemperatureNoise) });
        Self { mean: config.mean_degc, reference: config.reference_degc, per_k: config.per_k, waves, thermometer }
    }

    /// Sets another seed for the thermometer's noise.
    pub(crate) fn with_noise(mut self, seed: u64) -> Self {
        if let Some(thermometer) = &mut self.thermometer {
            thermometer.draws = Draws::new(seed, Purpose::TemperatureNoise);
        }
        self
    }

    /// Returns the true temperature at lab time `t` (°C).
    pub(crate) fn at(&self, t: f64) -> f64 {
        self.waves.on(self.mean, t)
    }

    /// Returns the factor on the displacement at lab time `t`.
    pub(crate) fn factor(&self, t: f64) -> f64 {
        if self.per_k == 0.0 { 1.0 } else { 1.0 + self.per_k * (self.at(t) - self.reference) }
    }

    /// Returns the measured temperature at lab time `t` (°C); `None` if it is not recorded.
    pub(crate) fn measure(&mut self, t: f64) -> Option<f64> {
        let truth = self.at(t);
        self.thermometer.as_mut().map(|thermometer| truth + thermometer.noise * thermometer.draws.normal())
    }

    pub(crate) fn is_recorded(&self) -> bool {
        self.thermometer.is_some()
    }
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
    fn a_sine_has_the_declared_swing_and_period() {
        let climate = Climate::new(3, &config());
        let (low, high) = extremes(&climate, 40);
        assert!((high - low - 10.0).abs() < 0.01 && (high + low - 48.0).abs() < 0.01, "{low} {high}");
        assert!((climate.at(3.0) - climate.at(43.0)).abs() < 1e-9);
        assert!((climate.factor(3.0) - (1.0 + 0.005 * (climate.at(3.0) - 22.0))).abs() < 1e-15);
    }

    #[test]
    fn a_wandering_temperature_stays_within_its_swing_and_uses_most_of_it() {
        for seed in 0..20 {
            let climate = Climate::new(seed, &config::Temperature { shape: TemperatureShape::Wander, ..config() });
            let (low, high) = extremes(&climate, 400);
            assert!(low >= 19.0 && high <= 29.0 && high - low > 5.0, "{seed}: {low} {high}");
        }
    }

    #[test]
    fn recording_and_effect_of_the_temperature_are_independent() {
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
