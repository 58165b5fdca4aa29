//! The causal inverse, sample by sample, for α ≥ 0.

use super::operator::Activation;
use crate::stage::{hold, rest};
use crate::{Env, Error, Invert, Real, Stage};

/// Inverse of an [`Activation`], sample by sample: the input with `(k₀ + α/h) u + β f(γ u) = z + (α/h) u_last`.
///
/// It solves one monotone equation per sample to the rounding of its terms (at most 100 evaluations of f, usually one
/// to four; closed form for β = 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActivationInverse<T> {
    forward: Activation<T>,
    /// k₀ + α/h
    slope: T,
}

/// History of the inverse: the last input that it returned, and the last reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActivationInverseState<T> {
    u: T,
    z: T,
}

impl<T: Real> Invert<T> for Activation<T> {
    type Inverse = ActivationInverse<T>;

    /// The equation of one sample has one solution if k₀ + α/h + βγ f′ > 0 everywhere. An error of the drive then
    /// decays where the curve at rest rises. For α > 0 that is everywhere except where βγ f′ < −k₀; a drive leaves that
    /// range because k₀ > 0. For α < 0 the error decays if h k₀ > 2|α|, that is where
    /// [`anti_causal`](Activation::anti_causal) does not work. It then alternates at half the sample rate, with the
    /// factor |α| / (h k₀ − |α|) per sample.
    ///
    /// # Errors
    /// [`Error::NotInvertible`] if one of these conditions fails: for α < 0 at ordinary sample rates.
    fn invert(&self) -> Result<Self::Inverse, Error> {
        let (k0, rate) = (self.k0.to_f64(), self.rate.to_f64());
        let (a, b) = self.asymptotic_slopes();
        let flattest = a.at_most(b);
        if flattest.is_nan() || flattest <= 0.0 {
            return Err(Error::NotInvertible("activation: k0 (softplus: and k0 + beta gamma) must be positive"));
        }
        if rate < 0.0 && flattest + 2.0 * rate <= 0.0 {
            return Err(Error::NotInvertible(
                "activation: alpha < 0 gives a zero in the right half plane; use the anti-causal inverse",
            ));
        }
        if k0 + rate + self.activation_slopes().0 <= 0.0 {
            return Err(Error::NotInvertible("activation: the output must rise with the input within a sample"));
        }
        Ok(ActivationInverse { forward: *self, slope: self.k0 + self.rate })
    }
}

impl<T: Real> Stage<T> for ActivationInverse<T> {
    type State = ActivationInverseState<T>;

    fn state(&self) -> Self::State {
        ActivationInverseState { u: T::ZERO, z: T::ZERO }
    }

    /// Sets the inverse to rest where the output of the model at rest is `u0`.
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        *s = self.state();
        let z = rest(&mut s.z, u0);
        s.u = self.forward.solve(self.forward.k0, z);
        s.u
    }

    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let z = hold(&mut s.z, u);
        let last = s.u;
        let solved = self.forward.solve(self.slope, z + self.forward.rate * last);
        hold(&mut s.u, solved)
    }
}

#[cfg(test)]
mod tests {
    use super::super::published;
    use super::*;
    use crate::{ActivationKind, ActivationParams, Build, Sampling};
    use proptest::prelude::*;

    const RATE: Sampling = Sampling { period: 1e-3 };

    fn built(kind: ActivationKind, p: ActivationParams) -> Activation<f64> {
        (kind, p).build(&RATE).unwrap()
    }

    /// Returns the largest |reached − reference| divided by the size of the terms of the output, and the largest drive.
    fn follow(m: &Activation<f64>, reference: impl Iterator<Item = f64>) -> (f64, f64) {
        let inverse = m.invert().unwrap();
        let (mut s, mut i, e) = (m.state(), inverse.state(), Env::default());
        let mut last = inverse.reset(&mut i, &e, 0.3);
        let size = |u: f64, last: f64, z: f64| {
            let (x, k) = (m.gamma * u, m.beta * m.gamma);
            let slopes = m.k0.abs() + m.rate.abs() + (k * m.kind.slope(x)).abs();
            slopes * (u.abs() + last.abs()) + (m.beta * m.kind.value(x)).abs() + m.beta.abs() + z.abs()
        };
        let mut worst = (m.reset(&mut s, &e, last) - 0.3).abs() / size(last, last, 0.3);
        let mut largest = last.abs();
        for z in reference {
            let u = inverse.step(&mut i, &e, z);
            let reached = m.step(&mut s, &e, u);
            worst = worst.max((reached - z).abs() / size(u, last, z));
            (largest, last) = (largest.max(u.abs()), u);
        }
        (worst, largest)
    }

    proptest! {
        #[test]
        fn every_reference_is_reached(
            kind in prop::sample::select(&ActivationKind::ALL[..]), k0 in 0.01..2.0f64, alpha in 0.0..2e-3f64, beta in -3.0..3.0f64,
            exponent in -3.0..6.0f64, random in prop::collection::vec(-10.0..10.0f64, 100), shape in 0..3u8,
        ) {
            let gamma = libm::pow(10.0, exponent);
            // A falling activation must not exceed the rising part. For softplus this must also hold at rest.
            let rising = if kind == ActivationKind::Softplus { k0 } else { k0 + alpha / RATE.period };
            let m = built(kind, ActivationParams { k0, alpha, beta: beta.max(-0.99 * rising / (gamma * kind.steepest())), gamma });
            let reference = random.iter().enumerate().map(|(k, r)| match shape {
                0 => *r,
                1 => 5.0 * libm::sin(0.1 * k as f64) + 3.0 * libm::sin(0.77 * k as f64) + libm::sin(2.9 * k as f64),
                // Minor loops on a ramp through the steep range.
                _ => 0.02 * k as f64 - 1.0 + if k % 10 < 5 { 0.3 } else { -0.3 } * (k % 5) as f64,
            });
            let (worst, largest) = follow(&m, reference);
            prop_assert!(worst <= 8.0 * f64::EPSILON, "{worst:e}");
            // |u| settles below (|z| + |β| max|f|)/k₀; for softplus with the smaller of its two slopes.
            let (a, b) = m.asymptotic_slopes();
            prop_assert!(largest <= (10.0 + 1.6 * m.beta.abs()) / a.min(b) * (1.0 + 1e-9), "{largest}");
        }
    }

    /// Published sets with a zero that is too fast for 1 kHz: α < 0, h k₀ > 2|α|.
    #[test]
    fn a_slow_sample_rate_makes_negative_alpha_causal() {
        let mut sets = 0;
        for (kind, hz, p) in published::all() {
            let m = built(kind, p);
            if m.invert().is_err() {
                assert!(1e-3 * p.k0 <= 2.0 * p.alpha.abs());
                continue;
            }
            sets += 1;
            let turn = core::f64::consts::TAU * hz * 1e-3;
            let (worst, largest) = follow(&m, (0..2000).map(|k| 3.0 - 3.0 * libm::cos(turn * f64::from(k))));
            assert!(worst <= 8.0 * f64::EPSILON && largest < 100.0, "{kind:?} {hz}: {worst:e} {largest}");
        }
        assert!(sets >= 8, "{sets}");
    }

    #[test]
    fn without_activation_it_equals_the_closed_form() {
        let m = built(ActivationKind::Tanh, ActivationParams { k0: 0.2, alpha: 1e-3, beta: 0.0, gamma: 7.0 });
        let inverse = m.invert().unwrap();
        let (mut i, e) = (inverse.state(), Env::default());
        let mut u = inverse.reset(&mut i, &e, 1.0);
        assert!((u - 5.0).abs() < 1e-15);
        for z in [1.5, -2.0, 0.0, 7.0] {
            u = (z + u) / 1.2;
            assert!((inverse.step(&mut i, &e, z) - u).abs() < 1e-14);
        }
    }

    #[test]
    fn models_without_a_causal_inverse_are_rejected() {
        let p = ActivationParams { k0: 0.15, alpha: 1e-4, beta: 0.3, gamma: 10.0 };
        let fails = |kind, p| matches!(built(kind, p).invert(), Err(Error::NotInvertible(_)));
        assert!(!fails(ActivationKind::Tanh, p));
        assert!(fails(ActivationKind::Tanh, ActivationParams { alpha: -1e-4, ..p }));
        assert!(fails(ActivationKind::Tanh, ActivationParams { k0: 0.0, ..p }));
        // Falls within a sample: k₀ + α/h = 0.25 < 0.3.
        assert!(fails(ActivationKind::Tanh, ActivationParams { beta: -0.03, ..p }));
        // Falls for large drives.
        assert!(fails(ActivationKind::Softplus, ActivationParams { beta: -0.02, ..p }));
    }

    #[test]
    fn a_non_finite_reference_does_not_change_the_state() {
        let inverse = built(ActivationKind::Atan, ActivationParams { k0: 0.15, alpha: 1e-4, beta: 0.3, gamma: 10.0 })
            .invert()
            .unwrap();
        let (mut a, mut b, e) = (inverse.state(), inverse.state(), Env::default());
        inverse.step(&mut a, &e, 1.0);
        inverse.step(&mut b, &e, 1.0);
        assert_eq!(inverse.step(&mut a, &e, f64::NAN), inverse.step(&mut b, &e, 1.0));
        assert_eq!(a, b);
        assert_eq!(inverse.reset(&mut a, &e, 2.0), inverse.reset(&mut inverse.state(), &e, 2.0));
    }
}
