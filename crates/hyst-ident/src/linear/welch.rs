//! Frequency response with coherence: Welch's averages and the estimate H₁.

use std::ops::Range;

use nalgebra::Complex;
use realfft::RealFftPlanner;
use serde::Serialize;

use super::LinearError;
use super::error::{require, require_one_period};
use crate::Samples;

/// The response at one frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ResponseLine {
    /// Frequency \[Hz\].
    pub hz: f64,
    /// Gain \[y/u\].
    pub gain: f64,
    /// Phase of the output against the input, −π to π \[rad\].
    pub phase: f64,
    /// Share of the output's power that follows the input linearly, 0 to 1.
    pub coherence: f64,
    /// Standard error of the gain \[y/u\].
    pub gain_std_error: f64,
    /// Standard error of the phase \[rad\].
    pub phase_std_error: f64,
}

impl ResponseLine {
    /// The gain between which the true one lies with a probability of 95 % \[y/u\].
    pub fn gain_band(&self) -> (f64, f64) {
        let reach = 1.96 * self.gain_std_error;
        ((self.gain - reach).max(0.0), self.gain + reach)
    }

    pub(super) fn new(hz: f64, h: Complex<f64>, coherence: f64, relative_std_error: f64) -> Self {
        let gain = h.norm();
        let error = relative_std_error;
        Self { hz, gain, phase: h.arg(), coherence, gain_std_error: gain * error, phase_std_error: error }
    }
}

/// How a response was estimated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Method {
    /// Averages over Hann windows that overlap by half; `H₁ = S_yu / S_uu`, unbiased by noise of the output.
    Welch {
        /// Length of a window \[s\]; the resolution is 1.5 over it.
        window_s: f64,
        /// Windows.
        averages: usize,
        /// Independent windows that would scatter as much.
        effective_averages: f64,
    },
    /// Averages over whole periods of the drive.
    Periodic {
        /// The period \[s\].
        period_s: f64,
        /// Periods that were used.
        periods: usize,
        /// Root mean square of the averaged output at lines that the drive does not have, over that at those it has: what
        /// is not linear.
        unexcited_share: f64,
    },
}

/// A frequency response, from the lowest frequency up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrequencyResponse {
    /// How it was estimated.
    pub method: Method,
    /// The lines.
    pub lines: Vec<ResponseLine>,
}

/// How [`response`] averages.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WelchOptions {
    /// Length of a window \[s\]; if not given, such that about 24 windows fit into the record, or the longest segment.
    pub window_s: Option<f64>,
}

/// Windows that are aimed at where no length is given.
const WINDOWS: usize = 24;

/// Estimates the frequency response of `y` to `u` by Welch's method with H₁: Hann windows, half overlapped, none across two
/// segments, means removed.
///
/// With n effective averages the standard error of the gain is `gain · √((1 − γ²) / (2 n γ²))`, that of the phase the same
/// in radians (Bendat and Piersol, Random Data); γ² is the coherence, whose estimate for no relation at all is about 1/n.
///
/// # Errors
/// When a column is constant or fewer than two windows fit.
pub fn response(samples: &Samples, options: &WelchOptions) -> Result<FrequencyResponse, LinearError> {
    require_one_period(samples)?;
    let longest = samples.segments.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    let length = match options.window_s {
        Some(seconds) => {
            require("window_s", seconds, seconds.is_finite() && seconds > 0.0, "a positive number of seconds")?;
            (seconds / samples.period).round() as usize
        }
        None => (2 * samples.len() / (WINDOWS + 1)).min(longest),
    };
    let remedy = "record longer, or take shorter windows";
    let short = |needed| LinearError::TooShort { what: "the response", needed, found: longest, remedy };
    if length < 16 {
        return Err(short(200));
    }
    let mut sums = Sums::new(length);
    for window in windows(&samples.segments, length) {
        sums.add(&samples.input[window.clone()], &samples.output[window]);
    }
    if sums.count < 2 {
        return Err(short(length + length / 2));
    }
    sums.finish(samples.period)
}

/// Rows of the windows that fit into segments, half overlapped.
pub(crate) fn windows(segments: &[Range<usize>], length: usize) -> impl Iterator<Item = Range<usize>> {
    let starts = move |s: &Range<usize>| (s.start..(s.end + 1).saturating_sub(length)).step_by((length / 2).max(1));
    segments.iter().flat_map(starts).map(move |start| start..start + length)
}

/// A Hann window and the spectra of what is seen through it.
pub(crate) struct Hann {
    fft: std::sync::Arc<dyn realfft::RealToComplex<f64>>,
    window: Vec<f64>,
}

impl Hann {
    pub(crate) fn new(length: usize) -> Self {
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        Self { fft, window: hann(length) }
    }

    /// Σ w²
    pub(crate) fn energy(&self) -> f64 {
        self.window.iter().map(|w| w * w).sum()
    }

    /// Spectrum of as many rows as the window has, their mean removed.
    pub(crate) fn spectrum(&self, x: &[f64]) -> Vec<Complex<f64>> {
        self.seen_through(&self.window, x)
    }

    /// Spectrum, at the same frequencies, of fewer rows through a window as long as they are, and that window's Σ w².
    pub(crate) fn short(&self, x: &[f64]) -> (Vec<Complex<f64>>, f64) {
        let window = hann(x.len().min(self.window.len()));
        (self.seen_through(&window, x), window.iter().map(|w| w * w).sum())
    }

    fn seen_through(&self, window: &[f64], x: &[f64]) -> Vec<Complex<f64>> {
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        let mut windowed: Vec<f64> = x.iter().zip(window).map(|(x, w)| (x - mean) * w).collect();
        windowed.resize(self.window.len(), 0.0);
        let mut spectrum = self.fft.make_output_vec();
        // Lengths are the planner's own: this cannot fail.
        let _ = self.fft.process(&mut windowed, &mut spectrum);
        spectrum
    }
}

fn hann(length: usize) -> Vec<f64> {
    (0..length).map(|k| 0.5 - 0.5 * (std::f64::consts::TAU * (k as f64 + 0.5) / length as f64).cos()).collect()
}

/// Summed spectra.
struct Sums {
    hann: Hann,
    count: usize,
    uu: Vec<f64>,
    yy: Vec<f64>,
    yu: Vec<Complex<f64>>,
}

impl Sums {
    fn new(length: usize) -> Self {
        let lines = length / 2 + 1;
        Self {
            hann: Hann::new(length),
            count: 0,
            uu: vec![0.0; lines],
            yy: vec![0.0; lines],
            yu: vec![Complex::new(0.0, 0.0); lines],
        }
    }

    fn add(&mut self, u: &[f64], y: &[f64]) {
        let (u, y) = (self.hann.spectrum(u), self.hann.spectrum(y));
        for (i, (u, y)) in u.iter().zip(&y).enumerate() {
            self.uu[i] += u.norm_sqr();
            self.yy[i] += y.norm_sqr();
            self.yu[i] += y * u.conj();
        }
        self.count += 1;
    }

    fn finish(self, period: f64) -> Result<FrequencyResponse, LinearError> {
        let length = self.hann.window.len();
        let strongest = |power: &[f64]| power.iter().skip(2).fold(0.0_f64, |most, p| most.max(*p));
        let (most_u, most_y) = (strongest(&self.uu), strongest(&self.yy));
        for (most, column) in [(most_u, "input"), (most_y, "output")] {
            if most <= 0.0 {
                return Err(LinearError::Constant { column });
            }
        }
        let k = self.count as f64;
        // Neighbouring Hann windows share a sixth of their weight.
        let effective = k / (1.0 + 2.0 * (k - 1.0) / k / 36.0);
        let line = |i: usize| {
            // Where the drive has nothing but rounding there is no response to see.
            if self.uu[i] <= 1e-20 * most_u {
                return None;
            }
            let h = self.yu[i] / self.uu[i];
            let power = self.uu[i] * self.yy[i];
            let coherence = if power > 0.0 { (self.yu[i].norm_sqr() / power).min(1.0) } else { 0.0 };
            let relative = ((1.0 - coherence) / (2.0 * effective * coherence.max(1e-12))).sqrt();
            Some(ResponseLine::new(i as f64 / (length as f64 * period), h, coherence, relative))
        };
        // The window smears the removed mean over the first line.
        let lines = (2..length.div_ceil(2)).filter_map(line).collect();
        let (window_s, averages) = (length as f64 * period, self.count);
        let method = Method::Welch { window_s, averages, effective_averages: effective };
        Ok(FrequencyResponse { method, lines })
    }
}
