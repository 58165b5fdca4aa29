//! The shapes of the segments of a drive, as shares of the span: 0 is the lowest voltage, 1 the highest.

use super::error::ExciteError;
use super::forc::Forc;
use super::full_span::{DecayingSine, Sine, Stairs, Sweep, Triangle};
use super::limits::Limits;
use super::multisine::Multisine;
use super::scan::{Raster, Spiral};
use super::waves::{AmSine, MinorLoops, Tone};

/// The shape of one segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// See [`Sine`].
    Sine(Sine),
    /// See [`DecayingSine`].
    DecayingSine(DecayingSine),
    /// See [`Triangle`].
    Triangle(Triangle),
    /// See [`Stairs`].
    Stairs(Stairs),
    /// See [`Multisine`].
    Multisine(Multisine),
    /// See [`Sweep`].
    Sweep(Sweep),
    /// See [`Forc`].
    Forc(Forc),
    /// See [`AmSine`].
    AmSine(AmSine),
    /// See [`Tone`].
    Tone(Tone),
    /// See [`MinorLoops`].
    MinorLoops(MinorLoops),
    /// See [`Raster`].
    Raster(Raster),
    /// See [`Spiral`].
    Spiral(Spiral),
}

impl Shape {
    /// Returns the name of the shape, for example `decaying-sine`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Sine(_) => "sine",
            Self::DecayingSine(_) => "decaying-sine",
            Self::Triangle(_) => "triangle",
            Self::Stairs(_) => "stairs",
            Self::Multisine(_) => "multisine",
            Self::Sweep(_) => "sweep",
            Self::Forc(_) => "forc",
            Self::AmSine(_) => "am-sine",
            Self::Tone(_) => "tone",
            Self::MinorLoops(_) => "minor-loops",
            Self::Raster(_) => "raster",
            Self::Spiral(_) => "spiral",
        }
    }

    /// Returns the advice for a slope that is too steep.
    pub(super) fn remedy(&self) -> &'static str {
        match self {
            Self::Sine(_)
            | Self::DecayingSine(_)
            | Self::Triangle(_)
            | Self::AmSine(_)
            | Self::Tone(_)
            | Self::MinorLoops(_)
            | Self::Raster(_)
            | Self::Spiral(_) => "lower frequency_hz",
            Self::Stairs(_) => "lengthen ramp_s",
            Self::Multisine(_) => "lower high_hz or lengthen fade_s",
            Self::Sweep(_) => "lower high_hz",
            Self::Forc(_) => "lengthen peak_s",
        }
    }

    /// Returns the rows of the segment as shares of the span.
    pub(super) fn unit_samples(&self, limits: &Limits) -> Result<Vec<f64>, ExciteError> {
        let rate = limits.rate_hz;
        match self {
            Self::Sine(sine) => sine.samples(rate),
            Self::DecayingSine(sine) => sine.samples(rate),
            Self::Triangle(triangle) => triangle.samples(rate),
            Self::Stairs(stairs) => stairs.samples(rate),
            Self::Multisine(multisine) => multisine.samples(rate),
            Self::Sweep(sweep) => sweep.samples(rate),
            Self::Forc(forc) => forc.samples(rate),
            Self::AmSine(sine) => sine.samples(rate),
            Self::Tone(tone) => tone.samples(rate),
            Self::MinorLoops(loops) => loops.samples(rate),
            Self::Raster(raster) => raster.samples(rate),
            Self::Spiral(spiral) => spiral.samples(rate),
        }
    }
}
