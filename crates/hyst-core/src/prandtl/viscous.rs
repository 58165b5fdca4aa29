//! Rate-dependence in a Prandtl-Ishlinskii operator: plays that slide with viscous drag, and their exact inverse.
//!
//! Loops of piezoceramics widen with frequency. Two forms are in use. Thresholds that grow with the input's rate,
//! `r(u̇) = r + λ|u̇|` (Al Janaideh and Krejčí 2013), make the play follow `u − λ u̇`: a zero in the right half plane, so no causal
//! inverse. Here the play itself drags, `λ ṗ = dead_r(u − p)`: the same widening at small λ times the rate, but a lag that
//! acts only while the play slides, which is monotone in the present input and has an exact inverse.

use crate::error::within;
use crate::stage::{hold, rest};
use crate::{Build, Env, Error, Invert, Meta, Params, PiParams, Real, Sampling, Stage};

/// Parameters of `y = p₀ u + Σᵢ wᵢ pᵢ`, `λ ṗᵢ = dead_{rᵢ}(u − pᵢ)`, where `dead_r(x)` is 0 for |x| ≤ r and `x ∓ r` beyond. λ = 0 is the
/// rate-independent operator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ViscousPiParams<L> {
    /// Gain, thresholds and weights.
    pub pi: PiParams<L>,
    /// Drag λ \[s\], zero or positive.
    pub seconds: f64,
}

impl<L: AsMut<[f64]>> Params for ViscousPiParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        self.pi.visit_as(["pi.gain", "pi.thresholds", "pi.weights"], f);
        f(&Meta { name: "seconds", unit: "s", lower: 0.0, upper: 1.0 }, &mut self.seconds);
    }
}

/// Coefficients at one sample period, at most `N` plays.
///
/// A sample moves a sliding play by `a dead_r(u − p)`, `a = h/(h + λ)` (backward Euler): on a ramp it lags by exactly λ times the
/// rate at any sample period, it is stable at any, and it is the ordinary play at λ = 0.
///
/// ```
/// use hyst_core::{Build, Env, Invert, PiParams, Sampling, Stage, ViscousPi, ViscousPiParams};
/// let pi = PiParams { gain: 0.1, thresholds: [10.0, 20.0], weights: [0.02, 0.01] };
/// let model: ViscousPi<f64, 2> = ViscousPiParams { pi, seconds: 0.002 }.build(&Sampling { period: 1e-3 })?;
/// let inverse = model.invert()?;
/// let (mut forward, mut backward, env) = (model.state(), inverse.state(), Env::default());
/// for reference in [0.0, 1.0, 4.0, 2.5, 3.0] {
///     let drive = inverse.step(&mut backward, &env, reference);
///     assert!((model.step(&mut forward, &env, drive) - reference).abs() < 1e-12);
/// }
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousPi<T, const N: usize> {
    gain: T,
    thresholds: [T; N],
    weights: [T; N],
    len: usize,
    /// a = h/(h + λ)
    slide: T,
}

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<ViscousPi<T, N>> for ViscousPiParams<L> {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<ViscousPi<T, N>, Error> {
        let h = cx.checked()?;
        let lambda = within("rate-dependence.seconds", self.seconds, self.seconds >= 0.0, "zero or positive")?;
        let (thresholds, weights) = (self.pi.thresholds.as_ref(), self.pi.weights.as_ref());
        // The ordinary operator's checks are the ones that are needed.
        let checked: crate::Pi<T, N> = self.pi.build(&())?;
        let mut model = ViscousPi {
            gain: T::from_f64(self.pi.gain),
            thresholds: [T::ZERO; N],
            weights: [T::ZERO; N],
            len: checked.thresholds().len(),
            slide: T::from_f64(h / (h + lambda)),
        };
        let slots = model.thresholds.iter_mut().zip(&mut model.weights);
        for ((slot_r, slot_w), (r, w)) in slots.zip(thresholds.iter().zip(weights)) {
            (*slot_r, *slot_w) = (T::from_f64(*r), T::from_f64(*w));
        }
        Ok(model)
    }
}

/// History of the plays \[u\], and the last input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousPiState<T, const N: usize> {
    plays: [T; N],
    u: T,
}

impl<T: Real, const N: usize> ViscousPiState<T, N> {
    fn virgin() -> Self {
        Self { plays: [T::ZERO; N], u: T::ZERO }
    }
}

/// `x` beyond the band ± r.
#[inline]
fn dead<T: Real>(x: T, r: T) -> T {
    x - x.at_most(r).at_least(-r)
}

impl<T: Real, const N: usize> ViscousPi<T, N> {
    #[inline]
    fn advance(&self, s: &mut ViscousPiState<T, N>, u: T, slide: T) -> T {
        let u = if u.is_finite() { u } else { s.u };
        s.u = u;
        let mut y = self.gain * u;
        for ((p, r), w) in s.plays.iter_mut().zip(&self.thresholds).zip(&self.weights).take(self.len) {
            *p += slide * dead(u - *p, *r);
            y += *w * *p;
        }
        y
    }
}

impl<T: Real, const N: usize> Stage<T> for ViscousPi<T, N> {
    type State = ViscousPiState<T, N>;

    fn state(&self) -> Self::State {
        ViscousPiState::virgin()
    }

    /// Settled at `u0` after virgin memory: the plays have come to rest.
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        *s = ViscousPiState::virgin();
        self.advance(s, u0, T::ONE)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        self.advance(s, u, self.slide)
    }
}

/// The exact inverse of a viscous operator.
///
/// In one sample the output is a piecewise linear, rising function of the input: play i begins to slide at `pᵢ ± rᵢ`, and these
/// places stay in the order of the thresholds for ever. So the input is found by one pass over the plays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousPiInverse<T, const N: usize> {
    forward: ViscousPi<T, N>,
}

impl<T: Real, const N: usize> Invert<T> for ViscousPi<T, N> {
    type Inverse = ViscousPiInverse<T, N>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        // Both slopes: within a sample, and settled.
        for slide in [self.slide, T::ONE] {
            let mut slope = self.gain;
            let mut rises = slope > T::ZERO;
            for w in self.weights.iter().take(self.len) {
                slope += slide * *w;
                rises &= slope > T::ZERO;
            }
            if !rises {
                return Err(Error::NotInvertible("p0 plus the first weights must stay positive for a rising curve"));
            }
        }
        Ok(ViscousPiInverse { forward: *self })
    }
}

/// History of the inverse: that of the operator, and the last reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousPiInverseState<T, const N: usize> {
    forward: ViscousPiState<T, N>,
    reference: T,
}

impl<T: Real, const N: usize> ViscousPiInverse<T, N> {
    fn solve(&self, s: &mut ViscousPiState<T, N>, y: T, slide: T) -> T {
        let f = &self.forward;
        let plays = || s.plays.iter().zip(&f.thresholds).zip(&f.weights).take(f.len);
        // With the plays at rest; then each that slides adds its slope.
        let mut rest = y;
        for ((p, _), w) in plays() {
            rest -= *w * *p;
        }
        let mut slope = f.gain;
        let mut u = rest / slope;
        // The plays leave their bands in order, all on the side on which the first one does.
        let up = plays().next().is_some_and(|((p, _), _)| u > *p);
        for ((p, r), w) in plays() {
            let edge = if up { *p + *r } else { *p - *r };
            if if up { u <= edge } else { u >= edge } {
                break;
            }
            let share = slide * *w;
            slope += share;
            rest += share * edge;
            u = rest / slope;
        }
        f.advance(s, u, slide);
        u
    }
}

impl<T: Real, const N: usize> Stage<T> for ViscousPiInverse<T, N> {
    type State = ViscousPiInverseState<T, N>;

    fn state(&self) -> Self::State {
        ViscousPiInverseState { forward: ViscousPiState::virgin(), reference: T::ZERO }
    }

    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        s.forward = ViscousPiState::virgin();
        let y = rest(&mut s.reference, u0);
        self.solve(&mut s.forward, y, T::ONE)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let y = hold(&mut s.reference, u);
        self.solve(&mut s.forward, y, self.forward.slide)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PI: PiParams<[f64; 3]> = PiParams { gain: 0.1, thresholds: [5.0, 10.0, 20.0], weights: [0.02, 0.03, 0.01] };

    fn model(seconds: f64, period: f64) -> ViscousPi<f64, 3> {
        ViscousPiParams { pi: PI, seconds }.build(&Sampling { period }).unwrap()
    }

    #[test]
    fn without_drag_it_is_the_ordinary_operator() {
        let (viscous, plain) = (model(0.0, 1e-3), PI.build(&()).unwrap());
        let plain: &crate::Pi<f64, 3> = &plain;
        let (mut a, mut b, e) = (viscous.state(), plain.state(), Env::default());
        for k in 0..1000 {
            let u = 40.0 * libm::sin(0.21 * f64::from(k)) * libm::sin(0.013 * f64::from(k));
            assert!((viscous.step(&mut a, &e, u) - plain.step(&mut b, &e, u)).abs() < 1e-13);
        }
    }

    /// On a ramp of rate v every sliding play lags by r + λ v, at any sample period.
    #[test]
    fn a_ramp_lags_by_the_drag() {
        let (lambda, rate) = (0.02, 300.0);
        for h in [1e-4, 1e-2, 0.1] {
            let m = model(lambda, h);
            let (mut s, e) = (m.state(), Env::default());
            let mut u = 0.0;
            let mut y = 0.0;
            for k in 0..(2.0 / h) as u32 {
                u = rate * h * f64::from(k);
                y = m.step(&mut s, &e, u);
            }
            let expected =
                0.1 * u + PI.thresholds.iter().zip(PI.weights).map(|(r, w)| w * (u - r - lambda * rate)).sum::<f64>();
            assert!((y - expected).abs() < 1e-9, "{h}: {y} {expected}");
        }
    }

    #[test]
    fn loops_widen_with_frequency() {
        let width = |hz: f64| {
            let (m, h) = (model(2e-3, 1e-4), 1e-4);
            let (mut s, e) = (m.state(), Env::default());
            let mut area = 0.0;
            let samples = (1.0 / hz / h) as u32;
            let (mut y0, mut u0) = (0.0, 0.0);
            for k in 0..2 * samples {
                let u = 40.0 * libm::sin(2.0 * core::f64::consts::PI * hz * h * f64::from(k));
                let y = m.step(&mut s, &e, u);
                if k >= samples {
                    area += 0.5 * (y + y0) * (u - u0);
                }
                (y0, u0) = (y, u);
            }
            area.abs()
        };
        assert!(width(40.0) > 1.15 * width(1.0), "{} {}", width(40.0), width(1.0));
    }

    proptest! {
        #[test]
        fn inverse_reaches_every_reference(
            gain in 0.02..2.0f64,
            steps in prop::collection::vec((0.01..5.0f64, 0.0..1.0f64), 16),
            seconds in 0.0..0.05f64,
            references in prop::collection::vec(-30.0..30.0f64, 50..300),
        ) {
            let mut at = 0.0;
            let mut pi = PiParams { gain, thresholds: [0.0; 16], weights: [0.0; 16] };
            for ((r, w), (d, x)) in pi.thresholds.iter_mut().zip(&mut pi.weights).zip(&steps) {
                at += d;
                (*r, *w) = (at, *x);
            }
            let model: ViscousPi<f64, 16> = ViscousPiParams { pi, seconds }.build(&Sampling { period: 1e-3 }).unwrap();
            let inverse = model.invert().unwrap();
            let (mut a, mut b, e) = (model.state(), inverse.state(), Env::default());
            let first = inverse.reset(&mut b, &e, references[0]);
            prop_assert!((model.reset(&mut a, &e, first) - references[0]).abs() < 60.0 * 1e-12);
            for y in &references {
                let drive = inverse.step(&mut b, &e, *y);
                prop_assert!((model.step(&mut a, &e, drive) - y).abs() < 60.0 * 1e-12);
            }
        }
    }
}
