//! Rational response with a delay, as of a mode, a lag or an amplifier that is missing in the model.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector};

/// Highest order: two modes.
const MAX_ORDER: usize = 4;
/// Iterations of the weights (Sanathanan and Koerner 1963).
const ITERATIONS: usize = 12;

/// A pair of spectra, of the predicted and the measured output, or of their changes.
#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    pub(super) from: &'a [Complex<f64>],
    pub(super) to: &'a [Complex<f64>],
}

impl Pair<'_> {
    /// Returns |Y − D V|² at each frequency except 0.
    pub(super) fn misfit(&self, length: usize, response: &Rational) -> Vec<f64> {
        let at = |bin: usize| {
            let omega = TAU * bin as f64 / length as f64;
            if bin == 0 { 0.0 } else { (self.to[bin] - response.at(omega) * self.from[bin]).norm_sqr() }
        };
        (0..self.from.len()).map(at).collect()
    }
}

/// D(z) = B(z) / A(z) · z^{−delay} with z = e^{jω}.
#[derive(Clone, Debug)]
pub(super) struct Rational {
    numerator: Vec<f64>,
    /// Coefficients after the leading 1.
    denominator: Vec<f64>,
    /// Delay \[samples\].
    delay: f64,
}

impl Rational {
    /// Returns a gain with a delay.
    pub(super) fn constant(gain: f64, delay: f64) -> Self {
        Self { numerator: vec![gain], denominator: Vec::new(), delay }
    }

    /// Returns the response at a frequency \[rad/sample\].
    pub(super) fn at(&self, omega: f64) -> Complex<f64> {
        let rotation = |k: usize| Complex::from_polar(1.0, -omega * k as f64);
        let numerator: Complex<f64> = self.numerator.iter().enumerate().map(|(k, b)| rotation(k) * *b).sum();
        let denominator: Complex<f64> =
            Complex::new(1.0, 0.0) + (1..).zip(&self.denominator).map(|(k, a)| rotation(k) * *a).sum::<Complex<f64>>();
        numerator / denominator * Complex::from_polar(1.0, -omega * self.delay)
    }

    /// Fits a gain with the given delay and rational responses with that delay. Returns the one with the smallest
    /// information criterion (Schwarz 1978). Each pair has the power of the disturbance of its output.
    pub(super) fn fit(all: &[(Pair<'_>, Vec<f64>)], length: usize, constant: &Self) -> Self {
        let weighted_misfit = |r: &Self| -> f64 {
            all.iter()
                .map(|(pair, noise)| pair.misfit(length, r).iter().zip(noise).map(|(m, n)| m / n).sum::<f64>())
                .sum()
        };
        let rows: usize = all.iter().map(|(pair, _)| 2 * pair.from.len()).sum();
        // The residual is not white noise of known power, so its scale is estimated too.
        let criterion = |misfit: f64, count: usize| {
            rows as f64 * misfit.max(f64::MIN_POSITIVE).ln() + count as f64 * (rows as f64).ln()
        };
        let (mut best, mut least) = (constant.clone(), criterion(weighted_misfit(constant), 2));
        for order in [1, 2, MAX_ORDER] {
            if let Some(found) = Self::of_order(all, length, order, constant.delay) {
                let found_criterion = criterion(weighted_misfit(&found), 2 * order + 2);
                if found_criterion < least {
                    (best, least) = (found, found_criterion);
                }
            }
        }
        best
    }

    /// Minimises A Y − B V by least squares, weighted with the A of the previous iteration.
    fn of_order(all: &[(Pair<'_>, Vec<f64>)], length: usize, order: usize, delay: f64) -> Option<Self> {
        let unknowns = 2 * order + 1;
        let mut now = Self { numerator: vec![1.0], denominator: Vec::new(), delay };
        for _ in 0..ITERATIONS {
            let (mut normal, mut right) = (DMatrix::<f64>::zeros(unknowns, unknowns), DVector::<f64>::zeros(unknowns));
            for (e, noise) in all {
                for (bin, noise) in noise.iter().enumerate().skip(1) {
                    let omega = TAU * bin as f64 / length as f64;
                    let rotation = |k: usize| Complex::from_polar(1.0, -omega * k as f64);
                    let a: Complex<f64> = Complex::new(1.0, 0.0)
                        + (1..).zip(&now.denominator).map(|(k, a)| rotation(k) * *a).sum::<Complex<f64>>();
                    let weight = 1.0 / (a.norm_sqr() * noise).max(f64::MIN_POSITIVE);
                    let late = e.from[bin] * Complex::from_polar(1.0, -omega * delay);
                    let row: Vec<Complex<f64>> = (0..=order)
                        .map(|k| late * rotation(k))
                        .chain((1..=order).map(|k| -e.to[bin] * rotation(k)))
                        .collect();
                    for (i, x) in row.iter().enumerate() {
                        right[i] += weight * (x.conj() * e.to[bin]).re;
                        for (j, z) in row.iter().enumerate().take(i + 1) {
                            normal[(i, j)] += weight * (x.conj() * z).re;
                        }
                    }
                }
            }
            normal.fill_upper_triangle_with_lower_triangle();
            // Scaled, because the columns differ in size.
            let scale = DVector::from_iterator(
                unknowns,
                (0..unknowns).map(|k| 1.0 / normal[(k, k)].max(f64::MIN_POSITIVE).sqrt()),
            );
            let scaled = DMatrix::from_fn(unknowns, unknowns, |i, j| {
                normal[(i, j)] * scale[i] * scale[j] + if i == j { 1e-10 } else { 0.0 }
            });
            let solved = scaled.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale);
            if solved.iter().any(|x| !x.is_finite()) {
                return None;
            }
            now.numerator = solved.rows(0, order + 1).iter().copied().collect();
            now.denominator = solved.rows(order + 1, order).iter().copied().collect();
        }
        Some(now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_and_a_delay_are_found_in_noise() {
        let length = 2000;
        let truth = Rational { numerator: vec![0.03, 0.02, 0.0], denominator: vec![-1.90, 0.97], delay: 3.3 };
        let omega = |bin: usize| TAU * bin as f64 / length as f64;
        let mut seed = 1u64;
        let mut noise = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / f64::from(1u32 << 31) - 0.5
        };
        let from: Vec<Complex<f64>> =
            (0..=1000).map(|bin| Complex::new(1.0 + noise(), noise()) * (100.0 / (1.0 + bin as f64))).collect();
        let to: Vec<Complex<f64>> =
            (0..=1000).map(|bin| truth.at(omega(bin)) * from[bin] + Complex::new(noise(), noise()) * 0.01).collect();
        let power = vec![1e-4 / 6.0; 1001];
        let equations = [(Pair { from: &from, to: &to }, power)];
        let found = Rational::fit(&equations, length, &Rational::constant(1.0, 3.3));
        assert_eq!(found.denominator.len(), 2);
        for bin in [5, 50, 80, 100, 150] {
            let (a, b) = (truth.at(omega(bin)), found.at(omega(bin)));
            assert!((a - b).norm() < 0.03 * a.norm(), "{bin}: {a} {b}");
        }
    }
}
