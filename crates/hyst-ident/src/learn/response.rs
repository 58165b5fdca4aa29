//! How the output answers a change of the learned reference: the model's inverse and the actuator together, which a true model makes 1 at all
//! frequencies.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::bands::{Bands, Width};
use super::rational::{Pair, Rational};
use super::spectrum::Spectrum;

/// The response in each band, and the variance of that.
#[derive(Clone, Debug)]
pub(super) struct Response {
    /// D.
    pub(super) gain: Vec<Complex<f64>>,
    pub(super) variance: Vec<f64>,
    /// Of the mean.
    mean: f64,
}

/// Standard deviation of the response about its rational form, besides what that leaves unexplained, as a share of it.
const SPREAD: f64 = 0.05;
/// The slope of a hysteresis is not one number: share of a change by which its answer differs from place to place.
const SLOPE: f64 = 0.15;
/// Delays that are tried \[samples\], and the step of their parts.
const DELAYS: (i32, i32) = (-20, 200);
const DELAY_STEP: f64 = 0.25;

impl Response {
    /// From the first pass and the changes since, each with the power of what does not repeat in it: a rational response with a delay, by weighted
    /// least squares over all frequencies, and of that what each band says itself.
    pub(super) fn of(bands: &Bands, pairs: &[(Pair<'_>, Vec<f64>)], spectrum: &Spectrum) -> Self {
        let Some((first, noise)) = pairs.first() else {
            return Self { gain: Vec::new(), variance: Vec::new(), mean: 1.0 };
        };
        let length = spectrum.length();
        let plain = gain_and_delay(bands, first, noise, spectrum);
        let weighed = |response: &Rational| -> Vec<(Pair<'_>, Vec<f64>)> {
            pairs.iter().map(|(pair, noise)| (*pair, misfits(bands, pair, response, noise, length))).collect()
        };
        let mut response = plain.clone();
        for _ in 0..2 {
            response = Rational::fit(&weighed(&response), length, &plain);
        }
        let middle = bands.real_sums(Width::Narrow, |bin| bin as f64);
        let counts = bands.real_sums(Width::Narrow, |_| 1.0);
        let weighed = weighed(&response);
        let (mut left, mut input) = (vec![0.0; counts.len()], vec![0.0; counts.len()]);
        for (pair, noise) in pairs {
            let known = pair.misfit(length, &response);
            let weight = |bin: usize| 1.0 / noise[bin].max(f64::MIN_POSITIVE);
            let (l, i) = (
                bands.real_sums(Width::Wide, |bin| known[bin] * weight(bin)),
                bands.real_sums(Width::Wide, |bin| pair.from[bin].norm_sqr() * weight(bin)),
            );
            left.iter_mut().zip(l).for_each(|(sum, l)| *sum += l);
            input.iter_mut().zip(i).for_each(|(sum, i)| *sum += i);
        }
        let prior = |band: usize| {
            let bin = if counts[band] > 0.0 { middle[band] / counts[band] } else { 0.0 };
            let d = response.at(TAU * bin / length as f64);
            (d, d.norm_sqr() * SPREAD * SPREAD + left[band] / input[band].max(f64::MIN_POSITIVE))
        };
        let (gain, mut variance): (Vec<_>, Vec<f64>) = (0..counts.len()).map(prior).unzip();
        // What is right at one frequency is right below it: what a model lacks shows more the faster it goes.
        let mut least = f64::INFINITY;
        for (variance, d) in variance.iter_mut().zip(&gain).rev() {
            let size = d.norm_sqr().max(f64::MIN_POSITIVE);
            least = least.min(*variance / size);
            *variance = least * size;
        }
        // A mean is a hysteresis at rest: what is right over the whole travel is right for it.
        let begun = Self { gain, variance, mean: plain.at(0.0).re };
        weighed.iter().fold(begun, |known, (pair, power)| known.with(bands, pair, power))
    }

    /// With what each band says of D by least squares, Y = D V, where Y has the power `noise` besides.
    fn with(mut self, bands: &Bands, pair: &Pair<'_>, noise: &[f64]) -> Self {
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

    /// What to multiply an error by: the change with the least expected square of what is left of it, given the variance.
    pub(super) fn step(&self, bin: usize, band: usize) -> Complex<f64> {
        if bin == 0 {
            return Complex::new(1.0 / self.mean.max(0.1), 0.0);
        }
        let (d, variance) = (self.gain[band], self.variance[band] + SLOPE * SLOPE * self.gain[band].norm_sqr());
        d.conj() / (d.norm_sqr() + variance).max(f64::MIN_POSITIVE)
    }
}

/// D = g e^{−jωτ} with gain and delay by least squares over all frequencies, each with the power of what is left there.
fn gain_and_delay(bands: &Bands, pair: &Pair<'_>, noise: &[f64], spectrum: &Spectrum) -> Rational {
    let (bins, length) = (pair.from.len(), spectrum.length());
    let turned = |bin: usize, delay: f64| Complex::from_polar(1.0, -TAU * bin as f64 / length as f64 * delay);
    let (mut gain, mut delay) = (1.0, 0.0);
    for _ in 0..3 {
        let power = misfits(bands, pair, &Rational::plain(gain, delay), noise, length);
        let mut cross: Vec<Complex<f64>> =
            (0..bins).map(|bin| pair.to[bin] * pair.from[bin].conj() / power[bin]).collect();
        cross[0] = Complex::new(0.0, 0.0);
        let along = |delay: f64| cross.iter().zip(0..).map(|(c, bin)| (c * turned(bin, delay).conj()).re).sum::<f64>();
        // Whole samples from the correlation in time, parts of them about the best.
        let lags = spectrum.whole_back(cross.clone());
        let of = |lag: i32| lags[lag.rem_euclid(length as i32) as usize];
        let whole = (DELAYS.0..=DELAYS.1).fold(0, |best, lag| if of(lag) > of(best) { lag } else { best });
        let tried = (-4..=4).map(|k| f64::from(whole) + DELAY_STEP * f64::from(k));
        let best = tried.map(|d| (along(d), d)).fold((f64::MIN, 0.0), |best, d| if d.0 > best.0 { d } else { best });
        // The parabola through it and its neighbours.
        let (left, right) = (along(best.1 - DELAY_STEP), along(best.1 + DELAY_STEP));
        let bend = left - 2.0 * best.0 + right;
        delay = best.1 + if bend < 0.0 { 0.5 * DELAY_STEP * (left - right) / bend } else { 0.0 };
        let own: f64 = (1..bins).map(|bin| pair.from[bin].norm_sqr() / power[bin]).sum();
        gain = (along(delay) / own.max(f64::MIN_POSITIVE)).max(0.0);
    }
    Rational::plain(gain, delay)
}

/// Power of what a response leaves of the output, where the input has its power, and of the noise.
fn misfits(bands: &Bands, pair: &Pair<'_>, response: &Rational, noise: &[f64], length: usize) -> Vec<f64> {
    let input = |bin: usize| pair.from[bin].norm_sqr();
    let left = pair.misfit(length, response);
    let weighted = bands.real_sums(Width::Wide, |bin| left[bin] * input(bin));
    let weights = bands.real_sums(Width::Wide, input);
    (0..pair.from.len())
        .map(|bin| {
            let band = bands.of(bin);
            noise[bin].max(weighted[band] / weights[band].max(f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE)
        })
        .collect()
}
