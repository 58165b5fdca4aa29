//! Estimates the response of the measured output to a change of the predicted output. It is 1 at all frequencies for an
//! exact model.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::bands::{Bands, Width};
use super::rational::{Pair, Rational};
use super::spectrum::Spectrum;

/// The response in each band, and its variance.
#[derive(Clone, Debug)]
pub(super) struct Response {
    /// D.
    pub(super) gain: Vec<Complex<f64>>,
    pub(super) variance: Vec<f64>,
    /// Response at frequency 0.
    mean: f64,
}

/// Standard deviation of the response about its rational form, in addition to the misfit of that form, as a share of
/// it.
const RATIONAL_SPREAD: f64 = 0.05;
/// Standard deviation of the slope of a hysteresis between its states, as a share of the slope.
const SLOPE_SPREAD: f64 = 0.15;
/// Range of the candidate delays, and the step of their fractions \[samples\].
const DELAY_RANGE: (i32, i32) = (-20, 200);
const DELAY_STEP: f64 = 0.25;

impl Response {
    /// Estimates the response from the first pass and the changes between passes, each with the power of its scatter: a
    /// rational response with a delay by weighted least squares over all frequencies, corrected in each band by its own
    /// data.
    pub(super) fn of(bands: &Bands, pairs: &[(Pair<'_>, Vec<f64>)], spectrum: &Spectrum) -> Self {
        let Some((first, noise)) = pairs.first() else {
            return Self { gain: Vec::new(), variance: Vec::new(), mean: 1.0 };
        };
        let length = spectrum.length();
        let constant = gain_and_delay(bands, first, noise, spectrum);
        let with_power = |response: &Rational| -> Vec<(Pair<'_>, Vec<f64>)> {
            pairs.iter().map(|(pair, noise)| (*pair, misfit_power(bands, pair, response, noise, length))).collect()
        };
        let mut response = constant.clone();
        for _ in 0..2 {
            response = Rational::fit(&with_power(&response), length, &constant);
        }
        let middle = bands.real_sums(Width::Narrow, |bin| bin as f64);
        let counts = bands.real_sums(Width::Narrow, |_| 1.0);
        let pairs_with_power = with_power(&response);
        let (mut misfits, mut inputs) = (vec![0.0; counts.len()], vec![0.0; counts.len()]);
        for (pair, noise) in pairs {
            let misfit = pair.misfit(length, &response);
            let weight = |bin: usize| 1.0 / noise[bin].max(f64::MIN_POSITIVE);
            let (misfit, input) = (
                bands.real_sums(Width::Wide, |bin| misfit[bin] * weight(bin)),
                bands.real_sums(Width::Wide, |bin| pair.from[bin].norm_sqr() * weight(bin)),
            );
            misfits.iter_mut().zip(misfit).for_each(|(sum, m)| *sum += m);
            inputs.iter_mut().zip(input).for_each(|(sum, i)| *sum += i);
        }
        let prior = |band: usize| {
            let bin = if counts[band] > 0.0 { middle[band] / counts[band] } else { 0.0 };
            let d = response.at(TAU * bin / length as f64);
            (d, d.norm_sqr() * RATIONAL_SPREAD * RATIONAL_SPREAD + misfits[band] / inputs[band].max(f64::MIN_POSITIVE))
        };
        let (gain, mut variance): (Vec<_>, Vec<f64>) = (0..counts.len()).map(prior).unzip();
        // The relative variance must not fall with frequency: missing effects have more influence at high frequencies.
        let mut least = f64::INFINITY;
        for (variance, d) in variance.iter_mut().zip(&gain).rev() {
            let size = d.norm_sqr().max(f64::MIN_POSITIVE);
            least = least.min(*variance / size);
            *variance = least * size;
        }
        // At frequency 0 the gain over the whole travel applies.
        let initial = Self { gain, variance, mean: constant.at(0.0).re };
        pairs_with_power.iter().fold(initial, |response, (pair, power)| response.updated(bands, pair, power))
    }

    /// Updates D in each band by least squares, Y = D V, where Y contains a disturbance of the power `noise`.
    fn updated(mut self, bands: &Bands, pair: &Pair<'_>, noise: &[f64]) -> Self {
        let weight = |bin: usize| 1.0 / noise[bin].max(f64::MIN_POSITIVE);
        let cross = bands.sums(Width::Narrow, |bin| pair.to[bin] * pair.from[bin].conj() * weight(bin));
        let own = bands.real_sums(Width::Narrow, |bin| pair.from[bin].norm_sqr() * weight(bin));
        for (k, (cross, own)) in cross.into_iter().zip(own).enumerate() {
            let known = 1.0 / self.variance[k].max(f64::MIN_POSITIVE);
            self.gain[k] = (self.gain[k] * known + cross) / (known + own);
            self.variance[k] = 1.0 / (known + own);
        }
        self
    }

    /// Returns the factor L for an error: the change with the smallest expected square of the remaining error.
    pub(super) fn step(&self, bin: usize, band: usize) -> Complex<f64> {
        if bin == 0 {
            return Complex::new(1.0 / self.mean.max(0.1), 0.0);
        }
        let (d, variance) =
            (self.gain[band], self.variance[band] + SLOPE_SPREAD * SLOPE_SPREAD * self.gain[band].norm_sqr());
        d.conj() / (d.norm_sqr() + variance).max(f64::MIN_POSITIVE)
    }
}

/// Fits D = g e^{−jωτ} by least squares over all frequencies, weighted with the power of the misfit.
fn gain_and_delay(bands: &Bands, pair: &Pair<'_>, noise: &[f64], spectrum: &Spectrum) -> Rational {
    let (bins, length) = (pair.from.len(), spectrum.length());
    let rotation = |bin: usize, delay: f64| Complex::from_polar(1.0, -TAU * bin as f64 / length as f64 * delay);
    let (mut gain, mut delay) = (1.0, 0.0);
    for _ in 0..3 {
        let power = misfit_power(bands, pair, &Rational::constant(gain, delay), noise, length);
        let mut cross: Vec<Complex<f64>> =
            (0..bins).map(|bin| pair.to[bin] * pair.from[bin].conj() / power[bin]).collect();
        cross[0] = Complex::new(0.0, 0.0);
        let correlation =
            |delay: f64| cross.iter().zip(0..).map(|(c, bin)| (c * rotation(bin, delay).conj()).re).sum::<f64>();
        // Integer samples from the correlation over time, then fractions about the best one.
        let lags = spectrum.whole_to_time(cross.clone());
        let of = |lag: i32| lags[lag.rem_euclid(length as i32) as usize];
        let whole = (DELAY_RANGE.0..=DELAY_RANGE.1).fold(0, |best, lag| if of(lag) > of(best) { lag } else { best });
        let tried = (-4..=4).map(|k| f64::from(whole) + DELAY_STEP * f64::from(k));
        let best =
            tried.map(|d| (correlation(d), d)).fold((f64::MIN, 0.0), |best, d| if d.0 > best.0 { d } else { best });
        // The vertex of the parabola through the best one and its neighbours.
        let (left, right) = (correlation(best.1 - DELAY_STEP), correlation(best.1 + DELAY_STEP));
        let curvature = left - 2.0 * best.0 + right;
        delay = best.1 + if curvature < 0.0 { 0.5 * DELAY_STEP * (left - right) / curvature } else { 0.0 };
        let own: f64 = (1..bins).map(|bin| pair.from[bin].norm_sqr() / power[bin]).sum();
        gain = (correlation(delay) / own.max(f64::MIN_POSITIVE)).max(0.0);
    }
    Rational::constant(gain, delay)
}

/// Returns the power of the misfit of a response, weighted with the power of the input, but at least that of the noise.
fn misfit_power(bands: &Bands, pair: &Pair<'_>, response: &Rational, noise: &[f64], length: usize) -> Vec<f64> {
    let input = |bin: usize| pair.from[bin].norm_sqr();
    let misfit = pair.misfit(length, response);
    let weighted = bands.real_sums(Width::Wide, |bin| misfit[bin] * input(bin));
    let weights = bands.real_sums(Width::Wide, input);
    (0..pair.from.len())
        .map(|bin| {
            let band = bands.of(bin);
            noise[bin].max(weighted[band] / weights[band].max(f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE)
        })
        .collect()
}
