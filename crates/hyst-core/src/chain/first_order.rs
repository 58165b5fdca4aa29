//! The exact step of `τ ẋ = u − x` for an input that is linear between samples.

use crate::error::within;
use crate::{Complex, Error, Real};

/// Coefficients of one first-order element.
///
/// With `a = 1 − e^(−h/τ)` and `b = 1 − a τ/h`, over a period in which `u` changes linearly from `u₀` to `u₁`:
/// `x₁ = x₀ + a (u₀ − x₀) + b (u₁ − u₀)`. This form is accurate for slow elements (h ≪ τ): `a` and `b` are small
/// numbers and not differences of numbers near 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FirstOrder<T> {
    pub(crate) a: T,
    pub(crate) b: T,
}

impl<T: Real> FirstOrder<T> {
    /// Computes the coefficients for sample period `h` and time constant `tau` \[s\]. With `tau = 0` the element
    /// follows the input at once.
    pub(crate) fn new(name: &'static str, h: f64, tau: f64) -> Result<Self, Error> {
        within(name, tau, tau >= 0.0, "zero or positive")?;
        let x = h / tau;
        // For h ≫ τ (τ = 0 included) the limit a = b = 1; x may be infinite here.
        let (a, b) = if x > 700.0 {
            (1.0, 1.0 - tau / h)
        } else if x < 1e-3 {
            // b = x/2 − x²/6 + x³/24 − …: avoids the cancellation of the closed form.
            (-libm::expm1(-x), x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0))))
        } else {
            let a = -libm::expm1(-x);
            (a, 1.0 - a / x)
        };
        Ok(Self { a: T::from_f64(a), b: T::from_f64(b) })
    }

    /// Returns the response of the sampled element at `z⁻¹`: `(b + (a − b) z⁻¹) / (1 − (1 − a) z⁻¹)`.
    pub(crate) fn response(&self, z1: Complex) -> Complex {
        let (a, b) = (self.a.to_f64(), self.b.to_f64());
        (z1 * (a - b) + b) / (z1 * (a - 1.0) + 1.0)
    }

    #[inline]
    pub(crate) fn step(&self, x: T, u0: T, u1: T) -> T {
        x + self.a * (u0 - x) + self.b * (u1 - u0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_and_closed_form_agree() {
        for tau in [0.999e3, 1.001e3] {
            let e = FirstOrder::<f64>::new("tau", 1.0, tau).unwrap();
            let x: f64 = 1.0 / tau;
            let reference = x / 2.0 - x * x / 6.0 + x.powi(3) / 24.0 - x.powi(4) / 120.0;
            assert!((e.b - reference).abs() < 1e-12);
        }
    }

    #[test]
    fn a_ramp_is_followed_exactly() {
        // u = t from rest: x = t − τ (1 − e^(−t/τ)).
        let (h, tau) = (0.013, 0.11);
        let e = FirstOrder::<f64>::new("tau", h, tau).unwrap();
        let mut x = 0.0;
        for k in 0..100 {
            let t = h * f64::from(k + 1);
            x = e.step(x, t - h, t);
            assert!((x - (t - tau * (1.0 - libm::exp(-t / tau)))).abs() < 1e-12);
        }
    }
}
