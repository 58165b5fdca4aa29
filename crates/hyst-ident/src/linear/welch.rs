//! Estimates the frequency response with coherence by Welch's method and the estimator H₁.

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
    /// Phase of the output relative to the input, −π to π \[rad\].
    pub phase: f64,
    /// Share of the output power that depends linearly on the input, 0 to 1.
    pub coherence: f64,
    /// Standard error of the gain \[y/u\].
    pub gain_std_error: f64,
    /// Standard error of the phase \[rad\].
    pub phase_std_error: f64,
}

impl ResponseLine {
    /// Returns the 95 % confidence interval of the gain \[y/u\].
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

/// Method of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Method {
    /// Averages over half-overlapping Hann windows; `H₁ = S_yu / S_uu` is not biased by noise of the output.
    Welch {
        /// Length of a window \[s\]; the resolution is 1.5 divided by the length.
        window_s: f64,
        /// Number of windows.
        averages: usize,
        /// Number of independent windows with the same scatter.
        effective_averages: f64,
    },
    /// Averages over whole periods of the drive.
    Periodic {
        /// The period \[s\].
        period_s: f64,
        /// Number of periods in use.
        periods: usize,
        /// RMS of the averaged output at lines that are not in the drive, divided by that at the lines of the drive:
        /// the nonlinear part.
        unexcited_share: f64,
    },
}

/// A frequency response, from the lowest frequency up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrequencyResponse {
    /// Method of the estimate.
    pub method: Method,
    /// The lines.
    pub lines: Vec<ResponseLine>,
}

/// Options of [`response`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WelchOptions {
    /// Length of a window \[s\]; if not given, about 24 windows fit into the record, but at most the longest segment.
    pub window_s: Option<f64>,
}

/// Number of windows if no length is given.
const WINDOWS: usize = 24;

/// Estimates the frequency response from `u` to `y` by Welch's method with H₁: half-overlapping Hann windows without
/// their means, none across two segments.
///
/// With n effective averages the standard error of the gain is `gain · √((1 − γ²) / (2 n γ²))`. The relative value is
/// also the standard error of the phase in radians (Bendat and Piersol, Random Data). γ² is the coherence; its estimate
/// for independent signals is about 1/n.
///
/// # Errors
/// If a column is constant or fewer than two windows fit.
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
    let remedy = "record longer, or use shorter windows";
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

/// Returns the rows of half-overlapping windows in the segments.
pub(crate) fn windows(segments: &[Range<usize>], length: usize) -> impl Iterator<Item = Range<usize>> {
    let starts = move |s: &Range<usize>| (s.start..(s.end + 1).saturating_sub(length)).step_by((length / 2).max(1));
    segments.iter().flat_map(starts).map(move |start| start..start + length)
}

/// A Hann window and the transform of windowed rows.
pub(crate) struct Hann {
    fft: std::sync::Arc<dyn realfft::RealToComplex<f64>>,
    window: Vec<f64>,
}

impl Hann {
    pub(crate) fn new(length: usize) -> Self {
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        Self { fft, window: hann(length) }
    }

    /// Returns Σ w².
    pub(crate) fn energy(&self) -> f64 {
        self.window.iter().map(|w| w * w).sum()
    }

    /// Returns the spectrum of rows of the length of the window, without their mean.
    pub(crate) fn spectrum(&self, x: &[f64]) -> Vec<Complex<f64>> {
        self.windowed_spectrum(&self.window, x)
    }

    /// Returns the spectrum of fewer rows with a window of their length, at the same frequencies, and Σ w² of that
    /// window.
    pub(crate) fn short(&self, x: &[f64]) -> (Vec<Complex<f64>>, f64) {
        let window = hann(x.len().min(self.window.len()));
        (self.windowed_spectrum(&window, x), window.iter().map(|w| w * w).sum())
    }

    fn windowed_spectrum(&self, window: &[f64], x: &[f64]) -> Vec<Complex<f64>> {
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        let mut windowed: Vec<f64> = x.iter().zip(window).map(|(x, w)| (x - mean) * w).collect();
        windowed.resize(self.window.len(), 0.0);
        let mut spectrum = self.fft.make_output_vec();
        // Cannot fail: the lengths come from the planner.
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
            // No response where the drive is only rounding error.
            if self.uu[i] <= 1e-20 * most_u {
                return None;
            }
            let h = self.yu[i] / self.uu[i];
            let power = self.uu[i] * self.yy[i];
            let coherence = if power > 0.0 { (self.yu[i].norm_sqr() / power).min(1.0) } else { 0.0 };
            let relative = ((1.0 - coherence) / (2.0 * effective * coherence.max(1e-12))).sqrt();
            Some(ResponseLine::new(i as f64 / (length as f64 * period), h, coherence, relative))
        };
        // The window spreads the removed mean over the first line.
        let lines = (2..length.div_ceil(2)).filter_map(line).collect();
        let (window_s, averages) = (length as f64 * period, self.count);
        let method = Method::Welch { window_s, averages, effective_averages: effective };
        Ok(FrequencyResponse { method, lines })
    }
}
