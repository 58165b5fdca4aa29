//! Power spectral density of a signal.

use nalgebra::Complex;

use super::scene::settled_segments;
use crate::Samples;
use crate::linear::{Hann, windows};

/// One-sided power spectral density.
pub(super) struct Density {
    /// Frequencies \[Hz\], evenly spaced.
    pub(super) hz: Vec<f64>,
    /// Power per Hz \[unit²/Hz\].
    pub(super) power: Vec<f64>,
}

/// Number of windows that are averaged if the record is long enough.
const WINDOWS: usize = 24;
/// Minimum number of rows of a window.
const MIN_WINDOW_ROWS: usize = 32;

impl Density {
    /// Returns the density of a signal over the settled rows by Welch's method, with about 24 windows in the record.
    pub(super) fn of(samples: &Samples, signal: &[f64]) -> Option<Self> {
        Self::with_windows(samples, signal, 2 * samples.len() / (WINDOWS + 1))
    }

    /// Returns the density with the finest lines that the longest segment allows.
    pub(super) fn finest(samples: &Samples, signal: &[f64]) -> Option<Self> {
        Self::with_windows(samples, signal, usize::MAX)
    }

    fn with_windows(samples: &Samples, signal: &[f64], length: usize) -> Option<Self> {
        let samples = samples.clone().of_one_period();
        let segments = settled_segments(&samples);
        let longest = segments.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
        // An even length, never longer than a segment.
        let length = length.min(longest) / 2 * 2;
        if length < MIN_WINDOW_ROWS {
            return None;
        }
        let hann = Hann::new(length);
        let mut power = vec![0.0; length / 2 + 1];
        let mut energy = 0.0;
        let mut add = |spectrum: &[Complex<f64>], of: f64| {
            power.iter_mut().zip(spectrum).for_each(|(p, c)| *p += c.norm_sqr());
            energy += of;
        };
        for window in windows(&segments, length) {
            add(&hann.spectrum(&signal[window]), hann.energy());
        }
        // A segment that is too short for a window is one short window.
        for segment in segments.iter().filter(|s| (MIN_WINDOW_ROWS..length).contains(&s.len())) {
            let (spectrum, energy) = hann.short(&signal[segment.clone()]);
            add(&spectrum, energy);
        }
        let scale = 2.0 * samples.period / energy;
        let step = 1.0 / (length as f64 * samples.period);
        // The window spreads the removed mean over the first line, and the last line is only half a line.
        let lines = 2..length / 2;
        let hz = lines.clone().map(|i| i as f64 * step).collect();
        Some(Self { hz, power: power[lines].iter().map(|p| p * scale).collect() })
    }

    /// Returns the spacing of the lines \[Hz\].
    pub(super) fn step(&self) -> f64 {
        self.hz.get(1).zip(self.hz.first()).map_or(0.0, |(b, a)| b - a)
    }

    /// Returns the square roots of the densities \[unit/√Hz\].
    pub(super) fn amplitudes(&self) -> Vec<f64> {
        self.power.iter().map(|p| p.sqrt()).collect()
    }

    /// Returns the power between two frequencies \[unit²\].
    pub(super) fn between(&self, low: f64, high: f64) -> f64 {
        let inside = self.hz.iter().zip(&self.power).filter(|(hz, _)| **hz >= low && **hz < high);
        inside.map(|(_, p)| p).sum::<f64>() * self.step()
    }
}

/// Returns the density of white noise with standard deviation `sigma`, sampled every `period` \[unit/√Hz\].
pub(super) fn white(sigma: f64, period: f64) -> f64 {
    sigma * (2.0 * period).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{noise, samples_of};
    use super::*;

    #[test]
    fn noise_has_its_density_and_a_tone_its_power() {
        let (h, n, sigma, amplitude) = (1e-3, 20_000, 0.02, 0.3);
        // The last segment is shorter than a window.
        let samples = samples_of(h, &[vec![0.0; n], vec![0.0; n / 2], vec![0.0; n / 20]]);
        let tone = |t: f64| amplitude * (std::f64::consts::TAU * 40.3 * t).sin();
        let signal: Vec<f64> = samples.time.iter().zip(noise(1)).map(|(t, e)| tone(*t) + sigma * e).collect();
        let density = Density::of(&samples, &signal).unwrap();
        let floor = density.amplitudes();
        let far: Vec<f64> = density.hz.iter().zip(&floor).filter(|(hz, _)| **hz > 100.0).map(|(_, a)| *a).collect();
        let mean = far.iter().sum::<f64>() / far.len() as f64;
        assert!((mean / white(sigma, h) - 1.0).abs() < 0.03, "{mean}");
        let power = density.between(38.0, 43.0);
        assert!((power / (0.5 * amplitude * amplitude) - 1.0).abs() < 0.02, "{power}");
        assert!(Density::finest(&samples, &signal).unwrap().step() < density.step());
    }
}
