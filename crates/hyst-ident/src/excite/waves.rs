//! Sines that are not of the whole span: modulated, of one amplitude around mid-span, small ones at several levels.

use std::f64::consts::TAU;

use super::shapes::{check_count, check_frequency, sampled, smooth};
use super::{ExciteError, require};

/// A sine around mid-span whose amplitude swings between the whole span and less: every amplitude at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmSine {
    /// Frequency of the sine \[Hz\], adjusted to whole cycles over the segment.
    pub frequency_hz: f64,
    /// Frequency at which the amplitude swings \[Hz\], at most a fifth of the sine's.
    pub modulation_hz: f64,
    /// How far the amplitude swings, as a share: 1 down to nothing.
    pub depth: f64,
    /// Whole swings of the amplitude.
    pub cycles: u32,
}

/// A sine of constant amplitude around mid-span, faded in from rest and out again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Amplitude as a share of half the span, above 0 up to 1.
    pub amplitude: f64,
    /// Whole cycles between the fades, each of which takes two more (and more where the amplitude is small).
    pub cycles: u32,
}

/// Small cosine waves at evenly spaced levels, with smooth ramps in between: minor loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MinorLoops {
    /// How many levels.
    pub levels: u32,
    /// Height of the loops as a share of the span, above 0 up to 1.
    pub share: f64,
    /// Frequency \[Hz\]; a ramp takes one period.
    pub frequency_hz: f64,
    /// Whole cycles at each level.
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
        // The way to mid-span is no steeper than the sine.
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
        let stay = f64::from(self.cycles) * period;
        let count = self.levels as usize;
        let step = if count == 1 { 0.0 } else { (1.0 - self.share) / (count - 1) as f64 };
        // The first level is rest itself; one alone is in the middle.
        let level = |i: usize| if count == 1 { 0.5 * (1.0 - self.share) } else { step * i as f64 };
        let one = stay + period;
        let duration = count as f64 * one + period;
        sampled(("levels", f64::from(self.levels)), duration, rate, |t| {
            let at = ((t / one) as usize).min(count);
            let within = t - at as f64 * one;
            let from = if at == 0 { 0.0 } else { level(at - 1) };
            let to = if at == count { 0.0 } else { level(at) };
            let ramped = from + (to - from) * smooth(within / period);
            let turned = (within - period).clamp(0.0, stay) * self.frequency_hz;
            ramped + if at == count { 0.0 } else { self.share * (0.5 - 0.5 * (TAU * turned).cos()) }
        })
    }
}
