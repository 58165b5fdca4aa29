//! Rate-dependent hysteresis of any operator: the loop widens with a power of the rate of the drive.
//!
//! The input of the operator is v. It trails the drive u by an overdrive that grows with a power of the rate,
//!
//! ```text
//! o(x) = V |x / s|ᵖ sgn x,
//! ```
//!
//! where s is a reference rate. There are three laws; on a ramp they are equal:
//!
//! - *Relaxes*: `u − v = o(v̇)`. The domain walls have a viscous drag, and v continues to move while the drive is at
//!   rest, at `v̇ = s (|u − v| / V)^{1/p}`. p = 1 is a first-order lag with time constant V/s. Each sample is one
//!   implicit (backward) Euler step, so the inverse `u = v + o(v̇)` is exact.
//! - *Holds*: `v ← max(u − |o(u̇)|, min(u + |o(u̇)|, v))`, a play operator whose threshold follows the rate of the
//!   drive. It is equivalent to adding |o| to each threshold of the operator (Al Janaideh, Su and Rakheja 2008:
//!   rate-dependent thresholds).
//! - *Follows*: `v = u − o(u̇)` at once, also at a reversal: the width of the loop depends only on the present rate.
//!
//! p = 1/2 is dry friction with a viscous film. A small p is nearly the logarithm of the rate.

use crate::error::{coefficient, within};
use crate::stage::finite_or;
use crate::{Build, Env, Error, Invert, Meta, Params, Real, Sampling, Stage};

/// Law of v when the rate of the drive changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum RateLaw {
    /// `v = u − o(u̇)`.
    Follows,
    /// `v ← max(u − |o(u̇)|, min(u + |o(u̇)|, v))`.
    Holds,
    /// `u − v = o(v̇)`.
    #[default]
    Relaxes,
}

impl RateLaw {
    /// All laws.
    pub const ALL: [Self; 3] = [Self::Follows, Self::Holds, Self::Relaxes];
}

/// Parameters of the overdrive `V |x / s|ᵖ`. With V = 0 there is no rate dependence.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RateParams {
    /// Overdrive V at the reference rate \[input unit\].
    pub volts: f64,
    /// Exponent p.
    pub exponent: f64,
    /// Reference rate s \[input unit/s\]; a convention, not identified.
    pub reference_rate: f64,
    /// Law of v when the rate changes.
    pub law: RateLaw,
}

impl Default for RateParams {
    fn default() -> Self {
        Self { volts: 0.0, exponent: 0.5, reference_rate: 1.0, law: RateLaw::Relaxes }
    }
}

impl Params for RateParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "volts", unit: "u", lower: 0.0, upper: f64::INFINITY }, &mut self.volts);
        f(&Meta { name: "exponent", unit: "", lower: MIN_EXPONENT, upper: 1.0 }, &mut self.exponent);
    }
}

/// Minimum exponent. Below it the overdrive is almost the same at all rates, as a wider loop of the operator itself is.
const MIN_EXPONENT: f64 = 0.05;

/// Coefficients of the rate stage at one sample period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate<T> {
    volts: T,
    exponent: T,
    /// 1 / (s h): converts a step of one sample to reference rates.
    per_step: T,
    law: RateLaw,
}

impl<T: Real> Build<Rate<T>> for RateParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Rate<T>, Error> {
        within("rate.volts", self.volts, self.volts >= 0.0, "zero or positive")?;
        let in_range = (MIN_EXPONENT..=1.0).contains(&self.exponent);
        within("rate.exponent", self.exponent, in_range, "between 0.05 and 1")?;
        within("rate.reference_rate", self.reference_rate, self.reference_rate > 0.0, "positive")?;
        Ok(Rate {
            volts: coefficient("rate.volts", self.volts)?,
            exponent: coefficient("rate.exponent", self.exponent)?,
            per_step: coefficient("rate.reference_rate", 1.0 / (self.reference_rate * cx.checked()?))?,
            law: self.law,
        })
    }
}

/// History of the stage or of its inverse: last u and v.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RateState<T> {
    u: T,
    v: T,
}

impl<T: Real> Rate<T> {
    /// Returns |o| for a change of its argument by `step` in one sample.
    #[inline]
    fn overdrive(&self, step: T) -> T {
        let x = step.abs() * self.per_step;
        // Saves the power while the drive is at rest.
        if x > T::ZERO { self.volts * x.powf(self.exponent) } else { T::ZERO }
    }

    /// Returns the overdrive after one implicit step: the root o of `o + (o/V)^{1/p} s h = d`, where d ≥ 0 is the
    /// distance from the last v to the drive.
    ///
    /// The left side is convex and rising, and the start is at or above the root. Newton's method therefore converges
    /// monotonically.
    #[inline]
    fn implicit_overdrive(&self, d: T) -> T {
        let mut o = d.at_most(self.overdrive(d));
        if o <= T::ZERO {
            return T::ZERO;
        }
        let inverse = T::ONE / self.exponent;
        for _ in 0..NEWTON_STEPS {
            let step = (o / self.volts).powf(inverse) / self.per_step;
            let down = (o + step - d) / (T::ONE + step * inverse / o);
            o = (o - down).at_least(T::ZERO);
            // Quadratic convergence: the next relative step would be about the square of this one.
            if o <= T::ZERO || (down / o) * (down / o) <= T::EPSILON {
                break;
            }
        }
        o
    }
}

/// Maximum number of Newton steps. The slowest case, exponent 0.05, needs eight for the last bit of f64.
const NEWTON_STEPS: usize = 10;

impl<T: Real> Stage<T> for Rate<T> {
    type State = RateState<T>;

    fn state(&self) -> RateState<T> {
        RateState::default()
    }

    #[inline]
    fn reset(&self, s: &mut RateState<T>, _: &Env<T>, u0: T) -> T {
        let u0 = finite_or(u0, T::ZERO);
        *s = RateState { u: u0, v: u0 };
        u0
    }

    #[inline]
    fn step(&self, s: &mut RateState<T>, _: &Env<T>, u: T) -> T {
        let u = finite_or(u, s.u);
        s.v = match self.law {
            RateLaw::Follows => {
                let o = self.overdrive(u - s.u);
                if u > s.u { u - o } else { u + o }
            }
            RateLaw::Holds => {
                let o = self.overdrive(u - s.u);
                s.v.at_most(u + o).at_least(u - o)
            }
            RateLaw::Relaxes => {
                let o = self.implicit_overdrive((u - s.v).abs());
                if u > s.v { u - o } else { u + o }
            }
        };
        s.u = u;
        s.v
    }
}

/// Inverse of the rate stage: the drive `u = v + o(v̇)` for a wanted input v of the operator.
///
/// It is exact for [`RateLaw::Relaxes`]. For the other laws it uses the rate of v instead of the rate of the drive. It
/// is then exact at a constant rate. At a changing rate the error is o(do/dt), of second order in the overdrive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateInverse<T> {
    forward: Rate<T>,
}

impl<T: Real> Invert<T> for Rate<T> {
    type Inverse = RateInverse<T>;
    fn invert(&self) -> Result<RateInverse<T>, Error> {
        Ok(RateInverse { forward: *self })
    }
}

impl<T: Real> Stage<T> for RateInverse<T> {
    type State = RateState<T>;

    fn state(&self) -> RateState<T> {
        RateState::default()
    }

    #[inline]
    fn reset(&self, s: &mut RateState<T>, e: &Env<T>, u0: T) -> T {
        self.forward.reset(s, e, u0)
    }

    #[inline]
    fn step(&self, s: &mut RateState<T>, _: &Env<T>, v: T) -> T {
        let v = finite_or(v, s.v);
        let o = self.forward.overdrive(v - s.v);
        let u = if v > s.v { v + o } else { v - o };
        s.v = v;
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CX: Sampling = Sampling { period: 1e-3 };

    fn built(volts: f64, exponent: f64, law: RateLaw) -> Rate<f64> {
        RateParams { volts, exponent, reference_rate: 100.0, law }.build(&CX).unwrap()
    }

    fn run(rate: &Rate<f64>, drive: &[f64]) -> std::vec::Vec<f64> {
        let mut s = rate.state();
        rate.reset(&mut s, &Env::default(), drive[0]);
        drive.iter().map(|u| rate.step(&mut s, &Env::default(), *u)).collect()
    }

    /// At four times the reference rate the overdrive of a square-root law is 2 V, up and down.
    #[test]
    fn v_trails_a_ramp_by_the_overdrive_of_its_rate() {
        for law in RateLaw::ALL {
            let rate = built(1.5, 0.5, law);
            let up: std::vec::Vec<f64> = (0..200).map(|k| 0.4 * f64::from(k)).collect();
            let last = run(&rate, &up)[199];
            assert!((79.6 - 3.0 - last).abs() < 1e-12, "{last}");
            let down: std::vec::Vec<f64> = up.iter().rev().copied().collect();
            let last = run(&rate, &down)[199];
            assert!((last - 3.0).abs() < 1e-12, "{last}");
        }
    }

    #[test]
    fn without_overdrive_v_is_the_drive() {
        let drive: std::vec::Vec<f64> = (0..300).map(|k| 40.0 * libm::sin(0.05 * f64::from(k))).collect();
        for law in RateLaw::ALL {
            assert_eq!(run(&built(0.0, 0.4, law), &drive), drive);
        }
    }

    #[test]
    fn with_holds_v_never_moves_against_the_drive_nor_beyond_its_reversals() {
        let drive: std::vec::Vec<f64> = (0..900).map(|k| 40.0 * libm::sin(0.01 * f64::from(k))).collect();
        let v = run(&built(2.0, 0.5, RateLaw::Holds), &drive);
        for k in 3..drive.len() {
            let (du, dv) = (drive[k] - drive[k - 1], v[k] - v[k - 1]);
            // The slowest sample near a reversal, at which v reaches the drive, may be the one after it.
            let reversed = du * (drive[k - 2] - drive[k - 3]) < 0.0;
            assert!(reversed || du * dv >= -1e-15, "row {k}: {du} {dv}");
        }
        assert!(v.iter().fold(0.0, |m: f64, v| m.max(*v)) <= 40.0);
    }

    /// Backward Euler at order 1: `v ← v + (u − v) h / (h + τ)`.
    #[test]
    fn relaxes_with_exponent_one_is_a_lag() {
        let drive: std::vec::Vec<f64> = (0..900).map(|k| 40.0 * libm::sin(0.03 * f64::from(k))).collect();
        let (found, tau) = (run(&built(0.7, 1.0, RateLaw::Relaxes), &drive), 0.7 / 100.0);
        let mut v = drive[0];
        for (found, u) in found.iter().zip(&drive) {
            v += (u - v) * CX.period / (CX.period + tau);
            assert!((found - v).abs() < 1e-12, "{found} {v}");
        }
    }

    #[test]
    fn relaxes_continues_while_the_drive_is_at_rest() {
        let step: std::vec::Vec<f64> = (0..4000).map(|k| if k < 10 { 0.0 } else { 30.0 }).collect();
        // u − v = x: ẋ = −s (x / V)^{1/p} = −100 x³ / 8, so 1 / x² = 1 / 30² + 25 t.
        let rate = built(2.0, 1.0 / 3.0, RateLaw::Relaxes);
        let overdrive = 30.0 - run(&rate, &step)[3999];
        let exact = 1.0 / libm::sqrt(1.0 / 900.0 + 25.0 * 3.99);
        assert!((overdrive / exact - 1.0).abs() < 1e-3, "{overdrive} {exact}");
    }

    #[test]
    fn the_inverse_of_relaxes_is_exact() {
        let wanted: std::vec::Vec<f64> =
            (0..900).map(|k| 40.0 * libm::sin(0.03 * f64::from(k)) + 3.0 * f64::from(k % 7)).collect();
        for exponent in [0.05, 0.1, 0.3, 0.5, 0.8, 1.0] {
            let rate = built(4.0, exponent, RateLaw::Relaxes);
            let inverse = rate.invert().unwrap();
            let mut s = inverse.state();
            inverse.reset(&mut s, &Env::default(), wanted[0]);
            let drive: std::vec::Vec<f64> = wanted.iter().map(|v| inverse.step(&mut s, &Env::default(), *v)).collect();
            for (reached, wanted) in run(&rate, &drive).iter().zip(&wanted) {
                assert!((reached - wanted).abs() < 1e-11, "{exponent}: {reached} {wanted}");
            }
        }
    }

    /// The rate of a triangle is constant except at the reversals. Forward after inverse has errors only there.
    #[test]
    fn the_inverse_is_exact_at_a_constant_rate() {
        let rate = built(1.0, 0.6, RateLaw::Holds);
        let inverse = rate.invert().unwrap();
        let wanted: std::vec::Vec<f64> = (0..400).map(|k| 0.2 * f64::from((k % 200).min(200 - k % 200))).collect();
        let mut s = inverse.state();
        inverse.reset(&mut s, &Env::default(), wanted[0]);
        let drive: std::vec::Vec<f64> = wanted.iter().map(|v| inverse.step(&mut s, &Env::default(), *v)).collect();
        let reached = run(&rate, &drive);
        for k in (20..90).chain(120..190) {
            assert!((reached[k] - wanted[k]).abs() < 1e-9, "row {k}: {} {}", reached[k], wanted[k]);
        }
    }

    #[test]
    fn parameters_out_of_range_are_rejected() {
        let rejected = |p: RateParams| matches!(Build::<Rate<f64>>::build(&p, &CX), Err(Error::OutOfRange { .. }));
        assert!(rejected(RateParams { volts: -1.0, ..RateParams::default() }));
        assert!(rejected(RateParams { exponent: 0.0, ..RateParams::default() }));
        assert!(rejected(RateParams { exponent: 1.2, ..RateParams::default() }));
        assert!(rejected(RateParams { reference_rate: 0.0, ..RateParams::default() }));
    }
}
