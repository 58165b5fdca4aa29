//! Rate dependence in a Prandtl-Ishlinskii operator: plays that slide with drag, and their exact inverse.
//!
//! Loops of piezoceramics widen with frequency. There are two forms. In the first, the thresholds grow with the rate of
//! the input, `r(u̇) = r + λ|u̇|` (Al Janaideh and Krejčí 2013). The play then follows `u − λ u̇`, which has a zero in
//! the right half plane and no causal inverse. This module uses the second form: the play has drag. Its speed v follows
//! from its overdrive `o = |u − p| − r`:
//!
//! ```text
//! o = λ v + √(J v).
//! ```
//!
//! λ alone widens the loop in proportion to the rate, as the first form does. J alone widens it with the square root of
//! the rate, as viscous domain walls do (Bertotti's dynamic Preisach model): a wall that switches at `o/J` per second
//! is half switched when a ramp of rate v is `√(J v)` beyond its threshold. Each lag acts only while the play slides,
//! and the output is monotone in the present input. Therefore the operator has an exact inverse.

mod drag;
mod inverse;
#[cfg(test)]
mod tests;

use crate::{Build, Env, Error, Meta, Params, PiParams, Real, Sampling, Stage};
use drag::Drag;
pub use inverse::{ViscousPiInverse, ViscousPiInverseState};

/// Parameters of `y = p₀ u + Σᵢ wᵢ pᵢ`. Play i rests for `|u − pᵢ| ≤ rᵢ`. Beyond that it slides towards u at the speed
/// v with `λ v + √(J v) = |u − pᵢ| − rᵢ`. λ = J = 0 is the rate-independent operator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ViscousPiParams<L> {
    /// Gain, thresholds and weights.
    pub pi: PiParams<L>,
    /// Drag λ \[s\], zero or positive: the loop widens by λ times the rate.
    pub seconds: f64,
    /// Drag J \[u s\], zero or positive: the loop widens by the square root of J times the rate. Zero if a file has
    /// none.
    #[cfg_attr(feature = "serde", serde(default))]
    pub volt_seconds: f64,
}

impl<L: AsMut<[f64]>> Params for ViscousPiParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        self.pi.visit_as(["pi.gain", "pi.thresholds", "pi.weights"], f);
        f(&Meta { name: "seconds", unit: "s", lower: 0.0, upper: 1.0 }, &mut self.seconds);
        f(&Meta { name: "volt_seconds", unit: "u s", lower: 0.0, upper: f64::INFINITY }, &mut self.volt_seconds);
    }
}

/// Prandtl-Ishlinskii operator with viscous plays, at one sample period, with at most `N` plays.
///
/// A sample of h seconds moves a sliding play by `h v` with `(λ + h) v + √(J v) = |u − p| − r` (backward Euler). At any
/// sample period it is stable, and on a ramp it has exactly the lag of the law. At λ = J = 0 it is the ordinary play.
///
/// ```
/// use hyst_core::{Build, Env, Invert, PiParams, Sampling, Stage, ViscousPi, ViscousPiParams};
/// let pi = PiParams { gain: 0.1, thresholds: [10.0, 20.0], weights: [0.02, 0.01] };
/// let params = ViscousPiParams { pi, seconds: 0.0, volt_seconds: 0.002 };
/// let model: ViscousPi<f64, 2> = params.build(&Sampling { period: 1e-3 })?;
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
    drag: Drag<T>,
}

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<ViscousPi<T, N>> for ViscousPiParams<L> {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<ViscousPi<T, N>, Error> {
        let drag = Drag::new(self.seconds, self.volt_seconds, cx.checked()?)?;
        let (thresholds, weights) = (self.pi.thresholds.as_ref(), self.pi.weights.as_ref());
        // The checks of the ordinary operator are sufficient.
        let checked: crate::Pi<T, N> = self.pi.build(&())?;
        let mut model = ViscousPi {
            gain: T::from_f64(self.pi.gain),
            thresholds: [T::ZERO; N],
            weights: [T::ZERO; N],
            len: checked.thresholds().len(),
            drag,
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

/// Returns the part of `x` beyond the dead zone ± r.
#[inline]
fn dead_zone<T: Real>(x: T, r: T) -> T {
    x - x.at_most(r).at_least(-r)
}

impl<T: Real, const N: usize> ViscousPi<T, N> {
    #[inline(always)]
    fn advance(&self, s: &mut ViscousPiState<T, N>, u: T, drag: &Drag<T>) -> T {
        if drag.is_linear() {
            self.pushed(s, u, |beyond| drag.linear(beyond))
        } else {
            self.pushed(s, u, |beyond| drag.rooted(beyond).0)
        }
    }

    /// Moves the plays at input `u` and returns the output. `moves` maps the input beyond a threshold to the motion of
    /// the play.
    // Inlined, so the output is not computed where it is not used.
    #[inline(always)]
    fn pushed(&self, s: &mut ViscousPiState<T, N>, u: T, moves: impl Fn(T) -> T) -> T {
        let u = if u.is_finite() { u } else { s.u };
        s.u = u;
        let mut y = self.gain * u;
        for ((p, r), w) in s.plays.iter_mut().zip(&self.thresholds).zip(&self.weights).take(self.len) {
            *p += moves(dead_zone(u - *p, *r));
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

    /// Sets the plays to rest at `u0` after virgin memory.
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        *s = ViscousPiState::virgin();
        self.advance(s, u0, &Drag::none())
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        self.advance(s, u, &self.drag)
    }
}
