//! How the output answers a change of the learned reference: the model's inverse and the actuator together, which a true model makes 1 at all
//! frequencies.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::bands::{Bands, Width};
use super::rational::{Equations, Rational, misfit};

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
/// Delays that are tried \[samples\], and their step.
const DELAYS: (i32, i32) = (-20, 200);
const DELAY_STEP: f64 = 0.25;

/// A pair of spectra, of a learned reference (or its change) and the output (or its change).
#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    pub(super) from: &'a [Complex<f64>],
    pub(super) to: &'a [Complex<f64>],
}

impl Response {
    /// From the first pass and the changes since: a rational response with a delay, by weighted least squares over all frequencies, and of
    /// that what each band says itself. `noise` is the power of what does not repeat in each pair, `length` the number of rows of which the spectra
    /// are.
    pub(super) fn of(bands: &Bands, pairs: &[(Pair<'_>, Vec<f64>)], length: usize) -> Self {
        let Some((first, noise)) = pairs.first() else {
            return Self { gain: Vec::new(), variance: Vec::new(), mean: 1.0 };
        };
        let plain = gain_and_delay(bands, first, noise, length);
        let mut response = plain.clone();
        let powers = |response: &Rational| -> Vec<Vec<f64>> {
            pairs.iter().map(|(pair, noise)| misfits(bands, pair, response, noise, length)).collect()
        };
        for _ in 0..2 {
            let powers = powers(&response);
            let equations: Vec<Equations<'_>> = pairs
                .iter()
                .zip(&powers)
                .map(|((pair, _), power)| Equations { from: pair.from, to: pair.to, noise: power })
                .collect();
            response = Rational::fit(&equations, length, &plain);
        }
        let middle = bands.real_sums(Width::Narrow, |bin| bin as f64);
        let counts = bands.real_sums(Width::Narrow, |_| 1.0);
        let powers = powers(&response);
        let (mut left, mut input) = (vec![0.0; counts.len()], vec![0.0; counts.len()]);
        for ((pair, noise), power) in pairs.iter().zip(&powers) {
            let known = misfit(&Equations { from: pair.from, to: pair.to, noise: power }, length, &response);
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
        let known = Self { gain, variance, mean: 1.0 }.with(bands, first, &powers[0]);
        let mut all = pairs
            .iter()
            .zip(&powers)
            .skip(1)
            .fold(known, |known, ((change, _), power)| known.with(bands, change, power));
        // A mean is a hysteresis at rest: what is right over the whole travel is right for it.
        all.mean = plain.at(0.0).re;
        all
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
fn gain_and_delay(bands: &Bands, pair: &Pair<'_>, noise: &[f64], length: usize) -> Rational {
    let bins = pair.from.len();
    let turned = |bin: usize, delay: f64| Complex::from_polar(1.0, -TAU * bin as f64 / length as f64 * delay);
    let (mut gain, mut delay) = (1.0, 0.0);
    for _ in 0..3 {
        let power = misfits(bands, pair, &Rational::plain(gain, delay), noise, length);
        let cross: Vec<Complex<f64>> = (1..bins).map(|bin| pair.to[bin] * pair.from[bin].conj() / power[bin]).collect();
        let along = |delay: f64| cross.iter().zip(1..).map(|(c, bin)| (c * turned(bin, delay).conj()).re).sum::<f64>();
        let tried = (DELAYS.0 * 4..=DELAYS.1 * 4).map(|k| DELAY_STEP * f64::from(k));
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
    let left = misfit(&Equations { from: pair.from, to: pair.to, noise }, length, response);
    let weighted = bands.real_sums(Width::Wide, |bin| left[bin] * input(bin));
    let weights = bands.real_sums(Width::Wide, input);
    (0..pair.from.len())
        .map(|bin| {
            let band = bands.of(bin);
            noise[bin].max(weighted[band] / weights[band].max(f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE)
        })
        .collect()
}
