//! Weights of the sampled fractional derivative.

use crate::Complex;
use crate::error::{Error, within};

/// Order of accuracy of the sampled derivative `D^μ g ≈ p^(−μ) Σ ωₖ g(t − kp)`, p the sample period.
///
/// The ωₖ are the coefficients of a generating function in z⁻¹. At the angular frequency ω the relative error of the
/// derivative is about `μ ωp/2` (only phase) for the first order, and `μ (ωp)²/3` for the second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum GlOrder {
    /// Grünwald-Letnikov: `(1 − z⁻¹)^μ`, Zhu et al., eq. 12 and 13.
    #[default]
    First,
    /// The second-order form with the BDF2 formula: `(3/2 − 2z⁻¹ + z⁻²/2)^μ` (Lubich 1986).
    Second,
}

impl GlOrder {
    /// Computes the generating function at `z⁻¹`: the response of the full memory times p^μ.
    pub fn response(self, mu: f64, z1: Complex) -> Complex {
        let rise = Complex::from(1.0) - z1;
        match self {
            Self::First => rise.powf(mu),
            Self::Second => (rise * (rise * 0.5 + 1.0)).powf(mu),
        }
    }
}

/// The infinite sequence of weights ω₀, ω₁, ω₂ … Their sum is zero for μ > 0.
///
/// First order (Zhu et al., eq. 13): `ωₖ = (1 − (μ + 1)/k) ωₖ₋₁`, ω₀ = 1. Second order, from `g f′ = μ g′ f` for the
/// power series f of g^μ: `3k/2 ωₖ = 2(k − 1 − μ) ωₖ₋₁ + (μ − (k − 2)/2) ωₖ₋₂`, ω₀ = (3/2)^μ.
///
/// ```
/// use hyst_core::{GlOrder, GlWeights};
/// let first: Vec<f64> = GlWeights::new(0.5, GlOrder::First).take(4).collect();
/// assert_eq!(first, [1.0, -0.5, -0.125, -0.0625]);
/// let difference: Vec<f64> = GlWeights::new(1.0, GlOrder::Second).take(4).collect();
/// assert_eq!(difference, [1.5, -2.0, 0.5, 0.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlWeights {
    mu: f64,
    order: GlOrder,
    k: f64,
    last: f64,
    before: f64,
}

impl GlWeights {
    /// Returns the weights of the derivative of order `mu`, 0 ≤ μ ≤ 1.
    pub fn new(mu: f64, order: GlOrder) -> Self {
        Self { mu, order, k: 0.0, last: 0.0, before: 0.0 }
    }
}

impl Iterator for GlWeights {
    type Item = f64;

    #[inline]
    fn next(&mut self) -> Option<f64> {
        let (mu, k) = (self.mu, self.k);
        let weight = match self.order {
            GlOrder::First if k == 0.0 => 1.0,
            GlOrder::Second if k == 0.0 => libm::pow(1.5, mu),
            GlOrder::First => self.last - (mu + 1.0) / k * self.last,
            GlOrder::Second => (2.0 * (k - 1.0 - mu) * self.last + (mu - 0.5 * (k - 2.0)) * self.before) / (1.5 * k),
        };
        (self.before, self.last, self.k) = (self.last, weight, k + 1.0);
        Some(weight)
    }
}

/// Rejects an order outside 0…1, and names the parameter.
pub(super) fn checked(name: &'static str, mu: f64) -> Result<f64, Error> {
    within(name, mu, (0.0..=1.0).contains(&mu), "from 0 to 1")
}

/// Index from which [`decay`] can replace the recursion.
pub(super) const RECURSION: usize = 64;

/// Computes ωₖ divided by ω at [`RECURSION`], for k ≥ [`RECURSION`], with the asymptotic series of `Γ(k − μ)/Γ(k + 1)`.
/// The relative error is below 1e-8.
pub(super) fn decay(mu: f64, order: GlOrder, k: f64) -> f64 {
    let series = |k: f64| {
        let w = k - 0.5 * mu;
        let first = libm::pow(w, -1.0 - mu) * (1.0 + mu * (1.0 + mu) * (2.0 + mu) / (24.0 * w * w));
        // (3/2 − 2z + z²/2)^μ = (1 − z)^μ (1 + (1 − z)/2)^μ: a sum of first-order weights of the orders μ + m.
        let (mut sum, mut term) = (1.0, 1.0);
        if order == GlOrder::Second {
            for m in 0..10 {
                let m = f64::from(m);
                term *= -0.5 * (mu - m) * (mu + m + 1.0) / ((m + 1.0) * (k - mu - m - 1.0));
                sum += term;
            }
        }
        first * sum
    };
    series(k) / series(RECURSION as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn weights_are_the_power_series_of_the_response() {
        for order in [GlOrder::First, GlOrder::Second] {
            for mu in [0.0, 0.176, 0.5, 0.9742, 1.0] {
                // Inside the circle, so a few terms are sufficient.
                let z1 = Complex::polar(0.8, 1.1);
                let (mut sum, mut power) = (Complex::default(), Complex::from(1.0));
                for w in GlWeights::new(mu, order).take(200) {
                    sum = sum + power * w;
                    power = power * z1;
                }
                assert!((sum - order.response(mu, z1)).abs() < 1e-14, "{order:?} {mu}");
            }
        }
    }

    #[test]
    fn second_order_is_a_product_of_two_series() {
        for mu in [0.1, 0.466, 0.93] {
            let first: Vec<f64> = GlWeights::new(mu, GlOrder::First).take(400).collect();
            for (k, w) in GlWeights::new(mu, GlOrder::Second).take(400).enumerate() {
                // (3/2)^μ (1 − z)^μ (1 − z/3)^μ, coefficient of z^k.
                let product: f64 = (0..=k).map(|i| first[i] * first[k - i] * libm::pow(3.0, -(i as f64))).sum();
                let expected = libm::pow(1.5, mu) * product;
                assert!((w - expected).abs() < 1e-13 * expected.abs().max(1e-3), "{mu} {k}: {w} {expected}");
            }
        }
    }

    #[test]
    fn asymptotic_series_agrees_with_the_recursion() {
        for order in [GlOrder::First, GlOrder::Second] {
            for mu in [0.02, 0.176, 0.6596, 0.9742] {
                let w: Vec<f64> = GlWeights::new(mu, order).take(100_001).collect();
                for k in [65, 200, 3000, 100_000] {
                    let expected = w[k] / w[RECURSION];
                    assert!((decay(mu, order, k as f64) / expected - 1.0).abs() < 1e-8, "{order:?} {mu} {k}");
                }
            }
        }
    }
}
