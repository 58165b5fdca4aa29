//! Slow profiles on the lab clock: sums of sines.

use std::f64::consts::TAU;

use super::rng::Draws;

/// A sum of sines as a function of the lab time.
#[derive(Debug, Clone, Default)]
pub(crate) struct Waves(Vec<Wave>);

#[derive(Debug, Clone)]
struct Wave {
    amplitude: f64,
    radian_per_s: f64,
    phase: f64,
}

/// Frequencies of a wandering profile, relative to the slowest; no ratio of two is a simple fraction.
const WANDER: [f64; 5] = [1.0, 1.617, 2.713, 3.911, 5.233];

impl Waves {
    /// Returns one sine with a period (s) and a random phase.
    pub(crate) fn sine(draws: &mut Draws, amplitude: f64, period: f64) -> Self {
        Self::new(draws, &WANDER[..1], amplitude, period)
    }

    /// Returns several incommensurate sines within the amplitude, the slowest with a period (s).
    pub(crate) fn wander(draws: &mut Draws, amplitude: f64, period: f64) -> Self {
        Self::new(draws, &WANDER, amplitude, period)
    }

    /// Returns 12 sines with the spectrum of a random walk, within the amplitude.
    ///
    /// `period` is that of the slowest sine (s).
    pub(crate) fn walk(draws: &mut Draws, amplitude: f64, period: f64) -> Self {
        // Nearly even spacing with random offsets, so that the sum does not repeat within a record.
        let ratios: Vec<f64> = (1..=12).map(|k| f64::from(k) + draws.between(0.0, 0.5)).collect();
        Self::new(draws, &ratios, amplitude, ratios[0] * period)
    }

    /// Returns sines whose amplitudes decrease with frequency and have the sum `amplitude`.
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

    /// Returns `base` plus the sum of the sines at lab time `t`.
    pub(crate) fn on(&self, base: f64, t: f64) -> f64 {
        self.0.iter().fold(base, |sum, w| sum + w.amplitude * libm::sin(w.radian_per_s * t + w.phase))
    }
}
