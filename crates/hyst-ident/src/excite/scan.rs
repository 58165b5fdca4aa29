//! What scanners ask of one axis: lines at constant speed with rounded turnings, and spirals (Mahmood and Moheimani 2009 on spiral scans).
//! The other axis of a Lissajous pattern is a sine of another frequency: see [`Tone`](super::Tone).

use std::f64::consts::TAU;

use super::shapes::{check_count, check_frequency, sampled, smooth};
use super::{ExciteError, require};

/// Lines at constant speed, there and back, with turnings at constant acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// There and back again \[Hz\].
    pub frequency_hz: f64,
    /// Pairs of lines.
    pub cycles: u32,
    /// Share of the time that the turnings take, from 0 (a triangle) to below 1.
    pub turning: f64,
}

impl Raster {
    /// Position at a phase in cycles, as a share of the line: 0 at whole numbers, 1 between them.
    pub fn position(phase: f64, turning: f64) -> f64 {
        // As far from the lower turning point, in cycles; half a cycle is the way to the other one.
        let from_low = phase.rem_euclid(1.0);
        let from_low = from_low.min(1.0 - from_low);
        // Either turning begins and ends this far from its middle.
        let half = 0.25 * turning;
        let way = |d: f64| {
            let gone = if d < half { 0.5 * (d * d / half + half) } else { d };
            (gone - 0.5 * half) / (0.5 - half)
        };
        if from_low <= 0.25 { way(from_low) } else { 1.0 - way(0.5 - from_low) }
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

/// One axis of a spiral at constant angular velocity: a sine around mid-span whose amplitude grows from nothing to half the span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spiral {
    /// Turns in a second \[Hz\].
    pub frequency_hz: f64,
    /// Whole turns from the middle to the rim; two more lead there from rest, and two from the rim to rest.
    pub cycles: u32,
    /// Angle at which it begins: 0 for one axis, 90 for the other \[degrees\].
    pub phase_deg: f64,
}

impl Spiral {
    /// Position as a share of the span, `done` of the way to the rim (0 to 1) and after `turns` turns.
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
            let since = (t - fade).max(0.0);
            faded * Self::position((since / outward).min(1.0), self.frequency_hz * since, self.phase_deg)
        })
    }
}
