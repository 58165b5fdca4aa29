//! Slow courses on the lab's clock: sums of sines.

use std::f64::consts::TAU;

use super::rng::Draws;

/// A sum of sines as a function of the lab's time.
#[derive(Debug, Clone, Default)]
pub(crate) struct Waves(Vec<Wave>);

#[derive(Debug, Clone)]
struct Wave {
    amplitude: f64,
    radian_per_s: f64,
    phase: f64,
}

/// Frequencies of a wander over that of its slowest wave; no ratio of two is a small fraction.
const WANDER: [f64; 5] = [1.0, 1.617, 2.713, 3.911, 5.233];

impl Waves {
    /// One sine of a period (s), its phase drawn.
    pub(crate) fn sine(draws: &mut Draws, amplitude: f64, period: f64) -> Self {
        Self::new(draws, &WANDER[..1], amplitude, period)
    }

    /// Several incommensurate sines, the slowest of a period (s), that never leave the amplitude.
    pub(crate) fn wander(draws: &mut Draws, amplitude: f64, period: f64) -> Self {
        Self::new(draws, &WANDER, amplitude, period)
    }

    /// A dozen sines of a random walk's spectrum, the slowest of a period (s), that never leave the amplitude.
    pub(crate) fn walk(draws: &mut Draws, amplitude: f64, period: f64) -> Self {
        // Evenly spaced but for chance: what repeats is longer than a record.
        let ratios: Vec<f64> = (1..=12).map(|k| f64::from(k) + draws.between(0.0, 0.5)).collect();
        Self::new(draws, &ratios, amplitude, ratios[0] * period)
    }

    /// Waves whose amplitudes sum to `amplitude`, the slow ones larger.
    fn new(draws: &mut Draws, ratios: &[f64], amplitude: f64, period: f64) -> Self {
        let mut waves: Vec<Wave> = ratios
            .iter()
            .map(|ratio| Wave {
                amplitude: draws.between(0.5, 1.0) / ratio,
                radian_per_s: TAU * ratio / period,
                phase: draws.between(0.0, TAU),
            })
            .collect();
        let sum: f64 = waves.iter().map(|wave| wave.amplitude).sum();
        for wave in &mut waves {
            wave.amplitude *= amplitude / sum;
        }
        Self(waves)
    }

    /// What stands on `base` at lab time `t`.
    pub(crate) fn on(&self, base: f64, t: f64) -> f64 {
        self.0.iter().fold(base, |sum, w| sum + w.amplitude * libm::sin(w.radian_per_s * t + w.phase))
    }
}
