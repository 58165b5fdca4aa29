//! Random numbers with fixed bits: a seed gives the same plant on every machine and in every version.
//!
//! The generator is ChaCha with 8 rounds. The key is the seed in little-endian bytes, followed by zeros; the stream
//! number is the purpose. Only raw 64-bit words come from the library. The conversions to real numbers are below, so
//! that they do not depend on a library version.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// Purpose of random numbers.
///
/// Each purpose has its own stream. So recording the temperature does not change the position noise, and a different
/// number of relays changes nothing else.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    /// Relay thresholds.
    Relays = 1,
    /// Phases and amplitudes of the temperature profile.
    TemperatureProfile = 2,
    /// Noise of the position sensor.
    PositionNoise = 3,
    /// Noise of the thermometer.
    TemperatureNoise = 4,
    /// Parameters of a random plant.
    Parameters = 5,
    /// Choice of effects of a random plant.
    Effects = 6,
    /// Drag of each relay or play operator.
    Viscosity = 7,
    /// Thresholds and weights of play operators.
    Plays = 8,
    /// Phases, amplitudes and levels of the load profile.
    LoadProfile = 9,
    /// Noise of the force sensor.
    LoadNoise = 10,
    /// Times of the noise bursts.
    BurstMoments = 11,
    /// Noise in the bursts.
    BurstNoise = 12,
    /// Phases and amplitudes of the random walk of the sensor's zero.
    SensorWander = 13,
    /// Positions of a slipping mount.
    Slip = 14,
    /// Parameters of a random disturbance.
    Disturbance = 15,
}

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub(crate) struct Draws(ChaCha8Rng);

impl Draws {
    pub(crate) fn new(seed: u64, purpose: Purpose) -> Self {
        Self::numbered(seed, purpose, 0)
    }

    /// Returns one of many streams of a purpose; number 0 is that of [`new`](Self::new).
    pub(crate) fn numbered(seed: u64, purpose: Purpose, number: u32) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        let mut rng = ChaCha8Rng::from_seed(key);
        rng.set_stream(purpose as u64 | (u64::from(number) << 32));
        Self(rng)
    }

    /// Returns a uniform number in [0, 1), from the upper 53 bits of a word.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Returns a uniform number in [low, high).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns one of 0, 1, … n − 1. The bias of the product is negligible for `n` far below 2⁵³.
    pub(crate) fn index(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// Returns an exponential number with mean 1.
    pub(crate) fn exponential(&mut self) -> f64 {
        -libm::log(1.0 - self.unit())
    }

    /// Returns a standard normal number.
    ///
    /// Box-Muller, only the cosine branch, so no second number is stored.
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(2.0 * self.exponential());
        radius * libm::cos(std::f64::consts::TAU * self.unit())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_a_stream_do_not_change() {
        // These words must never change, so that a seed always gives the same plant.
        let mut draws = Draws::new(7, Purpose::Relays);
        let words: Vec<u64> = (0..3).map(|_| draws.0.next_u64()).collect();
        assert_eq!(words, PINNED);
    }
    const PINNED: [u64; 3] = [17_236_010_905_523_606_670, 5_195_008_117_022_965_769, 17_764_640_449_397_211_813];

    #[test]
    fn purposes_have_different_streams() {
        assert_ne!(Draws::new(7, Purpose::Relays).0.next_u64(), Draws::new(7, Purpose::PositionNoise).0.next_u64());
        let numbered = |number| Draws::numbered(7, Purpose::Slip, number).0.next_u64();
        assert_ne!(numbered(0), numbered(1));
    }

    #[test]
    fn the_distributions_have_their_moments() {
        let mut draws = Draws::new(3, Purpose::PositionNoise);
        let n = 200_000;
        let normal: Vec<f64> = (0..n).map(|_| draws.normal()).collect();
        let mean = normal.iter().sum::<f64>() / f64::from(n);
        let variance = normal.iter().map(|x| x * x).sum::<f64>() / f64::from(n);
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.02, "{mean} {variance}");
        let waits = (0..n).map(|_| draws.exponential()).sum::<f64>() / f64::from(n);
        assert!((waits - 1.0).abs() < 0.01, "{waits}");
        assert!((0..1000).all(|_| draws.index(3) < 3));
    }
}
