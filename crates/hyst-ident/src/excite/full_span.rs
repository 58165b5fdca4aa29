//! Drives over the whole span: sines, ramps, steps and sweeps.

use std::f64::consts::TAU;

use rand::Rng;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::error::{ExciteError, positive, require};
use super::sampled::{MAX_ROWS, check_count, check_frequency, sampled, smooth};

/// A raised cosine over the whole span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine {
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Whole cycles.
    pub cycles: u32,
}

/// A sine about mid-span whose amplitude falls linearly from the whole span to 0, with a smooth return to rest.
///
/// Its loops are nested and end in the demagnetised state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecayingSine {
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Duration with the return \[s\]; at least three periods.
    pub duration_s: f64,
}

/// Ramps up and down over the whole span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Whole cycles.
    pub cycles: u32,
}

/// Random levels over the whole span with holds, and smooth ramps between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stairs {
    /// Number of levels.
    pub levels: u32,
    /// Hold time of each level \[s\].
    pub hold_s: f64,
    /// Duration of each ramp \[s\]; usually 0.05 to 0.1.
    pub ramp_s: f64,
    /// Seed of the levels.
    pub seed: u64,
}

/// A raised cosine whose frequency grows exponentially.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Frequency at the start \[Hz\].
    pub low_hz: f64,
    /// Frequency at the end \[Hz\].
    pub high_hz: f64,
    /// Duration \[s\], adjusted to an integer number of cycles.
    pub duration_s: f64,
}

impl Sine {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        check_count("cycles", self.cycles)?;
        let duration = f64::from(self.cycles) / self.frequency_hz;
        sampled(("cycles", f64::from(self.cycles)), duration, rate, |t| 0.5 - 0.5 * (TAU * self.frequency_hz * t).cos())
    }
}

impl DecayingSine {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        let period = 1.0 / self.frequency_hz;
        let long = self.duration_s.is_finite() && self.duration_s >= 3.0 * period;
        require("duration_s", self.duration_s, long, "at least three periods of frequency_hz")?;
        let return_s = 0.5 * period;
        let decay = self.duration_s - return_s;
        // Linear after a first period in which the slope rises from 0, so that the start is smooth.
        let slope = 1.0 / (decay - 0.5 * period);
        let amplitude = |t: f64| {
            let lost = if t < period { 0.5 * slope * t * t / period } else { slope * (t - 0.5 * period) };
            (1.0 - lost).max(0.0)
        };
        sampled(("duration_s", self.duration_s), self.duration_s, rate, |t| {
            let oscillation = 0.5 - 0.5 * amplitude(t.min(decay)) * (TAU * self.frequency_hz * t.min(decay)).cos();
            oscillation * (1.0 - smooth((t - decay) / return_s))
        })
    }
}

impl Triangle {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        check_count("cycles", self.cycles)?;
        let cycles = f64::from(self.cycles);
        sampled(("cycles", cycles), cycles / self.frequency_hz, rate, |t| {
            let phase = (self.frequency_hz * t).min(cycles);
            1.0 - 2.0 * (phase - phase.floor() - 0.5).abs()
        })
    }
}

impl Stairs {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_count("levels", self.levels)?;
        require("hold_s", self.hold_s, self.hold_s.is_finite() && self.hold_s >= 0.0, "a number from 0 up")?;
        let ramped = self.ramp_s.is_finite() && self.ramp_s * rate >= 2.0;
        require("ramp_s", self.ramp_s, ramped, "at least two rows long")?;
        let step = self.ramp_s + self.hold_s;
        let count = f64::from(self.levels);
        let duration = count * step + self.ramp_s;
        require("levels", count, duration * rate < MAX_ROWS, "so few that the drive has fewer than 5e7 rows")?;
        // One level in each equal part of the span, in random order.
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut levels: Vec<f64> =
            (0..self.levels).map(|part| (f64::from(part) + random.random::<f64>()) / count).collect();
        levels.shuffle(&mut random);
        levels.push(0.0);
        sampled(("hold_s", self.hold_s), duration, rate, |t| {
            let at = ((t / step) as usize).min(levels.len() - 1);
            let from = if at == 0 { 0.0 } else { levels[at - 1] };
            let moved = smooth((t - at as f64 * step) / self.ramp_s);
            from + (levels[at] - from) * moved
        })
    }
}

impl Sweep {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("low_hz", self.low_hz, rate)?;
        check_frequency("high_hz", self.high_hz, rate)?;
        require("high_hz", self.high_hz, self.high_hz > self.low_hz, "above low_hz")?;
        positive("duration_s", self.duration_s)?;
        // Cycles up to the time t: low T / ln q · (q^(t/T) − 1), with q = high / low.
        let growth = (self.high_hz / self.low_hz).ln();
        let per_second = (self.high_hz - self.low_hz) / growth;
        let cycles = (per_second * self.duration_s).round().max(1.0);
        let duration = cycles / per_second;
        let scale = self.low_hz * duration / growth;
        sampled(("duration_s", self.duration_s), duration, rate, |t| {
            let done = (scale * (growth * t / duration).exp_m1()).min(cycles);
            0.5 - 0.5 * (TAU * done).cos()
        })
    }
}
