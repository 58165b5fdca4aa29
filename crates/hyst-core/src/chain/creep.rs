//! Creep: a bank of first-order elements in parallel with the identity.
//!
//! `y = v + Σᵢ cᵢ xᵢ`, `τᵢ ẋᵢ = v − xᵢ`. With time constants spaced evenly on a logarithmic axis the step response
//! rises with log t, as that of piezoceramics does (Janocha and Kuhnen 2000). The share cᵢ of an element is 1–2 % per
//! decade in ordinary ceramics.

use crate::chain::FirstOrder;
use crate::error::{coefficient, within};
use crate::stage::{finite_or, hold, rest};
use crate::zeros::none_outside;
use crate::{Build, Complex, Env, Error, Invert, Meta, Params, Real, Sampling, Stage};

/// Parameters of a creep bank: element i adds `shares[i] · xᵢ`, `τᵢ ẋᵢ = v − xᵢ`. `L` is any list of numbers: a vector,
/// an array, a slice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CreepParams<L> {
    /// Time constants τᵢ \[s\], positive.
    pub seconds: L,
    /// Shares cᵢ of the settled elements in the output \[ratio\].
    pub shares: L,
}

/// Coefficients of a bank of at most `N` elements; exact for an input that is linear between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep<T, const N: usize> {
    elements: [FirstOrder<T>; N],
    shares: [T; N],
    len: usize,
}

impl<L: AsRef<[f64]>> CreepParams<L> {
    /// Returns the sum of the shares: the settled creep after a step, relative to the immediate response.
    pub fn total(&self) -> f64 {
        self.shares.as_ref().iter().fold(0.0, |sum, c| sum + c)
    }
}

impl<L: AsMut<[f64]>> Params for CreepParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        for tau in self.seconds.as_mut() {
            f(&Meta { name: "seconds", unit: "s", lower: 0.0, upper: f64::INFINITY }, tau);
        }
        for c in self.shares.as_mut() {
            f(&Meta { name: "shares", unit: "", lower: 0.0, upper: MAX_SHARE }, c);
        }
    }
}

/// Maximum plausible share of one element. Ceramics creep by 1–2 % per decade of time. With two elements per decade
/// this limit allows ten times as much; a larger share would model hysteresis.
const MAX_SHARE: f64 = 0.08;

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<Creep<T, N>> for CreepParams<L> {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Creep<T, N>, Error> {
        let h = cx.checked()?;
        let (seconds, shares) = (self.seconds.as_ref(), self.shares.as_ref());
        if seconds.len() != shares.len() {
            return Err(Error::Lengths("creep.seconds and creep.shares"));
        }
        if seconds.len() > N {
            return Err(Error::Capacity { name: "creep elements", needed: seconds.len(), holds: N });
        }
        let mut creep =
            Creep { elements: [FirstOrder { a: T::ZERO, b: T::ZERO }; N], shares: [T::ZERO; N], len: seconds.len() };
        let slots = creep.elements.iter_mut().zip(&mut creep.shares);
        for ((element, share), (tau, c)) in slots.zip(seconds.iter().zip(shares)) {
            within("creep.seconds", *tau, *tau > 0.0, "positive")?;
            *element = FirstOrder::new("creep.seconds", h, *tau)?;
            *share = coefficient("creep.shares", *c)?;
        }
        Ok(creep)
    }
}

/// History of a creep bank: one state per element and the last input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreepState<T, const N: usize> {
    x: [T; N],
    v: T,
}

impl<T: Real, const N: usize> CreepState<T, N> {
    pub(crate) fn new() -> Self {
        Self { x: [T::ZERO; N], v: T::ZERO }
    }
}

impl<T: Real, const N: usize> Creep<T, N> {
    /// Sets the history to rest at v.
    fn rest(&self, s: &mut CreepState<T, N>, v: T) {
        *s = CreepState { x: [v; N], v };
    }

    /// Returns Σ cᵢ: the settled creep after a step, relative to the immediate response.
    fn total(&self) -> T {
        self.shares.iter().take(self.len).fold(T::ZERO, |sum, c| sum + *c)
    }
}

impl<T: Real, const N: usize> Stage<T> for Creep<T, N> {
    type State = CreepState<T, N>;

    fn state(&self) -> Self::State {
        CreepState::new()
    }

    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        let u0 = finite_or(u0, T::ZERO);
        self.rest(s, u0);
        u0 + self.total() * u0
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let u = finite_or(u, s.v);
        let mut y = u;
        for ((x, e), c) in s.x.iter_mut().zip(&self.elements).zip(&self.shares).take(self.len) {
            *x = e.step(*x, s.v, u);
            y += *c * *x;
        }
        s.v = u;
        y
    }
}

/// Histories of `L` signals in one bank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreepSideBySide<T, const N: usize, const L: usize> {
    x: [[T; L]; N],
    v: [T; L],
}

impl<T: Real, const N: usize> Creep<T, N> {
    /// As [`reset`](Stage::reset) for several signals: returns their histories and outputs at rest at `u0`.
    pub fn reset_side_by_side<const L: usize>(&self, u0: [T; L]) -> (CreepSideBySide<T, N, L>, [T; L]) {
        let v = u0.map(|u| finite_or(u, T::ZERO));
        (CreepSideBySide { x: [v; N], v }, v.map(|v| v + self.total() * v))
    }

    /// As [`step`](Stage::step) for several signals. Each output is bit-identical to that of a single signal; vector
    /// instructions make it faster.
    #[inline]
    pub fn step_side_by_side<const L: usize>(&self, s: &mut CreepSideBySide<T, N, L>, u: [T; L]) -> [T; L] {
        let mut v = u;
        v.iter_mut().zip(&s.v).for_each(|(v, last)| *v = finite_or(*v, *last));
        let mut y = v;
        for ((x, e), c) in s.x.iter_mut().zip(&self.elements).zip(&self.shares).take(self.len) {
            for (((x, y), last), v) in x.iter_mut().zip(&mut y).zip(&s.v).zip(&v) {
                *x = e.step(*x, *last, *v);
                *y += *c * *x;
            }
        }
        s.v = v;
        y
    }
}

/// Exact inverse of a creep bank: the recursion solved for its input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreepInverse<T, const N: usize> {
    forward: Creep<T, N>,
    /// 1 / (1 + Σ cᵢ bᵢ): inverse of the bank's gain within one sample.
    scale: T,
    /// 1 / (1 + Σ cᵢ): inverse of its gain at rest.
    at_rest: T,
}

impl<T: Real, const N: usize> Invert<T> for Creep<T, N> {
    type Inverse = CreepInverse<T, N>;

    /// The inverse is exact. For shares ≥ 0 it is stable, because the zeros of the bank interlace with its stable
    /// poles. For negative shares the zeros are checked: a zero outside the unit circle makes the inverse unstable.
    fn invert(&self) -> Result<Self::Inverse, Error> {
        let mut at_once = T::ONE;
        for (e, c) in self.elements.iter().zip(&self.shares).take(self.len) {
            at_once += *c * e.b;
        }
        let settled = T::ONE + self.total();
        let bank = || self.elements.iter().zip(&self.shares).take(self.len);
        let interlaced = bank().all(|(_, c)| *c >= T::ZERO);
        let response = |theta: f64| {
            let z1 = Complex::polar(1.0, -theta);
            bank().fold(Complex::from(1.0), |sum, (e, c)| sum + e.response(z1) * c.to_f64())
        };
        if at_once > T::ZERO && settled > T::ZERO && (interlaced || none_outside(0.05, response)) {
            Ok(CreepInverse { forward: *self, scale: T::ONE / at_once, at_rest: T::ONE / settled })
        } else {
            Err(Error::NotInvertible("the negative creep shares are too large: the inverse would be unstable"))
        }
    }
}

/// History of the inverse: that of the bank, and the last reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreepInverseState<T, const N: usize> {
    bank: CreepState<T, N>,
    reference: T,
}

impl<T: Real, const N: usize> CreepInverseState<T, N> {
    pub(crate) fn new() -> Self {
        Self { bank: CreepState::new(), reference: T::ZERO }
    }
}

impl<T: Real, const N: usize> Stage<T> for CreepInverse<T, N> {
    type State = CreepInverseState<T, N>;

    fn state(&self) -> Self::State {
        CreepInverseState::new()
    }

    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        let v = rest(&mut s.reference, u0) * self.at_rest;
        self.forward.rest(&mut s.bank, v);
        v
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let u = hold(&mut s.reference, u);
        let s = &mut s.bank;
        // Elements for a constant input; the difference to them is proportional to v − s.v.
        let mut held = T::ZERO;
        let f = &self.forward;
        for ((x, e), c) in s.x.iter_mut().zip(&f.elements).zip(&f.shares).take(f.len) {
            *x = e.step(*x, s.v, s.v);
            held += *c * *x;
        }
        // u = v + held + Σ c b (v − s.v), solved for v.
        let v = finite_or(s.v + (u - s.v - held) * self.scale, s.v);
        for (x, e) in s.x.iter_mut().zip(&f.elements).take(f.len) {
            *x += e.b * (v - s.v);
        }
        s.v = v;
        v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BANK: CreepParams<[f64; 4]> =
        CreepParams { seconds: [0.05, 0.5, 5.0, 50.0], shares: [0.02, 0.015, 0.01, 0.02] };

    #[test]
    fn a_step_creeps_by_the_sum_of_exponentials() {
        let h = 0.01;
        let creep: Creep<f64, 4> = BANK.build(&Sampling { period: h }).unwrap();
        let (mut s, e) = (creep.state(), Env::default());
        creep.reset(&mut s, &e, 0.0);
        // Between the samples at 0 and h the input rises linearly; a ramp is the step's integral.
        creep.step(&mut s, &e, 1.0);
        for k in 2..2000 {
            let t = h * f64::from(k);
            let y = creep.step(&mut s, &e, 1.0);
            let mut expected = 1.0;
            for (tau, c) in BANK.seconds.iter().zip(BANK.shares) {
                let decayed = tau / h * (libm::exp(-(t - h) / tau) - libm::exp(-t / tau));
                expected += c * (1.0 - decayed);
            }
            assert!((y - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn inverse_is_exact_at_all_sample_periods() {
        for h in [1e-5, 1e-2, 10.0] {
            let creep: Creep<f64, 4> = BANK.build(&Sampling { period: h }).unwrap();
            let inverse = creep.invert().unwrap();
            let (mut s, mut i, e) = (creep.state(), inverse.state(), Env::default());
            let first = inverse.reset(&mut i, &e, 0.7);
            assert!((creep.reset(&mut s, &e, first) - 0.7).abs() < 1e-14);
            for k in 0..5000 {
                let reference = libm::sin(0.1 * f64::from(k)) + libm::sin(2.3 * f64::from(k));
                let v = inverse.step(&mut i, &e, reference);
                assert!((creep.step(&mut s, &e, v) - reference).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn several_signals_give_the_bits_of_single_ones() {
        let creep: Creep<f64, 6> = BANK.build(&Sampling { period: 0.01 }).unwrap();
        let signals = |k: u32| -> [f64; 3] {
            let gap = if k == 70 { f64::NAN } else { 1.0 };
            [0.3 + libm::sin(0.1 * f64::from(k)), gap * libm::cos(0.7 * f64::from(k)), -2.0]
        };
        let (mut state, first) = creep.reset_side_by_side(signals(0));
        let (mut alone, e) = ([creep.state(); 3], Env::default());
        for j in 0..3 {
            assert_eq!(creep.reset(&mut alone[j], &e, signals(0)[j]), first[j]);
        }
        for k in 1..200 {
            let together = creep.step_side_by_side(&mut state, signals(k));
            for j in 0..3 {
                assert_eq!(creep.step(&mut alone[j], &e, signals(k)[j]), together[j]);
            }
        }
    }

    /// A small negative share has a stable inverse. A larger one has a zero outside the unit circle.
    #[test]
    fn an_unstable_inverse_is_rejected() {
        let bank = |shares: [f64; 2]| -> Creep<f64, 2> {
            CreepParams { seconds: [1.0, 0.01], shares }.build(&Sampling { period: 1e-4 }).unwrap()
        };
        assert!(matches!(bank([0.5, -1.2]).invert(), Err(Error::NotInvertible(_))));
        let creep = bank([0.05, -0.1]);
        let inverse = creep.invert().unwrap();
        let (mut s, mut i, e) = (creep.state(), inverse.state(), Env::default());
        inverse.reset(&mut i, &e, 0.0);
        creep.reset(&mut s, &e, 0.0);
        for k in 0..30_000 {
            let v = inverse.step(&mut i, &e, 1.0);
            assert!((creep.step(&mut s, &e, v) - 1.0).abs() < 1e-11 && v.abs() < 2.0, "{k} {v}");
        }
    }

    #[test]
    fn unequal_lists_are_rejected() {
        let built: Result<Creep<f64, 4>, _> =
            CreepParams { seconds: &[1.0][..], shares: &[] }.build(&Sampling { period: 1.0 });
        assert!(matches!(built, Err(Error::Lengths(_))));
    }
}
