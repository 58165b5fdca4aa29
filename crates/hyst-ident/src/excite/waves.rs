//! Sines over less than the span: amplitude-modulated, of constant amplitude about mid-span, small ones at several
//! levels.

use std::f64::consts::TAU;

use super::error::{ExciteError, require};
use super::sampled::{check_count, check_frequency, sampled, smooth};

/// An amplitude-modulated sine about mid-span: all amplitudes up to the whole span at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmSine {
    /// Frequency of the sine \[Hz\], adjusted to an integer number of cycles in the segment.
    pub frequency_hz: f64,
    /// Frequency of the modulation \[Hz\], at most a fifth of that of the sine.
    pub modulation_hz: f64,
    /// Modulation depth as a share: with 1 the amplitude falls to 0.
    pub depth: f64,
    /// Number of modulation cycles.
    pub cycles: u32,
}

/// A sine of constant amplitude about mid-span, faded in from rest and out to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Amplitude as a share of half the span, above 0 up to 1.
    pub amplitude: f64,
    /// Number of cycles between the fades. Each fade takes two more cycles, or more if the amplitude is small.
    pub cycles: u32,
}

/// Minor loops: small cosine waves at evenly spaced levels, with smooth ramps between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MinorLoops {
    /// Number of levels.
    pub levels: u32,
    /// Height of the loops as a share of the span, above 0 up to 1.
    pub share: f64,
    /// Frequency \[Hz\]; a ramp takes one period.
    pub frequency_hz: f64,
    /// Number of cycles at each level.
    pub cycles: u32,
}

fn check_share(field: &'static str, share: f64) -> Result<(), ExciteError> {
    require(field, share, share > 0.0 && share <= 1.0, "above 0 and at most 1")
}

impl AmSine {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        let slow = self.modulation_hz > 0.0 && self.modulation_hz <= 0.2 * self.frequency_hz;
        require("modulation_hz", self.modulation_hz, slow, "above 0 and at most a fifth of frequency_hz")?;
        check_share("depth", self.depth)?;
        check_count("cycles", self.cycles)?;
        let duration = f64::from(self.cycles) / self.modulation_hz;
        let frequency = (self.frequency_hz * duration).round() / duration;
        sampled(("cycles", f64::from(self.cycles)), duration, rate, |t| {
            let amplitude = 1.0 - self.depth * (0.5 - 0.5 * (TAU * self.modulation_hz * t).cos());
            0.5 - 0.5 * amplitude * (TAU * frequency * t).cos()
        })
    }
}

impl Tone {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        check_share("amplitude", self.amplitude)?;
        check_count("cycles", self.cycles)?;
        // The fade to mid-span is not steeper than the sine.
        let fade = f64::max(2.0, (0.25 / self.amplitude).ceil()) / self.frequency_hz;
        let duration = f64::from(self.cycles) / self.frequency_hz + 2.0 * fade;
        sampled(("cycles", f64::from(self.cycles)), duration, rate, |t| {
            let faded = smooth(t / fade) * smooth((duration - t) / fade);
            faded * (0.5 + 0.5 * self.amplitude * (TAU * self.frequency_hz * t).sin())
        })
    }
}

impl MinorLoops {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        check_count("levels", self.levels)?;
        check_share("share", self.share)?;
        check_count("cycles", self.cycles)?;
        let period = 1.0 / self.frequency_hz;
        let hold = f64::from(self.cycles) * period;
        let count = self.levels as usize;
        let step = if count == 1 { 0.0 } else { (1.0 - self.share) / (count - 1) as f64 };
        // The first level is the rest level; a single level is in the middle.
        let level = |i: usize| if count == 1 { 0.5 * (1.0 - self.share) } else { step * i as f64 };
        let per_level = hold + period;
        let duration = count as f64 * per_level + period;
        sampled(("levels", f64::from(self.levels)), duration, rate, |t| {
            let at = ((t / per_level) as usize).min(count);
            let within = t - at as f64 * per_level;
            let from = if at == 0 { 0.0 } else { level(at - 1) };
            let to = if at == count { 0.0 } else { level(at) };
            let ramped = from + (to - from) * smooth(within / period);
            let phase = (within - period).clamp(0.0, hold) * self.frequency_hz;
            ramped + if at == count { 0.0 } else { self.share * (0.5 - 0.5 * (TAU * phase).cos()) }
        })
    }
}
