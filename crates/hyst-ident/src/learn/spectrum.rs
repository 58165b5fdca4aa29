//! Spectra of one play of a reference.

use std::sync::Arc;

use nalgebra::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

/// Rows of the transition from the last value to the first one, as a share of the play. Without it a difference between
/// the ends spreads over all frequencies.
const TRANSITION_SHARE: f64 = 0.125;

/// Discrete Fourier transform of a play and the transition after it.
pub(super) struct Spectrum {
    rows: usize,
    length: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl Spectrum {
    /// Creates the transform for plays of `rows` rows.
    pub(super) fn new(rows: usize) -> Self {
        let length = rows + ((TRANSITION_SHARE * rows as f64) as usize).max(8);
        let mut planner = RealFftPlanner::new();
        Self { rows, length, forward: planner.plan_fft_forward(length), inverse: planner.plan_fft_inverse(length) }
    }

    /// Returns the number of rows with the transition.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Returns the spectrum of values over the whole length.
    pub(super) fn whole(&self, values: &[f64]) -> Vec<Complex<f64>> {
        let (mut values, mut spectrum) = (values.to_vec(), self.forward.make_output_vec());
        // Cannot fail: the lengths come from the plan.
        let _ = self.forward.process(&mut values, &mut spectrum);
        spectrum
    }

    /// Returns the number of frequencies, from 0 to half of the sample rate.
    pub(super) fn bins(&self) -> usize {
        self.length / 2 + 1
    }

    /// Returns the spectrum of a play.
    pub(super) fn of(&self, values: &[f64]) -> Vec<Complex<f64>> {
        let mut extended = values.to_vec();
        let (first, last) = (values.first().copied().unwrap_or(0.0), values.last().copied().unwrap_or(0.0));
        let transition = self.length - self.rows;
        extended.extend((1..=transition).map(|k| {
            let phase = std::f64::consts::PI * k as f64 / (transition + 1) as f64;
            last + (first - last) * (0.5 - 0.5 * phase.cos())
        }));
        self.whole(&extended)
    }

    /// Returns the play of a spectrum, without the transition.
    pub(super) fn to_time(&self, spectrum: Vec<Complex<f64>>) -> Vec<f64> {
        let mut values = self.whole_to_time(spectrum);
        values.truncate(self.rows);
        values
    }

    /// Returns the values of a spectrum over the whole length.
    pub(super) fn whole_to_time(&self, mut spectrum: Vec<Complex<f64>>) -> Vec<f64> {
        let mut values = self.inverse.make_output_vec();
        // Real at both ends, as for a real signal.
        if let Some(first) = spectrum.first_mut() {
            first.im = 0.0;
        }
        if self.length.is_multiple_of(2)
            && let Some(last) = spectrum.last_mut()
        {
            last.im = 0.0;
        }
        // Cannot fail: the lengths come from the plan.
        let _ = self.inverse.process(&mut spectrum, &mut values);
        values.iter_mut().for_each(|value| *value /= self.length as f64);
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_transform_recovers_the_values() {
        for rows in [9, 64, 1001] {
            let values: Vec<f64> = (0..rows).map(|k| (f64::from(k) * 0.37).sin() + 0.01 * f64::from(k)).collect();
            let spectrum = Spectrum::new(values.len());
            let recovered = spectrum.to_time(spectrum.of(&values));
            assert!(values.iter().zip(&recovered).all(|(a, b)| (a - b).abs() < 1e-12), "{rows}");
        }
    }
}
