//! The Bouc-Wen oscillator: a mass, a damper, a spring, and a parallel hysteretic force.

use crate::error::{coefficient, within};
use crate::stage::{hold, rest};
use crate::{Build, Env, Error, Meta, Params, Real, Sampling, Stage};

/// Maximum length of a substep, in radians of the fastest motion √((k + α)/m).
const SUBSTEP: f64 = 0.05;
/// Maximum number of substeps in one sample.
const SUBSTEPS: u32 = 128;
/// Maximum number of sign changes within one substep.
const PARTS: usize = 4;
/// Number of integration steps on the virgin curve to the rest position.
const VIRGIN_STEPS: u32 = 256;

/// Parameters of `m ÿ + c ẏ + k y + z = u`, `ż = α ẏ − β (γ |ẏ| |z|^(ν−1) z + δ ẏ |z|^ν)` (Noël and Schoukens 2016, eq.
/// 1, 2).
///
/// Units follow from input and output: with u in N and y in m, the mass is in kg, and so on.
/// [`BENCHMARK`](Self::BENCHMARK) is the published system. Valid are m, k > 0, c, α, β, γ ≥ 0 and ν from 1 to 20. With
/// γ + δ > 0 the force saturates at `|z| = (α / (β (γ + δ)))^(1/ν)`. With γ + δ < 0, as in the benchmark, it hardens:
/// the tangent stiffness rises with |z|. The substeps are chosen for k + α and resolve up to about ten times this
/// stiffness. Much larger drives give wrong (finite) outputs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BoucWenOscillatorParams {
    /// Mass m \[u s²/y\].
    pub mass: f64,
    /// Damping c \[u s/y\].
    pub damping: f64,
    /// Stiffness k of the spring without memory \[u/y\].
    pub stiffness: f64,
    /// α: stiffness of the hysteretic force at zero \[u/y\].
    pub alpha: f64,
    /// β: scale of the nonlinear terms \[u^(1−ν)/y\].
    pub beta: f64,
    /// γ: dissipation.
    pub gamma: f64,
    /// δ: difference between loading and unloading.
    pub delta: f64,
    /// ν: sharpness of the knee.
    pub nu: f64,
}

impl BoucWenOscillatorParams {
    /// The system of Noël and Schoukens 2016, in N and m: 35.6 Hz for small motions.
    pub const BENCHMARK: Self =
        Self { mass: 2.0, damping: 10.0, stiffness: 5e4, alpha: 5e4, beta: 1e3, gamma: 0.8, delta: -1.1, nu: 1.0 };
}

impl Params for BoucWenOscillatorParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const ANY: f64 = f64::INFINITY;
        f(&Meta { name: "mass", unit: "u s^2/y", lower: 0.0, upper: ANY }, &mut self.mass);
        f(&Meta { name: "damping", unit: "u s/y", lower: 0.0, upper: ANY }, &mut self.damping);
        f(&Meta { name: "stiffness", unit: "u/y", lower: 0.0, upper: ANY }, &mut self.stiffness);
        f(&Meta { name: "alpha", unit: "u/y", lower: 0.0, upper: ANY }, &mut self.alpha);
        f(&Meta { name: "beta", unit: "u^(1-nu)/y", lower: 0.0, upper: ANY }, &mut self.beta);
        f(&Meta { name: "gamma", unit: "", lower: 0.0, upper: ANY }, &mut self.gamma);
        f(&Meta { name: "delta", unit: "", lower: -ANY, upper: ANY }, &mut self.delta);
        f(&Meta { name: "nu", unit: "", lower: 1.0, upper: 20.0 }, &mut self.nu);
    }
}

impl<T: Real> Build<BoucWenOscillator<T>> for BoucWenOscillatorParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<BoucWenOscillator<T>, Error> {
        let h = cx.checked()?;
        let positive = |name, x: f64| within(name, x, x > 0.0, "positive");
        let not_negative = |name, x: f64| within(name, x, x >= 0.0, "zero or positive");
        let mass = positive("bouc-wen-oscillator.mass", self.mass)?;
        let damping = not_negative("bouc-wen-oscillator.damping", self.damping)?;
        let stiffness = positive("bouc-wen-oscillator.stiffness", self.stiffness)?;
        let alpha = not_negative("bouc-wen-oscillator.alpha", self.alpha)?;
        let beta = not_negative("bouc-wen-oscillator.beta", self.beta)?;
        let gamma = not_negative("bouc-wen-oscillator.gamma", self.gamma)?;
        let delta = crate::error::finite("bouc-wen-oscillator.delta", self.delta)?;
        let nu = within("bouc-wen-oscillator.nu", self.nu, (1.0..=20.0).contains(&self.nu), "from 1 to 20")?;
        let fastest = libm::sqrt((stiffness + alpha) / mass) + damping / mass;
        let substeps = libm::ceil(fastest * h / SUBSTEP).at_least(1.0);
        within(
            "sample period",
            h,
            substeps <= f64::from(SUBSTEPS),
            "at most 6.4 divided by (sqrt((stiffness + alpha) / mass) + damping / mass) of the oscillator",
        )?;
        Ok(BoucWenOscillator {
            per_mass: coefficient("bouc-wen-oscillator.mass", 1.0 / mass)?,
            damping: coefficient("bouc-wen-oscillator.damping", damping)?,
            stiffness: coefficient("bouc-wen-oscillator.stiffness", stiffness)?,
            alpha: coefficient("bouc-wen-oscillator.alpha", alpha)?,
            dissipation: coefficient("bouc-wen-oscillator.beta times gamma", beta * gamma)?,
            asymmetry: coefficient("bouc-wen-oscillator.beta times delta", beta * delta)?,
            nu: T::from_f64(nu),
            substeps: substeps as u32,
            substep: T::from_f64(h / substeps),
        })
    }
}

/// Coefficients of a Bouc-Wen oscillator at one sample period.
///
/// The input is linear between samples. The motion takes a fixed number of Runge-Kutta substeps per sample, each at
/// most 0.05 of 1/√((k + α)/m). A substep is split where velocity or force change their sign, so |ẏ| and |z| are smooth
/// in each part. For the benchmark at 750 Hz there are seven substeps, and the error is below 2e-6 of the output range.
///
/// The hysteresis is inside a feedback loop, so the oscillator is neither a chain of stages nor a stage of a chain. It
/// has no inverse here. In continuous time the inverse is explicit, `u = m ÿ + c ẏ + k y + z(y)`, and needs a reference
/// that is twice differentiable. The sampled model with a linear input between samples has zeros outside the unit
/// circle, so its exact inverse is unstable.
///
/// ```
/// use hyst_core::{BoucWenOscillator, BoucWenOscillatorParams, Build, Env, Sampling, Stage};
/// let model: BoucWenOscillator<f64> = BoucWenOscillatorParams::BENCHMARK.build(&Sampling { period: 1.0 / 750.0 })?;
/// let (mut s, e) = (model.state(), Env::default());
/// // 50 N on two springs of 5e4 N/m, one of them hardening: a little less than 0.5 mm.
/// let y = model.reset(&mut s, &e, 50.0);
/// assert!((4.8e-4..4.9e-4).contains(&y));
/// assert!((model.step(&mut s, &e, 50.0) - y).abs() < 1e-15);
/// // A sudden load gives overshoot, and the hysteresis keeps most of it.
/// model.reset(&mut s, &e, 0.0);
/// let last = (0..3000).map(|_| model.step(&mut s, &e, 50.0)).last();
/// assert!(last.is_some_and(|x| (2.0 * y..2.1 * y).contains(&x)));
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoucWenOscillator<T> {
    per_mass: T,
    damping: T,
    stiffness: T,
    alpha: T,
    /// βγ
    dissipation: T,
    /// βδ
    asymmetry: T,
    nu: T,
    substeps: u32,
    substep: T,
}

/// History of the oscillator: last input, position, velocity, hysteretic force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoucWenOscillatorState<T> {
    u: T,
    motion: Motion<T>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion<T> {
    y: T,
    v: T,
    z: T,
}

impl<T: Real> Motion<T> {
    #[inline]
    fn plus(self, h: T, rate: Self) -> Self {
        Self { y: self.y + h * rate.y, v: self.v + h * rate.v, z: self.z + h * rate.z }
    }

    fn is_finite(&self) -> bool {
        self.y.is_finite() && self.v.is_finite() && self.z.is_finite()
    }
}

/// Signs of velocity and hysteretic force, ±1.
#[derive(Clone, Copy)]
struct Quadrant<T> {
    velocity: T,
    force: T,
}

/// Returns ±1, or `None` for zero.
fn sign<T: Real>(x: T) -> Option<T> {
    if x > T::ZERO {
        Some(T::ONE)
    } else if x < T::ZERO {
        Some(-T::ONE)
    } else {
        None
    }
}

/// Returns the share of the distance from `a` to `b` < 0 at which a line between them is zero; `None` if `b` is not
/// negative.
fn zero_between<T: Real>(a: T, b: T) -> Option<T> {
    if b < T::ZERO { Some((a / (a - b)).at_least(T::ZERO)) } else { None }
}

/// The input during a substep: its value at the start and its slope.
#[derive(Clone, Copy)]
struct Ramp<T> {
    u: T,
    slope: T,
}

impl<T: Real> BoucWenOscillator<T> {
    /// Returns the number of substeps of one sample.
    pub fn substeps(&self) -> u32 {
        self.substeps
    }

    /// Returns |z|^ν for a force with this sign. A Runge-Kutta stage beyond zero counts as zero.
    #[inline]
    fn power(&self, z: T, sign: T) -> T {
        if self.nu == T::ONE { z * sign } else { (z * sign).at_least(T::ZERO).powf(self.nu) }
    }

    /// Returns the rate of change while velocity and hysteretic force have the signs of `quadrant`.
    #[inline]
    fn rate(&self, s: Motion<T>, u: T, quadrant: Quadrant<T>) -> Motion<T> {
        let factor = self.dissipation * quadrant.velocity * quadrant.force + self.asymmetry;
        Motion {
            y: s.v,
            v: (u - self.damping * s.v - self.stiffness * s.y - s.z) * self.per_mass,
            z: s.v * (self.alpha - factor * self.power(s.z, quadrant.force)),
        }
    }

    /// Computes one Runge-Kutta step of length `h`.
    #[inline]
    fn runge_kutta(&self, s: Motion<T>, input: Ramp<T>, at: Quadrant<T>, h: T) -> Motion<T> {
        let half = h * T::from_f64(0.5);
        let (middle, end) = (input.u + half * input.slope, input.u + h * input.slope);
        let first = self.rate(s, input.u, at);
        let second = self.rate(s.plus(half, first), middle, at);
        let third = self.rate(s.plus(half, second), middle, at);
        let fourth = self.rate(s.plus(h, third), end, at);
        let sixth = h * T::from_f64(1.0 / 6.0);
        let mean = |a: T, b: T, c: T, d: T| a + (b + b) + (c + c) + d;
        s.plus(
            sixth,
            Motion {
                y: mean(first.y, second.y, third.y, fourth.y),
                v: mean(first.v, second.v, third.v, fourth.v),
                z: mean(first.z, second.z, third.z, fourth.z),
            },
        )
    }

    /// Computes one substep. It is split where velocity or force change their sign, so |ẏ| and |z| are smooth in each
    /// part.
    fn advance(&self, mut s: Motion<T>, mut input: Ramp<T>, mut h: T) -> Motion<T> {
        // From rest the sign of the velocity is that of the net force, or of its change.
        let net = input.u - self.stiffness * s.y - s.z;
        let velocity = sign(s.v).or(sign(net)).or(sign(input.slope)).unwrap_or(T::ONE);
        let mut at = Quadrant { velocity, force: sign(s.z).unwrap_or(velocity) };
        for _ in 0..PARTS {
            let end = self.runge_kutta(s, input, at, h);
            let reversal = zero_between(s.v * at.velocity, end.v * at.velocity);
            let crossing = zero_between(s.z * at.force, end.z * at.force);
            let first = reversal.unwrap_or(T::ONE).at_most(crossing.unwrap_or(T::ONE));
            if reversal.is_none() && crossing.is_none() {
                return end;
            }
            let part = h * first;
            s = self.runge_kutta(s, input, at, part);
            input.u += part * input.slope;
            h -= part;
            if reversal.is_some_and(|t| t <= first) {
                at.velocity = -at.velocity;
            } else {
                at.force = -at.force;
            }
        }
        self.runge_kutta(s, input, at, h)
    }

    /// Returns the hysteretic force at rest on the virgin curve under the load `u0`: `dz/du = F/(k + F)`,
    /// `F = α − β (γ + δ) |z|^ν`.
    fn virgin(&self, u0: T) -> T {
        let slope = |z: T| {
            let force = (self.alpha - (self.dissipation + self.asymmetry) * self.power(z, T::ONE)).at_least(T::ZERO);
            force / (self.stiffness + force)
        };
        let h = u0.abs() * T::from_f64(1.0 / f64::from(VIRGIN_STEPS));
        let half = h * T::from_f64(0.5);
        let mut z = T::ZERO;
        for _ in 0..VIRGIN_STEPS {
            let first = slope(z);
            let second = slope(z + half * first);
            let third = slope(z + half * second);
            let fourth = slope(z + h * third);
            z += h * T::from_f64(1.0 / 6.0) * (first + (second + second) + (third + third) + fourth);
        }
        if u0 < T::ZERO { -z } else { z }
    }
}

impl<T: Real> Stage<T> for BoucWenOscillator<T> {
    type State = BoucWenOscillatorState<T>;

    fn state(&self) -> Self::State {
        BoucWenOscillatorState { u: T::ZERO, motion: Motion { y: T::ZERO, v: T::ZERO, z: T::ZERO } }
    }

    /// Sets the oscillator to rest under the load `u0`, after a rise from zero with virgin memory.
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        let u = rest(&mut s.u, u0);
        let z = self.virgin(u);
        *s = BoucWenOscillatorState { u, motion: Motion { y: (u - z) / self.stiffness, v: T::ZERO, z } };
        s.motion.y
    }

    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let from = s.u;
        let to = hold(&mut s.u, u);
        let count = T::from_f64(f64::from(self.substeps));
        let slope = (to - from) / (count * self.substep);
        let mut motion = s.motion;
        for k in 0..self.substeps {
            let passed = T::from_f64(f64::from(k)) / count;
            motion = self.advance(motion, Ramp { u: from + (to - from) * passed, slope }, self.substep);
        }
        // If the substeps do not resolve the stiffness and the motion overflows, the oscillator stops at its last
        // position.
        s.motion = if motion.is_finite() { motion } else { Motion { v: T::ZERO, ..s.motion } };
        s.motion.y
    }
}

#[cfg(test)]
mod tests;
