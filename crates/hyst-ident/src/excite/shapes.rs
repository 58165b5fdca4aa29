//! The shapes of the segments of a drive, as shares of the span: 0 is the lowest voltage, 1 the highest.

use std::f64::consts::{PI, TAU};

use rand::Rng;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::crest;
use super::scan::{Raster, Spiral};
use super::waves::{AmSine, MinorLoops, Tone};
use super::{ExciteError, Limits, MAX_ROWS, positive, require};

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

/// Phases of the lines of a [`Multisine`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phases {
    /// Phases from a search for the lowest crest factor: 1.4 to 1.5 from 20 lines up.
    LowCrest,
    /// Schroeder's phases `−π k (k − 1) / lines`: a crest factor of about 1.7.
    Schroeder,
    /// Random phases from this seed.
    Random(u64),
}

/// A sum of sines of equal amplitude about mid-span, faded in from rest and out to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Multisine {
    /// The lowest line \[Hz\].
    pub low_hz: f64,
    /// The highest line \[Hz\].
    pub high_hz: f64,
    /// Number of lines, evenly spaced. Each is moved to an integer number of cycles per period. With
    /// [`Phases::LowCrest`] it is moved to a multiple of one spacing, and there are as many lines as fit: the crest
    /// factor of unevenly spaced lines cannot be low.
    pub lines: u32,
    /// Number of periods in `duration_s`, with the fades: a period is `duration_s / periods`.
    pub periods: u32,
    /// Phases of the lines.
    pub phases: Phases,
    /// Duration with the fades \[s\].
    pub duration_s: f64,
    /// Duration of each fade \[s\]; at most half of `duration_s`.
    pub fade_s: f64,
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

/// The form of a peak of [`Forc`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peak {
    /// Straight flanks. They excite the modes of a structure.
    Triangle,
    /// Half a sine wave, smooth at the reversal.
    HalfSine,
}

/// Peaks of increasing height from rest, one per reversal voltage. The falling flanks are first-order reversal curves
/// (first-order descent curves in Schirrer et al.).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forc {
    /// Number of peaks; the last reaches the highest voltage.
    pub curves: u32,
    /// Duration of a peak \[s\].
    pub peak_s: f64,
    /// Rest after each peak \[s\].
    pub rest_s: f64,
    /// Form of the peaks.
    pub peak: Peak,
}

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

/// Returns half a cosine wave from 0 to 1 for `x` from 0 to 1, and 0 or 1 outside.
pub(super) fn smooth(x: f64) -> f64 {
    0.5 - 0.5 * (PI * x.clamp(0.0, 1.0)).cos()
}

/// Returns the rows from 0 to `duration` \[s\], the last one not before `duration`. `share` is not called for later
/// times. The error for a duration out of range names `field`.
pub(super) fn sampled(
    (field, value): (&'static str, f64),
    duration: f64,
    rate: f64,
    share: impl Fn(f64) -> f64,
) -> Result<Vec<f64>, ExciteError> {
    let steps = (duration * rate - 1e-9).ceil();
    require(field, value, (1.0..MAX_ROWS).contains(&steps), "such that the segment has 2 to 5e7 rows")?;
    Ok((0..=steps as usize).map(|k| share((k as f64 / rate).min(duration))).collect())
}

pub(super) fn check_frequency(field: &'static str, frequency: f64, rate: f64) -> Result<(), ExciteError> {
    positive(field, frequency)?;
    require(field, frequency, frequency <= 0.25 * rate, "at most a quarter of rate_hz")
}

pub(super) fn check_count(field: &'static str, count: u32) -> Result<(), ExciteError> {
    require(field, f64::from(count), count > 0, "at least 1")
}

impl Sine {
    fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("frequency_hz", self.frequency_hz, rate)?;
        check_count("cycles", self.cycles)?;
        let duration = f64::from(self.cycles) / self.frequency_hz;
        sampled(("cycles", f64::from(self.cycles)), duration, rate, |t| 0.5 - 0.5 * (TAU * self.frequency_hz * t).cos())
    }
}

impl DecayingSine {
    fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
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
    fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
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
    fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
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

impl Multisine {
    fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_frequency("low_hz", self.low_hz, rate)?;
        check_frequency("high_hz", self.high_hz, rate)?;
        require("high_hz", self.high_hz, self.high_hz >= self.low_hz, "at least low_hz")?;
        positive("duration_s", self.duration_s)?;
        let faded = self.fade_s > 0.0 && self.fade_s <= 0.5 * self.duration_s;
        require("fade_s", self.fade_s, faded, "above 0 and at most half of duration_s")?;
        let raw = self.sum(rate)?;
        let peak = raw.iter().fold(f64::MIN_POSITIVE, |most, s| most.max(s.abs()));
        let faded = |(k, s): (usize, &f64)| {
            let t = (k as f64 / rate).min(self.duration_s);
            // The fade applies to the oscillation and to mid-span, so the sum is always between 0 and 1.
            let fade = smooth(t / self.fade_s) * smooth((self.duration_s - t) / self.fade_s);
            fade * (0.5 + 0.5 * s / peak)
        };
        Ok(raw.iter().enumerate().map(faded).collect())
    }

    /// Returns the ratio of peak magnitude to RMS of the sum, without its fades: 1.41 for one line.
    ///
    /// # Errors
    /// As a drive of this shape.
    pub fn crest_factor(&self, rate_hz: f64) -> Result<f64, ExciteError> {
        Ok(crest::crest_factor(&self.sum(rate_hz)?))
    }

    /// Returns the sum of sines.
    fn sum(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_count("periods", self.periods)?;
        let cycles = self.cycles()?;
        let work = self.duration_s * rate * cycles.len() as f64;
        require("duration_s", self.duration_s, work < 100.0 * MAX_ROWS, "shorter for this many lines")?;
        let phases = self.phases(&cycles);
        let per_second = f64::from(self.periods) / self.duration_s;
        let sum = |t: f64| {
            cycles.iter().zip(&phases).map(|(c, phase)| (TAU * (*c as f64 * per_second) * t + phase).sin()).sum::<f64>()
        };
        sampled(("duration_s", self.duration_s), self.duration_s, rate, sum)
    }

    /// Returns the number of cycles of each line per period.
    fn cycles(&self) -> Result<Vec<usize>, ExciteError> {
        check_count("lines", self.lines)?;
        let count = f64::from(self.lines);
        let period = self.duration_s / f64::from(self.periods);
        let low = (self.low_hz * period).round().max(1.0);
        let high = (self.high_hz * period).round().max(1.0);
        let room = format!("at most {}: lines are whole multiples of 1 / duration_s", high - low + 1.0);
        require("lines", count, count <= high - low + 1.0, &room)?;
        let spacing = if self.lines == 1 { 0.0 } else { (high - low) / (count - 1.0) };
        let (low, spacing) = match self.phases {
            Phases::LowCrest if spacing > 1.0 => {
                let whole = spacing.round();
                ((low / whole).round().max(1.0) * whole, whole)
            }
            _ => (low, spacing),
        };
        let lines = (0..self.lines).map(|k| (low + f64::from(k) * spacing).round());
        Ok(lines.take_while(|line| *line <= high).map(|line| line as usize).collect())
    }

    fn phases(&self, cycles: &[usize]) -> Vec<f64> {
        match self.phases {
            Phases::LowCrest => crest::low_crest(cycles),
            Phases::Schroeder => crest::schroeder(cycles.len()),
            Phases::Random(seed) => {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                (0..self.lines).map(|_| TAU * random.random::<f64>()).collect()
            }
        }
    }
}

impl Sweep {
    fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
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

impl Forc {
    fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
        check_count("curves", self.curves)?;
        positive("peak_s", self.peak_s)?;
        require("peak_s", self.peak_s, self.peak_s * rate >= 4.0, "at least four rows long")?;
        require("rest_s", self.rest_s, self.rest_s.is_finite() && self.rest_s >= 0.0, "a number from 0 up")?;
        let step = self.peak_s + self.rest_s;
        let count = f64::from(self.curves);
        sampled(("curves", count), count * step, rate, |t| {
            let at = (t / step).floor().min(count - 1.0);
            let x = ((t - at * step) / self.peak_s).clamp(0.0, 1.0);
            let share = match self.peak {
                Peak::Triangle => 1.0 - (2.0 * x - 1.0).abs(),
                Peak::HalfSine => (PI * x).sin().max(0.0),
            };
            share * (at + 1.0) / count
        })
    }
}
