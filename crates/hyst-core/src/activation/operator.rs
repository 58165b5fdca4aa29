//! The activation-function model.

use super::kind::ActivationKind;
use crate::error::{coefficient, finite};
use crate::stage::{hold, rest};
use crate::{Build, Env, Error, Meta, Params, Real, Sampling, Stage};

/// Parameters of `z = k₀ u + α u̇ + β f(γ u)` (Xie et al., eq. 2). They build together with an [`ActivationKind`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ActivationParams {
    /// Gain k₀ \[y/u\].
    pub k0: f64,
    /// α: gain of the rate of the input \[y s/u\].
    pub alpha: f64,
    /// β: size of the activation \[y\].
    pub beta: f64,
    /// γ: sharpness of the activation \[1/u\].
    pub gamma: f64,
}

impl ActivationParams {
    /// Converts softsign parameters of the form `β u / (1 + γ |u|)`, which is softsign(γu) of size β/γ.
    ///
    /// Table 5 of Xie et al. (β = 100, γ = 204…318) agrees with eq. 2 only in this form: β/γ = 0.31…0.49 then agrees
    /// with the sizes of tanh on the same records.
    pub fn from_scaled_softsign(k0: f64, alpha: f64, beta: f64, gamma: f64) -> Self {
        Self { k0, alpha, beta: beta / gamma, gamma }
    }
}

impl Params for ActivationParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const ANY: f64 = f64::INFINITY;
        f(&Meta { name: "k0", unit: "y/u", lower: 0.0, upper: ANY }, &mut self.k0);
        f(&Meta { name: "alpha", unit: "y s/u", lower: -ANY, upper: ANY }, &mut self.alpha);
        f(&Meta { name: "beta", unit: "y", lower: -ANY, upper: ANY }, &mut self.beta);
        f(&Meta { name: "gamma", unit: "1/u", lower: 0.0, upper: ANY }, &mut self.gamma);
    }
}

impl<T: Real> Build<Activation<T>> for (ActivationKind, ActivationParams) {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Activation<T>, Error> {
        let (kind, p) = self;
        let h = cx.checked()?;
        finite("activation.alpha", p.alpha)?;
        Ok(Activation {
            kind: *kind,
            k0: coefficient("activation.k0", p.k0)?,
            rate: coefficient("activation.alpha over the sample period", p.alpha / h)?,
            beta: coefficient("activation.beta", p.beta)?,
            gamma: coefficient("activation.gamma", p.gamma)?,
        })
    }
}

/// Activation-function model `z = k₀ u + α u̇ + β f(γ u)` (Xie et al., eq. 1, 2) at one sample period.
///
/// The input is linear between samples, so its rate over the last one is `u̇ = (u_k − u_(k−1)) / h`. Any finite
/// parameters are valid. With |γu| ≫ 1 over the whole range, as for most published sets (γ of 500 to 10⁶ per volt), the
/// activation is a constant, and β and γ cannot be identified separately.
///
/// There are two inverses. For α ≥ 0 (or a very slow sample rate), [`Invert`](crate::Invert) solves for the input
/// sample by sample. For α < 0, as in all published sets, the model has a zero in the right half plane. Then
/// [`anti_causal`](Self::anti_causal) computes the drive backwards in time from `lead` samples of preview.
///
/// ```
/// use hyst_core::{Activation, ActivationKind, ActivationParams, Build, Env, Sampling, Stage};
/// let params = ActivationParams { k0: 0.1461, alpha: -9e-5, beta: 0.3857, gamma: 500_032.0 };
/// let model: Activation<f64> = (ActivationKind::Tanh, params).build(&Sampling { period: 1e-4 })?;
/// let (mut s, e) = (model.state(), Env::default());
/// assert!((model.reset(&mut s, &e, 20.0) - (0.1461 * 20.0 + 0.3857)).abs() < 1e-12);
/// // One volt within 0.1 ms: the rate term is −0.9.
/// assert!((model.step(&mut s, &e, 21.0) - (0.1461 * 21.0 + 0.3857 - 0.9)).abs() < 1e-12);
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activation<T> {
    pub(super) kind: ActivationKind,
    pub(super) k0: T,
    /// α/h
    pub(super) rate: T,
    pub(super) beta: T,
    pub(super) gamma: T,
}

/// History of the model: the last input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActivationState<T> {
    u: T,
}

impl<T: Real> Activation<T> {
    /// Computes the output at rest at `u`: φ(u) = k₀ u + β f(γ u).
    #[inline]
    pub fn at_rest(&self, u: T) -> T {
        self.k0 * u + self.beta * self.kind.value(self.gamma * u)
    }

    /// Returns minimum and maximum of βγ f′, the part of the slope that comes from the activation \[y/u\].
    pub(super) fn activation_slopes(&self) -> (f64, f64) {
        let most = self.beta.to_f64() * self.gamma.to_f64() * self.kind.steepest();
        (most.at_most(0.0), most.at_least(0.0))
    }

    /// Returns φ′ for u → −∞ and u → ∞, in no particular order.
    pub(super) fn asymptotic_slopes(&self) -> (f64, f64) {
        let k0 = self.k0.to_f64();
        if self.kind == ActivationKind::Softplus {
            (k0, k0 + self.beta.to_f64() * self.gamma.to_f64())
        } else {
            (k0, k0)
        }
    }

    /// Returns the input with `slope · u + β f(γ u) = y`. `slope`, and for softplus also `slope + βγ`, must be
    /// positive.
    ///
    /// The range of the activation gives a bracket. Newton's method starts at the end nearer to zero. From there it is
    /// monotone for all five functions. A bisection step replaces a step that leaves the bracket, or if the bracket
    /// does not shrink.
    pub(super) fn solve(&self, slope: T, y: T) -> T {
        /// Limit for both methods together. Bisection alone resolves an `f64` in 64.
        const EVALUATIONS: usize = 100;
        let half = T::from_f64(0.5);
        let (least, most) = self.kind.range();
        let (a, b) = (self.beta * T::from_f64(least), self.beta * T::from_f64(most));
        let mut low = self.on_asymptote(slope, y - a.at_least(b));
        let mut high = self.on_asymptote(slope, y - a.at_most(b));
        let mut u = T::ZERO.at_least(low).at_most(high);
        let mut width = high - low;
        for i in 0..EVALUATIONS {
            let x = self.gamma * u;
            let (line, curve) = (slope * u, self.beta * self.kind.value(x));
            let error = line + curve - y;
            // The error is below the rounding of the terms.
            if error.abs() <= T::EPSILON * (line.abs() + curve.abs() + y.abs()) * half || !error.is_finite() {
                break;
            }
            if error > T::ZERO {
                high = u;
            } else {
                low = u;
            }
            let newton = u - error / (slope + self.beta * self.gamma * self.kind.slope(x));
            let slow = i % 4 == 3 && high - low > width * half;
            if i % 4 == 3 {
                width = high - low;
            }
            let next = if newton > low && newton < high && !slow { newton } else { low + (high - low) * half };
            if next == u {
                break;
            }
            u = next;
        }
        u
    }

    /// Returns the input with `slope · u + β max(0, γu) = y` for softplus, `slope · u = y` for the others.
    fn on_asymptote(&self, slope: T, y: T) -> T {
        let is_steep = self.kind == ActivationKind::Softplus && (y > T::ZERO) == (self.gamma > T::ZERO);
        y / if is_steep { slope + self.beta * self.gamma } else { slope }
    }
}

impl<T: Real> Stage<T> for Activation<T> {
    type State = ActivationState<T>;

    fn state(&self) -> Self::State {
        ActivationState { u: T::ZERO }
    }

    /// Sets the model to rest at `u0`: the rate is zero.
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        *s = self.state();
        self.at_rest(rest(&mut s.u, u0))
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let from = s.u;
        let to = hold(&mut s.u, u);
        self.at_rest(to) + self.rate * (to - from)
    }
}

#[cfg(test)]
mod tests {
    use super::super::published;
    use super::*;
    use proptest::prelude::*;

    const RATE: Sampling = Sampling { period: 1e-3 };

    fn built(kind: ActivationKind, p: ActivationParams) -> Activation<f64> {
        (kind, p).build(&RATE).unwrap()
    }

    /// The example of the paper (section 2.3): 40 V, 10 Hz, 1 kHz, tanh.
    #[test]
    fn example_of_the_paper_follows_its_formula() {
        let p = ActivationParams { k0: 0.145, alpha: -1e-4, beta: 0.385, gamma: 526_000.0 };
        let m = built(ActivationKind::Tanh, p);
        let turn = core::f64::consts::TAU * 10.0;
        let angle = |k: usize| turn * 1e-3 * k as f64 - core::f64::consts::FRAC_PI_2;
        let u = |k: usize| 40.0 * libm::sin(angle(k)) + 40.0;
        let (mut s, e) = (m.state(), Env::default());
        m.reset(&mut s, &e, u(0));
        for k in 1..=50 {
            let z = m.step(&mut s, &e, u(k));
            let rate = (u(k) - u(k - 1)) / 1e-3;
            assert!((z - (0.145 * u(k) - 1e-4 * rate + 0.385 * libm::tanh(526_000.0 * u(k)))).abs() < 1e-12);
            // The difference quotient is the derivative half a sample earlier: 40·ω²·h/2.
            let exact = 40.0 * turn * libm::cos(angle(k));
            assert!((rate - exact).abs() < 40.0 * turn * turn * 0.5e-3 * 1.001);
        }
        // 80 V and a saturated activation.
        assert!((m.at_rest(80.0) - (11.6 + 0.385)).abs() < 1e-12);
    }

    /// Table 5 in the form of eq. 2 would add 100 µm. In the scaled form, the sizes agree with table 6.
    #[test]
    fn scaled_softsign_table_agrees_with_the_tanh_table() {
        for (soft, tanh) in published::SOFTSIGN.iter().zip(published::TANH) {
            let p = ActivationParams::from_scaled_softsign(soft[0], soft[1], soft[2], soft[3]);
            assert!((p.beta / tanh[2] - 1.0).abs() < 0.03, "{} {}", p.beta, tanh[2]);
            assert!((p.k0 / tanh[0] - 1.0).abs() < 2e-3);
            // β u / (1 + γ |u|)
            let m = built(ActivationKind::Softsign, p);
            for u in [-30.0, -0.01, 0.003, 20.0f64] {
                let expected = soft[0] * u + soft[2] * u / (1.0 + soft[3] * u.abs());
                assert!((m.at_rest(u) - expected).abs() < 1e-13);
            }
        }
    }

    fn kinds() -> impl Strategy<Value = ActivationKind> {
        prop::sample::select(&ActivationKind::ALL[..])
    }

    proptest! {
        #[test]
        fn static_solution_satisfies_the_equation(
            kind in kinds(), slope in 0.01..2.0f64, beta in -2.0..2.0f64, exponent in -3.0..6.0f64, y in -20.0..20.0f64, scale in -9.0..0.0f64,
        ) {
            let gamma = libm::pow(10.0, exponent);
            // β is limited so that the output just does not fall with softplus or a negative activation.
            let floor = -0.999 * slope / (gamma * kind.steepest());
            let m = built(kind, ActivationParams { k0: slope, alpha: 0.0, beta: beta.max(floor), gamma });
            for y in [y, y * libm::pow(10.0, scale), m.beta, -m.beta, 0.5 * m.beta] {
                let u = m.solve(slope, y);
                let size = (slope * u).abs() + m.beta.abs() + y.abs();
                // The outputs of the two numbers next to u differ by the slope times their distance.
                let step = 2.0 * f64::EPSILON * u.abs() * (slope + m.beta * gamma * kind.slope(gamma * u));
                prop_assert!((m.at_rest(u) - y).abs() <= 2.0 * f64::EPSILON * size + step, "{y} {u} {}", m.at_rest(u) - y);
            }
        }

        #[test]
        fn single_precision_agrees(kind in kinds(), exponent in -3.0..2.0f64, u in prop::collection::vec(-60.0..60.0f64, 50)) {
            let p = ActivationParams { k0: 0.15, alpha: 1e-4, beta: 0.4, gamma: libm::pow(10.0, exponent) };
            let (double, single): (Activation<f64>, Activation<f32>) =
                (built(kind, p), (kind, p).build(&RATE).unwrap());
            let (mut s, mut t) = (double.state(), single.state());
            let size = 9.0 + 0.1 * 120.0 + 0.4 * (1.0 + p.gamma * 60.0);
            for u in &u {
                let expected = double.step(&mut s, &Env::default(), f64::from(*u as f32));
                let y = f64::from(single.step(&mut t, &Env::default(), *u as f32));
                prop_assert!((y - expected).abs() < 2e-6 * size, "{y} {expected}");
            }
        }
    }

    #[test]
    fn a_non_finite_input_does_not_change_the_state() {
        let m = built(ActivationKind::Tanh, ActivationParams { k0: 0.1, alpha: 1e-4, beta: 0.3, gamma: 5.0 });
        let (mut s, e) = (m.state(), Env::default());
        m.step(&mut s, &e, 3.0);
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(m.step(&mut s, &e, bad), m.at_rest(3.0));
        }
        assert!(m.reset(&mut s, &e, f64::NAN).is_finite());
        assert_eq!(m.reset(&mut s, &e, 2.0), m.reset(&mut m.state(), &e, 2.0));
    }

    #[test]
    fn bad_parameters_are_named() {
        let good = ActivationParams { k0: 0.1, alpha: 1e-4, beta: 0.3, gamma: 5.0 };
        let error = |p| Build::<Activation<f64>>::build(&(ActivationKind::Atan, p), &RATE).unwrap_err();
        assert_eq!(error(ActivationParams { gamma: f64::NAN, ..good }), Error::NonFinite("activation.gamma"));
        assert_eq!(error(ActivationParams { k0: f64::INFINITY, ..good }), Error::NonFinite("activation.k0"));
        let built: Result<Activation<f64>, _> = (ActivationKind::Atan, good).build(&Sampling { period: 0.0 });
        assert!(matches!(built, Err(Error::OutOfRange { name: "sample period", .. })));
    }
}
