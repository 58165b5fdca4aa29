//! Motions of one axis of a scanner: lines at constant speed with rounded turns, and spirals (Mahmood and Moheimani
//! 2009). For a Lissajous pattern use sines of two frequencies: see [`Tone`](super::Tone).

use std::f64::consts::TAU;

use super::error::{ExciteError, require};
use super::sampled::{check_count, check_frequency, sampled, smooth};

/// Lines at constant speed, forth and back, with turns at constant acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// Frequency of forth and back \[Hz\].
    pub frequency_hz: f64,
    /// Pairs of lines.
    pub cycles: u32,
    /// Share of time for the turns, from 0 (a triangle) to below 1.
    pub turning: f64,
}

impl Raster {
    /// Returns the position at a phase in cycles, as a share of the line: 0 at integers, 1 halfway between them.
    pub fn position(phase: f64, turning: f64) -> f64 {
        // Distance from the lower turning point in cycles; the upper one is half a cycle away.
        let from_low = phase.rem_euclid(1.0);
        let from_low = from_low.min(1.0 - from_low);
        // Half of the duration of a turn.
        let half = 0.25 * turning;
        let lower_half = |d: f64| {
            let distance = if d < half { 0.5 * (d * d / half + half) } else { d };
            (distance - 0.5 * half) / (0.5 - half)
        };
        if from_low <= 0.25 { lower_half(from_low) } else { 1.0 - lower_half(0.5 - from_low) }
    }

    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        check_count("cycles", self.cycles)?;
        require("turning", self.turning, (0.0..1.0).contains(&self.turning), "from 0 to below 1")?;
        let cycles = f64::from(self.cycles);
        sampled(("cycles", cycles), cycles / self.frequency_hz, rate, |t| {
            Self::position((self.frequency_hz * t).min(cycles), self.turning)
        })
    }
}

/// One axis of a spiral at constant angular velocity: a sine about mid-span whose amplitude grows from 0 to half of the
/// span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spiral {
    /// Turns per second \[Hz\].
    pub frequency_hz: f64,
    /// Number of turns from the middle to the rim; two more lead from rest to the middle, and two from the rim to rest.
    pub cycles: u32,
    /// Start angle: 0 for one axis, 90 for the other \[degrees\].
    pub phase_deg: f64,
}

impl Spiral {
    /// Returns the position as a share of the span, at the share `done` of the way to the rim and after `turns` turns.
    pub fn position(done: f64, turns: f64, phase_deg: f64) -> f64 {
        0.5 + 0.5 * done * (TAU * turns + phase_deg.to_radians()).cos()
    }

    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        check_count("cycles", self.cycles)?;
        require("phase_deg", self.phase_deg, (-360.0..=360.0).contains(&self.phase_deg), "from -360 to 360")?;
        let (cycles, fade) = (f64::from(self.cycles), 2.0 / self.frequency_hz);
        let outward = cycles / self.frequency_hz;
        let duration = outward + 2.0 * fade;
        sampled(("cycles", cycles), duration, rate, |t| {
            let faded = smooth(t / fade) * smooth((duration - t) / fade);
            let elapsed = (t - fade).max(0.0);
            faded * Self::position((elapsed / outward).min(1.0), self.frequency_hz * elapsed, self.phase_deg)
        })
    }
}
