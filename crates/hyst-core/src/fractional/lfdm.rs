//! The linear fractional-order differential model, `X + c s^β X = a U + b s^α U`.

use super::{GlOrder, Memory, ShortMemory};
use crate::error::{coefficient, finite, within};
use crate::stage::{hold, rest};
use crate::{Build, Complex, Env, Error, Invert, Meta, Params, Probe, Real, Sampling, Stage};

/// Parameters of the LFDM `X(s) = (a + b s^α) / (1 + c s^β) U(s)` (Zhu et al., eq. 5, 6).
///
/// Only the response is identifiable: in a record of a few seconds, errors of a, b, c and α compensate each other
/// almost completely.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LfdmParams {
    /// Gain a at rest \[y/u\], zero or positive.
    pub a: f64,
    /// Weight b of the derivative of the input \[y s^α/u\], zero or positive.
    pub b: f64,
    /// Weight c of the derivative of the output \[s^β\], zero or positive.
    pub c: f64,
    /// Order α of the derivative of the input, 0 to 1.
    pub alpha: f64,
    /// Order β of the derivative of the output, 0 to 1.
    pub beta: f64,
    /// Order of accuracy of the sampled derivatives.
    #[cfg_attr(feature = "serde", serde(default))]
    pub order: GlOrder,
}

impl LfdmParams {
    /// The published parameters (output µm, input V), first-order derivatives.
    pub const PRINTED: Self = Self { a: 6.573, b: 1.459, c: 0.198, alpha: 0.176, beta: 0.466, order: GlOrder::First };

    /// Computes the response of the model in continuous time at `hz` \[y/u\].
    pub fn response(&self, hz: f64) -> Complex {
        let s = Complex { re: 0.0, im: 2.0 * core::f64::consts::PI * hz };
        (s.powf(self.alpha) * self.b + self.a) / (s.powf(self.beta) * self.c + 1.0)
    }
}

impl Params for LfdmParams {
    /// The bounds are those of the paper for the parameters of the IFM with the same names.
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "a", unit: "y/u", lower: 0.0, upper: 10.0 }, &mut self.a);
        f(&Meta { name: "b", unit: "y s^alpha/u", lower: 0.0, upper: 10.0 }, &mut self.b);
        f(&Meta { name: "c", unit: "s^beta", lower: 0.0, upper: 10.0 }, &mut self.c);
        f(&Meta { name: "alpha", unit: "", lower: 0.0, upper: 1.0 }, &mut self.alpha);
        f(&Meta { name: "beta", unit: "", lower: 0.0, upper: 1.0 }, &mut self.beta);
    }
}

/// One side of the equation: `gain · g + weight · Σ ωₖ gₙ₋ₖ`.
#[derive(Clone, Debug, PartialEq)]
struct Side<T, W> {
    gain: T,
    weight: T,
    memory: W,
}

impl<T: Real, W: Memory<T>> Side<T, W> {
    fn new(gain: f64, weight: f64, mu: f64, order: GlOrder, h: f64) -> Result<Self, Error> {
        // p^(−μ) overflows for a period near the smallest number.
        let weight = finite("sample period", weight * libm::pow(h, -mu))?;
        Ok(Self {
            gain: coefficient("fractional gain", gain)?,
            weight: coefficient("sample period", weight)?,
            memory: W::new(mu, order)?,
        })
    }

    /// Returns the immediate response of the sum to a unit step.
    fn at_once(&self) -> T {
        self.gain + self.weight * self.memory.first()
    }

    /// Computes the sum at `g` from the last value and the held part of the derivative.
    #[inline]
    fn sum(&self, g: T, last: T, held: T) -> T {
        self.gain * g + self.weight * (self.memory.first() * (g - last) + held)
    }

    fn response(&self, z1: Complex) -> Complex {
        self.memory.response(z1) * self.weight.to_f64() + self.gain.to_f64()
    }
}

/// The LFDM at one sample period:
/// `xₙ (1 + c p^(−β) ω₀) = a uₙ + b p^(−α) Σ_{k≥0} ωₖ uₙ₋ₖ − c p^(−β) Σ_{k≥1} ωₖ xₙ₋ₖ`, the explicit solution of
/// eq. 15 with x for h and u for u_d. `W` is the [`Memory`] of its two derivatives.
///
/// The derivatives act on the deviation from the value of [`reset`](Stage::reset), so the model is settled there. It is
/// stable for all parameters: the phase shift of both derivatives is below 180°, so neither side of the equation has a
/// zero outside the unit circle. For a > 0 the inverse has the same type with exchanged sides.
///
/// ```
/// use hyst_core::{Build, Env, Exponentials, Invert, Lfdm, LfdmParams, Sampling, Stage};
/// let printed = LfdmParams::PRINTED;
/// let model: Lfdm<f64, Exponentials<f64, 40>> = printed.build(&Sampling { period: 1e-4 })?;
/// let inverse = model.invert()?;
/// let (mut s, mut i, env) = (model.state(), inverse.state(), Env::default());
/// let drive = inverse.reset(&mut i, &env, 2.0);
/// model.reset(&mut s, &env, drive);
/// for reference in [2.0, 3.0, 1.0, 1.5] {
///     let drive = inverse.step(&mut i, &env, reference);
///     assert!((model.step(&mut s, &env, drive) - reference).abs() < 1e-12);
/// }
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Lfdm<T, W> {
    input: Side<T, W>,
    output: Side<T, W>,
    /// 1 / immediate response of the output side to a unit step.
    scale: T,
    /// Output divided by input at rest.
    at_rest: T,
}

impl<T: Real, W: Memory<T>> Build<Lfdm<T, W>> for LfdmParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Lfdm<T, W>, Error> {
        let h = cx.checked()?;
        for (name, x) in [("lfdm.a", self.a), ("lfdm.b", self.b), ("lfdm.c", self.c)] {
            within(name, x, x >= 0.0, "zero or positive")?;
        }
        for (name, x) in [("lfdm.alpha", self.alpha), ("lfdm.beta", self.beta)] {
            within(name, x, (0.0..=1.0).contains(&x), "from 0 to 1")?;
        }
        Ok(Lfdm::of(
            Side::new(self.a, self.b, self.alpha, self.order, h)?,
            Side::new(1.0, self.c, self.beta, self.order, h)?,
        ))
    }
}

/// History of an [`Lfdm`].
#[derive(Clone, Debug, PartialEq)]
pub struct LfdmState<T, S> {
    /// Input and output at rest. `u` and `x` are deviations from them.
    rest: (T, T),
    u: T,
    x: T,
    /// Rounding error of `x`. In `f32` it accumulates increments below the resolution of x.
    rounding: T,
    /// The two derivatives of the next sample if input and output stay constant.
    held: (T, T),
    input: S,
    output: S,
    last: T,
}

impl<T: Real, W: Memory<T>> Lfdm<T, W> {
    fn of(input: Side<T, W>, output: Side<T, W>) -> Self {
        let scale = T::ONE / output.at_once();
        let at_rest = input.gain / output.gain;
        Self { input, output, scale, at_rest }
    }

    /// Returns the immediate response of the output to a unit step of the input \[y/u\].
    pub(super) fn at_once(&self) -> T {
        self.input.at_once() * self.scale
    }

    /// Computes the response of the sampled model with its memory at `z⁻¹` \[y/u\].
    pub fn response(&self, z1: Complex) -> Complex {
        self.input.response(z1) / self.output.response(z1)
    }

    /// Computes the increment of the output at the deviation `u` of the input.
    #[inline]
    fn rise(&self, s: &LfdmState<T, W::State>, u: T) -> T {
        let driven = self.input.sum(u, s.u, s.held.0);
        (driven - self.output.sum(s.x, s.x, s.held.1)) * self.scale
    }
}

impl<T: Real, const M: usize> Lfdm<T, ShortMemory<T, M>> {
    /// Returns the model with its memory truncated after `samples` if it is longer. Use it for a length that is known
    /// only at run time.
    pub fn cut(mut self, samples: usize) -> Self {
        self.input.memory = self.input.memory.cut(samples);
        self.output.memory = self.output.memory.cut(samples);
        self
    }
}

impl<T: Real, W: Memory<T>> Stage<T> for Lfdm<T, W> {
    type State = LfdmState<T, W::State>;

    fn state(&self) -> Self::State {
        LfdmState {
            rest: (T::ZERO, T::ZERO),
            u: T::ZERO,
            x: T::ZERO,
            rounding: T::ZERO,
            held: (T::ZERO, T::ZERO),
            input: self.input.memory.state(),
            output: self.output.memory.state(),
            last: T::ZERO,
        }
    }

    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        let u0 = rest(&mut s.last, u0);
        *s = LfdmState { rest: (u0, u0 * self.at_rest), last: u0, ..self.state() };
        s.rest.1
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let u = hold(&mut s.last, u) - s.rest.0;
        let rise = self.rise(s, u) + s.rounding;
        let x = s.x + rise;
        // An overflow must not stay in the state.
        if x.is_finite() {
            s.rounding = rise - (x - s.x);
            s.x = x;
        }
        s.u = u;
        s.held = (self.input.memory.advance(&mut s.input, u), self.output.memory.advance(&mut s.output, s.x));
        s.rest.1 + s.x
    }
}

impl<T: Real, W: Memory<T>> Probe<T> for Lfdm<T, W> {
    #[inline]
    fn probe(&self, s: &Self::State, _: &Env<T>, u: T) -> T {
        let u = if u.is_finite() { u } else { s.last } - s.rest.0;
        s.rest.1 + (s.x + (self.rise(s, u) + s.rounding))
    }
}

impl<T: Real, W: Memory<T>> Invert<T> for Lfdm<T, W> {
    type Inverse = Self;

    /// Solves the recursion for the input: an LFDM with `a′ = 1/a, b′ = c/a, c′ = b/a` and exchanged orders. It is
    /// stable and exact for the sampled model, and exists for a > 0.
    fn invert(&self) -> Result<Self, Error> {
        if self.input.gain > T::ZERO && self.input.at_once() > T::ZERO {
            Ok(Self::of(self.output.clone(), self.input.clone()))
        } else {
            Err(Error::NotInvertible("lfdm.a must be positive: without it a constant input gives no output"))
        }
    }
}

#[cfg(test)]
mod tests;
