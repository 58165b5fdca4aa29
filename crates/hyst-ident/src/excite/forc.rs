//! Peaks of increasing height, for first-order reversal curves.

use std::f64::consts::PI;

use super::error::{ExciteError, positive, require};
use super::sampled::{check_count, sampled};

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

impl Forc {
    pub(super) fn samples(&self, rate: f64) -> Result<Vec<f64>, ExciteError> {
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
