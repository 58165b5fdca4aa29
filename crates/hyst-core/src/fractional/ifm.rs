//! The improved fractional-order model: a fractional equation for the hysteresis, driven by the difference of the
//! delayed input and the input.

use super::{GlOrder, Lfdm, LfdmParams, LfdmState, Memory, ShortMemory};
use crate::chain::{Delay, DelayParams, DelayState};
use crate::error::{coefficient, within};
use crate::stage::{hold, rest};
use crate::zeros;
use crate::{Build, Complex, Env, Error, Invert, Meta, Params, Probe, Real, Sampling, Stage};
use core::f64::consts::PI;

/// Parameters of the IFM `X(s) = Δ U(s) + (a + b s^α) / (1 + c s^β) (e^(−τs) − 1) U(s)` (Zhu et al., eq. 7–11).
///
/// Only the response is identifiable, as in [`LfdmParams`]. τ and Δ are the most accurate parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct IfmParams {
    /// Gain a of the hysteresis at rest \[y/u\], zero or positive.
    pub a: f64,
    /// Weight b of the derivative of the input \[y s^α/u\], zero or positive.
    pub b: f64,
    /// Weight c of the derivative of the hysteresis \[s^β\], zero or positive.
    pub c: f64,
    /// Order α of the derivative of the input, 0 to 1.
    pub alpha: f64,
    /// Order β of the derivative of the hysteresis, 0 to 1.
    pub beta: f64,
    /// Time delay τ \[s\], zero or positive.
    pub tau: f64,
    /// Gain Δ of the linear part \[y/u\].
    pub delta: f64,
    /// Order of accuracy of the sampled derivatives.
    #[cfg_attr(feature = "serde", serde(default))]
    pub order: GlOrder,
}

impl IfmParams {
    /// The published parameters (output µm, input V): α, β, τ and Δ as identified, first-order derivatives.
    pub const PRINTED: Self = Self {
        a: 5.7342,
        b: 6.8754,
        c: 0.8885,
        alpha: 0.6596,
        beta: 0.9742,
        tau: 0.0015,
        delta: 1.7615,
        order: GlOrder::First,
    };

    /// Returns the parameters of the equation from u_d to the hysteresis.
    fn hysteresis(&self) -> LfdmParams {
        let Self { a, b, c, alpha, beta, order, .. } = *self;
        LfdmParams { a, b, c, alpha, beta, order }
    }

    /// Computes the response of the model in continuous time at `hz` \[y/u\].
    pub fn response(&self, hz: f64) -> Complex {
        let late = Complex::polar(1.0, -2.0 * PI * hz * self.tau) - Complex::from(1.0);
        self.hysteresis().response(hz) * late + self.delta
    }
}

impl Params for IfmParams {
    /// The bounds are those of the paper, which lists them in the order α, β, a, b, c, τ, Δ.
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "a", unit: "y/u", lower: 0.0, upper: 10.0 }, &mut self.a);
        f(&Meta { name: "b", unit: "y s^alpha/u", lower: 0.0, upper: 10.0 }, &mut self.b);
        f(&Meta { name: "c", unit: "s^beta", lower: 0.0, upper: 10.0 }, &mut self.c);
        f(&Meta { name: "alpha", unit: "", lower: 0.0, upper: 1.0 }, &mut self.alpha);
        f(&Meta { name: "beta", unit: "", lower: 0.0, upper: 1.0 }, &mut self.beta);
        f(&Meta { name: "tau", unit: "s", lower: 0.0, upper: 10.0 }, &mut self.tau);
        f(&Meta { name: "delta", unit: "y/u", lower: 0.0, upper: 10.0 }, &mut self.delta);
    }
}

/// The IFM at one sample period: the hysteresis h by eq. 15 from `u_d(t) = u(t − τ) − u(t)` (eq. 11), `x = h + Δ u`
/// (eq. 10). (Eq. 14 has errors in print.) `W` is the [`Memory`] of its derivatives, `D` the capacity of its [`Delay`]:
/// τ up to `D − 2` samples.
///
/// It is stable for all parameters. Its inverse is not: see [`invert`](Invert::invert).
///
/// ```
/// use hyst_core::{Build, Env, Exponentials, Ifm, IfmParams, Invert, Sampling, Stage};
/// let printed = IfmParams::PRINTED;
/// let model: Ifm<f64, Exponentials<f64, 40>, 32> = printed.build(&Sampling { period: 1e-4 })?;
/// let inverse = model.invert()?;
/// let (mut s, mut i, env) = (model.state(), inverse.state(), Env::default());
/// for reference in [0.0, 1.0, 3.0, 2.5] {
///     let drive = inverse.step(&mut i, &env, reference);
///     assert!((model.step(&mut s, &env, drive) - reference).abs() < 1e-12);
/// }
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Ifm<T, W, const D: usize> {
    hysteresis: Lfdm<T, W>,
    delay: Delay<T, D>,
    delta: T,
}

impl<T: Real, W: Memory<T>, const D: usize> Build<Ifm<T, W, D>> for IfmParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Ifm<T, W, D>, Error> {
        for (name, x) in [("ifm.a", self.a), ("ifm.b", self.b), ("ifm.c", self.c), ("ifm.tau", self.tau)] {
            within(name, x, x >= 0.0, "zero or positive")?;
        }
        for (name, x) in [("ifm.alpha", self.alpha), ("ifm.beta", self.beta)] {
            within(name, x, (0.0..=1.0).contains(&x), "from 0 to 1")?;
        }
        Ok(Ifm {
            hysteresis: self.hysteresis().build(cx)?,
            delay: DelayParams { seconds: self.tau }.build(cx).map_err(|e| match e {
                Error::Capacity { needed, holds, .. } => Error::Capacity { name: "ifm.tau samples", needed, holds },
                other => other,
            })?,
            delta: coefficient("ifm.delta", self.delta)?,
        })
    }
}

/// History of an [`Ifm`].
#[derive(Clone, Debug, PartialEq)]
pub struct IfmState<T, S, const D: usize> {
    hysteresis: LfdmState<T, S>,
    delay: DelayState<T, D>,
    u: T,
}

impl<T: Real, W: Memory<T>, const D: usize> Ifm<T, W, D> {
    /// Computes the response of the sampled model with its memory at `z⁻¹` \[y/u\].
    pub fn response(&self, z1: Complex) -> Complex {
        let whole = z1.powf(self.delay.whole_samples() as f64);
        let late = whole * self.delay.fraction_response(z1) - Complex::from(1.0);
        self.hysteresis.response(z1) * late + self.delta.to_f64()
    }

    /// Returns the immediate response of the output to a unit step of the input \[y/u\].
    fn at_once(&self) -> T {
        self.delta - self.hysteresis.at_once() * (T::ONE - self.delay.at_once())
    }
}

impl<T: Real, const M: usize, const D: usize> Ifm<T, ShortMemory<T, M>, D> {
    /// Returns the model with its memory truncated after `samples` if it is longer. Use it for a length that is known
    /// only at run time.
    pub fn cut(self, samples: usize) -> Self {
        Self { hysteresis: self.hysteresis.cut(samples), ..self }
    }
}

impl<T: Real, W: Memory<T>, const D: usize> Stage<T> for Ifm<T, W, D> {
    type State = IfmState<T, W::State, D>;

    fn state(&self) -> Self::State {
        IfmState { hysteresis: self.hysteresis.state(), delay: self.delay.state(), u: T::ZERO }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        let u0 = rest(&mut s.u, u0);
        self.delay.reset(&mut s.delay, e, u0);
        self.hysteresis.reset(&mut s.hysteresis, e, T::ZERO) + self.delta * u0
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let u = hold(&mut s.u, u);
        let late = self.delay.step(&mut s.delay, e, u);
        self.hysteresis.step(&mut s.hysteresis, e, late - u) + self.delta * u
    }
}

impl<T: Real, W: Memory<T>, const D: usize> Probe<T> for Ifm<T, W, D> {
    #[inline]
    fn probe(&self, s: &Self::State, e: &Env<T>, u: T) -> T {
        let u = if u.is_finite() { u } else { s.u };
        let late = self.delay.ahead(&s.delay, u);
        self.hysteresis.probe(&s.hysteresis, e, late - u) + self.delta * u
    }
}

/// The exact inverse of an [`Ifm`]: its recursion solved for the input.
#[derive(Clone, Debug, PartialEq)]
pub struct IfmInverse<T, W, const D: usize> {
    forward: Ifm<T, W, D>,
    /// 1 / immediate response of the output to a unit step of the input.
    scale: T,
    /// 1 / Δ.
    at_rest: T,
}

/// History of an [`IfmInverse`]: the history of the model, and the last reference.
#[derive(Clone, Debug, PartialEq)]
pub struct IfmInverseState<T, S, const D: usize> {
    forward: IfmState<T, S, D>,
    reference: T,
}

impl<T: Real, W: Memory<T>, const D: usize> IfmInverse<T, W, D> {
    /// Solves the recursion for the input without a test of stability.
    fn unchecked(forward: Ifm<T, W, D>) -> Self {
        Self { scale: T::ONE / forward.at_once(), at_rest: T::ONE / forward.delta, forward }
    }
}

impl<T: Real, W: Memory<T>, const D: usize> Invert<T> for Ifm<T, W, D> {
    type Inverse = IfmInverse<T, W, D>;

    /// The inverse is stable if the sampled response has no zero on or outside the unit circle. The test counts the
    /// turns of the response about 0 on the circle, with at most `64 (D + 66)` evaluations. The inverse is stable if
    /// the gain of the delayed part is below Δ at all frequencies. That holds for the published parameters, whose total
    /// gain is at least 0.20 Δ (at 241 Hz, first order at 10 kHz).
    fn invert(&self) -> Result<Self::Inverse, Error> {
        // The response turns with z^(−whole). A step is a small part of one turn.
        let widest = PI / (16.0 * (self.delay.whole_samples() as f64 + 2.0));
        if zeros::none_outside(widest, |theta| self.response(Complex::polar(1.0, -theta))) {
            Ok(IfmInverse::unchecked(self.clone()))
        } else {
            Err(Error::NotInvertible(
                "the delayed part exceeds ifm.delta at some frequency, so a causal inverse would be unstable",
            ))
        }
    }
}

impl<T: Real, W: Memory<T>, const D: usize> Stage<T> for IfmInverse<T, W, D> {
    type State = IfmInverseState<T, W::State, D>;

    fn state(&self) -> Self::State {
        IfmInverseState { forward: self.forward.state(), reference: T::ZERO }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        let u = rest(&mut s.reference, u0) * self.at_rest;
        self.forward.reset(&mut s.forward, e, u);
        u
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let reference = hold(&mut s.reference, u);
        // The output is linear in the present input. Start from the output at a constant input.
        let last = s.forward.u;
        let u = last + (reference - self.forward.probe(&s.forward, e, last)) * self.scale;
        self.forward.step(&mut s.forward, e, u);
        s.forward.u
    }
}

#[cfg(test)]
mod tests;
