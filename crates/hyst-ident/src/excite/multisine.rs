//! Sums of sines of equal amplitude.

use std::f64::consts::TAU;

use rand::Rng;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::crest;
use super::error::{ExciteError, positive, require};
use super::sampled::{MAX_ROWS, check_count, check_frequency, sampled, smooth};

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

impl Multisine {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
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
