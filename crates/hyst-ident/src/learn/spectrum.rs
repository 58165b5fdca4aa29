//! Spectra of one play of a reference.

use std::sync::Arc;

use nalgebra::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

/// Rows of the bridge from the last value to the first one, as a share of the play: without it a difference between the ends would
/// spread over all frequencies.
const BRIDGE: f64 = 0.125;

/// Discrete Fourier transform of a play and the bridge behind it.
pub(super) struct Spectrum {
    rows: usize,
    length: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl Spectrum {
    /// For plays of `rows` rows.
    pub(super) fn new(rows: usize) -> Self {
        let length = rows + ((BRIDGE * rows as f64) as usize).max(8);
        let mut planner = RealFftPlanner::new();
        Self { rows, length, forward: planner.plan_fft_forward(length), inverse: planner.plan_fft_inverse(length) }
    }

    /// Rows with the bridge.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Spectrum of values that fill the whole length.
    pub(super) fn whole(&self, values: &[f64]) -> Vec<Complex<f64>> {
        let (mut values, mut spectrum) = (values.to_vec(), self.forward.make_output_vec());
        // The lengths are those of the plan.
        let _ = self.forward.process(&mut values, &mut spectrum);
        spectrum
    }

    /// Number of frequencies, from 0 to half the sample rate.
    pub(super) fn bins(&self) -> usize {
        self.length / 2 + 1
    }

    /// From time to frequency.
    pub(super) fn of(&self, values: &[f64]) -> Vec<Complex<f64>> {
        let mut extended = values.to_vec();
        let (first, last) = (values.first().copied().unwrap_or(0.0), values.last().copied().unwrap_or(0.0));
        let bridge = self.length - self.rows;
        extended.extend((1..=bridge).map(|k| {
            let phase = std::f64::consts::PI * k as f64 / (bridge + 1) as f64;
            last + (first - last) * (0.5 - 0.5 * phase.cos())
        }));
        self.whole(&extended)
    }

    /// From frequency to time; the bridge is dropped.
    pub(super) fn back(&self, spectrum: Vec<Complex<f64>>) -> Vec<f64> {
        let mut values = self.whole_back(spectrum);
        values.truncate(self.rows);
        values
    }

    /// From frequency to time, over the whole length.
    pub(super) fn whole_back(&self, mut spectrum: Vec<Complex<f64>>) -> Vec<f64> {
        let mut values = self.inverse.make_output_vec();
        // Those of a real signal.
        if let Some(first) = spectrum.first_mut() {
            first.im = 0.0;
        }
        if self.length.is_multiple_of(2)
            && let Some(last) = spectrum.last_mut()
        {
            last.im = 0.0;
        }
        // The lengths are those of the plan.
        let _ = self.inverse.process(&mut spectrum, &mut values);
        values.iter_mut().for_each(|value| *value /= self.length as f64);
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_is_the_same() {
        for rows in [9, 64, 1001] {
            let values: Vec<f64> = (0..rows).map(|k| (f64::from(k) * 0.37).sin() + 0.01 * f64::from(k)).collect();
            let spectrum = Spectrum::new(values.len());
            let back = spectrum.back(spectrum.of(&values));
            assert!(values.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-12), "{rows}");
        }
    }
}
