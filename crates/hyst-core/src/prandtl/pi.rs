//! The Prandtl-Ishlinskii operator and its closed-form inverse.
//!
//! `y = p₀ u + Σᵢ wᵢ play_{rᵢ}(u)` (Brokate and Sprekels 1996; Kuhnen 2003). The inverse is an operator of the same
//! type.

use crate::error::{coefficient, within};
use crate::{Build, Env, Error, Invert, Meta, Params, Real, Stage};

/// Parameters of `y = p₀ u + Σᵢ wᵢ play_{rᵢ}(u)`. `L` is any list of numbers: a vector, an array, a slice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PiParams<L> {
    /// Gain p₀ of the identity \[y/u\].
    pub gain: f64,
    /// Half-widths rᵢ of the plays \[u\], positive and strictly rising.
    pub thresholds: L,
    /// Weights wᵢ of the plays \[y/u\].
    pub weights: L,
}

impl<L: AsMut<[f64]>> Params for PiParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        self.visit_as(["gain", "thresholds", "weights"], f);
    }
}

impl<L: AsMut<[f64]>> PiParams<L> {
    /// Visits the parameters with their paths in a larger model.
    pub(super) fn visit_as(
        &mut self,
        [gain, thresholds, weights]: [&'static str; 3],
        f: &mut dyn FnMut(&Meta, &mut f64),
    ) {
        f(&Meta { name: gain, unit: "y/u", lower: 0.0, upper: f64::INFINITY }, &mut self.gain);
        for r in self.thresholds.as_mut() {
            f(&Meta { name: thresholds, unit: "u", lower: 0.0, upper: f64::INFINITY }, r);
        }
        for w in self.weights.as_mut() {
            f(&Meta { name: weights, unit: "y/u", lower: 0.0, upper: f64::INFINITY }, w);
        }
    }
}

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<Pi<T, N>> for PiParams<L> {
    type Context = ();
    fn build(&self, (): &()) -> Result<Pi<T, N>, Error> {
        Pi::new(self.gain, self.thresholds.as_ref(), self.weights.as_ref())
    }
}

/// Prandtl-Ishlinskii operator with at most `N` plays: `y = p₀ u + Σᵢ wᵢ play_{rᵢ}(u)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pi<T, const N: usize> {
    gain: T,
    thresholds: [T; N],
    weights: [T; N],
    len: usize,
}

impl<T: Real, const N: usize> Pi<T, N> {
    /// Creates the operator from the gain p₀ of the identity \[y/u\], thresholds rᵢ \[u\] and weights wᵢ \[y/u\].
    ///
    /// # Errors
    /// If a number is not finite, the lists differ in length or are longer than `N`, or the thresholds are not positive
    /// and strictly rising.
    pub fn new(gain: f64, thresholds: &[f64], weights: &[f64]) -> Result<Self, Error> {
        let gain = coefficient("pi.gain", gain)?;
        if thresholds.len() != weights.len() {
            return Err(Error::Lengths("pi.thresholds and pi.weights"));
        }
        if thresholds.len() > N {
            return Err(Error::Capacity { name: "pi plays", needed: thresholds.len(), holds: N });
        }
        let mut pi = Self { gain, thresholds: [T::ZERO; N], weights: [T::ZERO; N], len: thresholds.len() };
        let mut last = 0.0;
        let slots = pi.thresholds.iter_mut().zip(&mut pi.weights);
        for ((slot_r, slot_w), (r, w)) in slots.zip(thresholds.iter().zip(weights)) {
            within("pi.thresholds", *r, *r > last, "positive and strictly rising")?;
            *slot_r = coefficient("pi.thresholds", *r)?;
            *slot_w = coefficient("pi.weights", *w)?;
            last = *r;
        }
        Ok(pi)
    }

    /// Creates the operator from stops (elasto-slip elements): `y = p₀ u + Σᵢ kᵢ stop_{rᵢ}(u)`. The sum of play and
    /// stop is the input, so the gain is `p₀ + Σ kᵢ` and the weights are `−kᵢ`.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn from_stops(gain: f64, yields: &[f64], stiffnesses: &[f64]) -> Result<Self, Error> {
        let total = stiffnesses.iter().fold(0.0, |sum, k| sum + k);
        let mut pi = Self::new(gain + total, yields, stiffnesses)?;
        for w in &mut pi.weights {
            *w = -*w;
        }
        Ok(pi)
    }

    /// Returns the half-widths of the plays \[u\].
    pub fn thresholds(&self) -> &[T] {
        self.thresholds.get(..self.len).unwrap_or_default()
    }

    /// Returns the gain p₀ of the identity \[y/u\].
    pub fn gain(&self) -> T {
        self.gain
    }

    #[inline]
    fn advance(&self, s: &mut PiState<T, N>, u: T) -> T {
        let u = if u.is_finite() { u } else { s.u };
        s.u = u;
        self.between(&mut s.plays, u, u, u)
    }

    /// Returns the output of plays that are pushed by `left` and pulled by `right`, and of the play of radius 0 with
    /// the value `g`.
    // A function call per sample would cost as much as some plays.
    #[inline(always)]
    pub(super) fn between(&self, plays: &mut [T; N], left: T, right: T, g: T) -> T {
        let mut y = self.gain * g;
        let plays = plays.iter_mut().zip(&self.thresholds).zip(&self.weights);
        let mut add = |((p, r), w): ((&mut T, &T), &T)| {
            *p = p.at_most(right + *r).at_least(left - *r);
            y += *w * *p;
        };
        // If every slot is used, the number of iterations is a constant and the compiler unrolls the loop.
        if self.len == N {
            plays.for_each(&mut add);
        } else {
            plays.take(self.len).for_each(&mut add);
        }
        y
    }
}

/// History of the operator: the output of each play \[u\], and the last input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PiState<T, const N: usize> {
    plays: [T; N],
    u: T,
}

impl<T: Real, const N: usize> PiState<T, N> {
    /// Returns virgin memory: every play at 0.
    pub fn virgin() -> Self {
        Self { plays: [T::ZERO; N], u: T::ZERO }
    }
}

impl<T: Real, const N: usize> Stage<T> for Pi<T, N> {
    type State = PiState<T, N>;

    fn state(&self) -> Self::State {
        PiState::virgin()
    }

    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        *s = PiState::virgin();
        self.advance(s, u0)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        self.advance(s, u)
    }
}

impl<T: Real, const N: usize> Invert<T> for Pi<T, N> {
    type Inverse = Self;

    /// `Sⱼ = p₀ + Σ_{i≤j} wᵢ` are the slopes of the initial curve beyond threshold j. The inverse has the gain 1/p₀,
    /// the thresholds `r'ⱼ = p₀ rⱼ + Σ_{i<j} wᵢ (rⱼ − rᵢ)` and the weights `w'ⱼ = 1/Sⱼ − 1/Sⱼ₋₁` (Kuhnen 2003). It
    /// exists if every slope is positive.
    fn invert(&self) -> Result<Self, Error> {
        const WHY: &str = "p0 plus the first weights must stay positive for a rising initial curve";
        let gain = self.gain.to_f64();
        if gain.is_nan() || gain <= 0.0 {
            return Err(Error::NotInvertible(WHY));
        }
        let mut inverse = Self { gain: T::from_f64(1.0 / gain), ..*self };
        // In f64 for any T: thresholds of the inverse are sums of many products.
        let (mut slope, mut height, mut last) = (gain, 0.0, 0.0);
        let slots = inverse.thresholds.iter_mut().zip(&mut inverse.weights);
        for ((slot_r, slot_w), (r, w)) in slots.zip(self.thresholds.iter().zip(&self.weights)).take(self.len) {
            height += slope * (r.to_f64() - last);
            last = r.to_f64();
            let next = slope + w.to_f64();
            // A slope at the level of rounding counts as zero.
            if next.is_nan() || next <= 8.0 * T::EPSILON.to_f64() * gain {
                return Err(Error::NotInvertible(WHY));
            }
            *slot_r = T::from_f64(height);
            // 1/next − 1/slope without cancellation.
            *slot_w = T::from_f64(-w.to_f64() / (next * slope));
            slope = next;
        }
        Ok(inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    proptest! {
        #[test]
        fn inverse_after_and_before_is_the_identity(
            gain in 0.02..2.0f64,
            steps in prop::collection::vec((0.01..5.0f64, 0.0..1.0f64), 1..16),
            u in prop::collection::vec(-20.0..20.0f64, 50..200),
        ) {
            let mut at = 0.0;
            let thresholds: Vec<f64> = steps.iter().map(|(d, _)| { at += d; at }).collect();
            let weights: Vec<f64> = steps.iter().map(|(_, w)| *w).collect();
            let pi = Pi::<f64, 16>::new(gain, &thresholds, &weights).unwrap();
            let inverse = pi.invert().unwrap();
            let e = Env::default();
            let (mut a, mut b) = (pi.state(), inverse.state());
            let (mut c, mut d) = (pi.state(), inverse.state());
            let span = 20.0 * (gain + weights.iter().sum::<f64>());
            for x in &u {
                // M⁻¹ ∘ M
                let y = pi.step(&mut a, &e, *x);
                prop_assert!((inverse.step(&mut b, &e, y) - x).abs() <= 1e-12 * 20.0 * (span / gain / 20.0));
                // M ∘ M⁻¹, for references that ±20 V reaches
                let reference = x * gain;
                let v = inverse.step(&mut d, &e, reference);
                prop_assert!((pi.step(&mut c, &e, v) - reference).abs() <= 1e-12 * span);
            }
        }
    }

    #[test]
    fn a_falling_branch_has_no_inverse() {
        let pi = Pi::<f64, 2>::new(0.1, &[1.0, 2.0], &[-0.2, 0.5]).unwrap();
        assert!(matches!(pi.invert(), Err(Error::NotInvertible(_))));
        assert!(Pi::<f64, 2>::new(0.0, &[1.0], &[1.0]).unwrap().invert().is_err());
    }

    #[test]
    fn unordered_thresholds_are_rejected() {
        assert!(Pi::<f64, 2>::new(0.1, &[2.0, 1.0], &[0.1, 0.1]).is_err());
        assert!(Pi::<f64, 1>::new(0.1, &[1.0, 2.0], &[0.1, 0.1]).is_err());
    }
}
