//! One branch of a Bouc-Wen memory: its motion as a function of the motion of the input.
//!
//! w is the memory in the direction of travel, σ the distance travelled, both in the same unit. Then every branch of
//! every Bouc-Wen operator is the same autonomous flow,
//!
//! ```text
//! dw/dσ = 1 − κ₊ wⁿ     for w ≥ 0,
//! dw/dσ = 1 + κ₋ |w|ⁿ   for w < 0,      0 ≤ κ₊, κ₋ ≤ 1.
//! ```
//!
//! It rises towards the attractor `w∞ = κ₊^(−1/n)` and crosses zero once. A reversal of the input changes the sign of
//! w.

use crate::Real;

/// Maximum of |∂F/∂w| times the length of a substep.
const SUBSTEP: f64 = 0.125;
/// Maximum number of substeps on either side of zero.
const SUBSTEPS: u32 = 64;
/// Number of space constants of the attractor, beyond the distance to it, after which it is reached to the last bit of
/// an `f64`.
const SETTLED: f64 = 40.0;

/// The flow with fixed κ₊, κ₋ and n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Branch<T> {
    law: Law<T>,
    /// κ₊: reduces the slope for w ≥ 0.
    kappa_plus: T,
    /// κ₋: increases the slope for w < 0.
    kappa_minus: T,
    /// w∞; infinite if κ₊ = 0.
    limit: T,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Law<T> {
    /// n = 1: exponentials.
    One,
    /// n = 2: hyperbolic tangent for w ≥ 0, tangent for w < 0.
    Two,
    /// Any other n: fourth-order Runge-Kutta.
    Power {
        n: T,
        /// Substep for w ≥ 0: [`SUBSTEP`] divided by the maximum of |∂F/∂w| there.
        step: T,
        /// Distance from zero after which the memory is at the attractor.
        settled: T,
    },
}

impl<T: Real> Branch<T> {
    /// Creates the flow for `kappa_plus` and `kappa_minus` in 0..=1, the larger of them 1 or both 0, and `n` ≥ 1.
    pub(super) fn new(kappa_plus: f64, kappa_minus: f64, n: f64) -> Self {
        let limit = if kappa_plus > 0.0 { libm::pow(kappa_plus, -1.0 / n) } else { f64::INFINITY };
        // |∂F/∂w| at the attractor; 0 if there is none.
        let steepest = n * libm::pow(kappa_plus, 1.0 / n);
        let law = if n == 1.0 {
            Law::One
        } else if n == 2.0 {
            Law::Two
        } else {
            Law::Power {
                n: T::from_f64(n),
                step: T::from_f64(SUBSTEP / steepest),
                settled: T::from_f64(limit + SETTLED / steepest),
            }
        };
        Self {
            law,
            kappa_plus: T::from_f64(kappa_plus),
            kappa_minus: T::from_f64(kappa_minus),
            limit: T::from_f64(limit),
        }
    }

    /// Returns w∞: a memory within ±w∞ stays there. Infinite if κ₊ = 0.
    pub(super) fn limit(&self) -> T {
        self.limit
    }

    /// Returns minimum and maximum of dw/dσ over the range ±w∞: at the attractor, and just after a reversal from it.
    /// Without an attractor 1 and infinity, or 1 and 1.
    pub(super) fn slopes(&self) -> (T, T) {
        if self.kappa_plus > T::ZERO {
            (T::ZERO, T::ONE + self.kappa_minus / self.kappa_plus)
        } else if self.kappa_minus > T::ZERO {
            (T::ONE, self.limit)
        } else {
            (T::ONE, T::ONE)
        }
    }

    /// Returns the |w| at which dw/dσ is 1 + `excess` for w < 0.
    pub(super) fn memory_at_excess(&self, excess: T) -> T {
        let power = excess / self.kappa_minus;
        match self.law {
            Law::One => power,
            Law::Two => power.sqrt(),
            Law::Power { n, .. } => power.powf(T::ONE / n),
        }
    }

    /// Returns the memory after the distance `sigma ≥ 0` from `w`. It is continuous and rising in `sigma`, and between
    /// `w` and w∞.
    pub(super) fn advance(&self, w: T, sigma: T) -> T {
        let moved = match self.law {
            Law::One => {
                let back = self.exponential_to_zero(w);
                if w >= T::ZERO {
                    relax(self.kappa_plus, w, sigma)
                } else if sigma < back {
                    relax(self.kappa_minus, w, sigma).at_most(T::ZERO)
                } else {
                    relax(self.kappa_plus, T::ZERO, sigma - back)
                }
            }
            Law::Two => {
                let back = self.tangent_to_zero(w);
                if w >= T::ZERO {
                    let t = scaled(self.kappa_plus, sigma, T::tanh);
                    (w + t) / (T::ONE + self.kappa_plus * w * t)
                } else if sigma < back {
                    let t = scaled(self.kappa_minus, sigma, T::tan);
                    ((w + t) / (T::ONE - self.kappa_minus * w * t)).at_most(T::ZERO)
                } else {
                    scaled(self.kappa_plus, sigma - back, T::tanh)
                }
            }
            Law::Power { n, step, settled } => {
                if sigma >= settled + (-w).at_least(T::ZERO) {
                    self.limit
                } else {
                    let (w, remaining) = if w < T::ZERO { self.towards_zero(n, w, sigma) } else { (w, sigma) };
                    self.towards_attractor(n, step, w, remaining)
                }
            }
        };
        moved.at_most(self.limit).at_least(w)
    }

    /// Returns the distance to zero from `w` < 0, for n = 1.
    fn exponential_to_zero(&self, w: T) -> T {
        let x = self.kappa_minus * -w;
        if x > T::EPSILON { x.ln_1p() / self.kappa_minus } else { -w }
    }

    /// Returns the distance to zero from `w` < 0, for n = 2.
    fn tangent_to_zero(&self, w: T) -> T {
        let root = self.kappa_minus.sqrt();
        let x = root * -w;
        if x > T::EPSILON { x.atan() / root } else { -w }
    }

    /// Moves from `w` < 0 to zero at most. Returns the memory and the remaining distance.
    ///
    /// The length of a substep depends only on w, and the last substep is the remaining distance. So the result is
    /// continuous in the distance, and a search for an input finds no steps.
    fn towards_zero(&self, n: T, w: T, sigma: T) -> (T, T) {
        let quarter = T::from_f64(0.25);
        let force = |w: T| T::ONE + self.kappa_minus * (-w).at_least(T::ZERO).powf(n);
        let (mut w, mut remaining) = (w, sigma);
        // ∫|∂F/∂w| dσ to zero is ln F. If it is large, the substeps must be longer, so their number is sufficient.
        let far = T::from_f64(1.4) * force(w).ln() / (T::from_f64(f64::from(SUBSTEPS)) - n - n);
        let substep = T::from_f64(SUBSTEP).at_least(far);
        for _ in 0..SUBSTEPS {
            let power = (-w).powf(n - T::ONE);
            let first = T::ONE + self.kappa_minus * power * -w;
            let longest = substep / (n * (self.kappa_minus * power).at_least(quarter));
            // |w|ⁿ has no higher derivatives at zero: use shorter substeps near it.
            let h = longest.at_most((-w * (quarter + quarter)).at_least(longest * quarter)).at_most(remaining);
            if w + h * first <= T::ZERO {
                w = runge_kutta(force, w, first, h).at_most(T::ZERO);
            } else {
                let zero = crossing(force, w, first);
                if zero <= h {
                    return (T::ZERO, remaining - zero);
                }
                w = runge_kutta(force, w, first, h).at_most(T::ZERO);
            }
            remaining -= h;
            if remaining <= T::ZERO || w >= T::ZERO {
                return (w, remaining);
            }
        }
        // Reached only outside the range for which the error is stated.
        let zero = crossing(force, w, force(w));
        if zero <= remaining {
            (T::ZERO, remaining - zero)
        } else {
            (runge_kutta(force, w, force(w), remaining), T::ZERO)
        }
    }

    /// Moves from `w` ≥ 0 towards the attractor and returns the memory.
    fn towards_attractor(&self, n: T, step: T, w: T, sigma: T) -> T {
        if self.kappa_plus <= T::ZERO {
            return w + sigma;
        }
        let force = |w: T| T::ONE - self.kappa_plus * w.at_least(T::ZERO).powf(n);
        let shortest = step * T::from_f64(0.25);
        let (mut w, mut remaining) = (w, sigma);
        for substeps in (1..=SUBSTEPS).rev() {
            let h = step.at_most(w.at_least(shortest));
            // An equal share of the remaining distance, if that is longer: then most of it is along the attractor.
            let h = h.at_least(remaining / T::from_f64(f64::from(substeps))).at_most(remaining);
            w = runge_kutta(force, w, force(w), h).at_most(self.limit);
            remaining -= h;
            if remaining <= T::ZERO {
                break;
            }
        }
        w
    }
}

/// Solves `dw/dσ = 1 − κ w` over `sigma`.
fn relax<T: Real>(kappa: T, w: T, sigma: T) -> T {
    let x = kappa * sigma;
    // (1 − e^(−κσ))/κ, also if κσ is below the rounding.
    let gain = if x > T::EPSILON { -(-x).exp_m1() / kappa } else { sigma };
    w + (T::ONE - kappa * w) * gain
}

/// Computes `f(√κ σ)/√κ` for a function with f(x) ≈ x near zero.
fn scaled<T: Real>(kappa: T, sigma: T, f: impl Fn(T) -> T) -> T {
    let root = kappa.sqrt();
    let x = root * sigma;
    if x > T::EPSILON { f(x) / root } else { sigma }
}

/// Computes one classical Runge-Kutta step of `dw/dσ = f(w)`; `first` = f(w).
fn runge_kutta<T: Real>(f: impl Fn(T) -> T, w: T, first: T, h: T) -> T {
    let half = h * T::from_f64(0.5);
    let second = f(w + half * first);
    let third = f(w + half * second);
    let fourth = f(w + h * third);
    w + h * T::from_f64(1.0 / 6.0) * (first + (second + second) + (third + third) + fourth)
}

/// Returns the length of the Runge-Kutta step that ends at zero. It is the root of this step, not of the exact flow, so
/// the branch has no jump there.
fn crossing<T: Real>(f: impl Fn(T) -> T, w: T, first: T) -> T {
    // The slope is `first` here and 1 at zero, so the length is between these two.
    let (least, most) = (-w / first, -w);
    let mut h = -(w + w) / (T::ONE + first);
    for _ in 0..8 {
        let end = runge_kutta(&f, w, first, h);
        h = (h - end).at_least(least).at_most(most);
        if end.abs() <= T::EPSILON * -w {
            break;
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Pairs (κ₊, κ₋): the larger one is 1.
    const SHAPES: [(f64, f64); 6] = [(1.0, 1.0), (1.0, 0.0), (1.0, 0.01), (0.3, 1.0), (0.01, 1.0), (0.0, 1.0)];

    /// Integrates the same flow with 100 Runge-Kutta steps per unit of |∂F/∂w|, separately on each side of zero.
    fn reference(kappa_plus: f64, kappa_minus: f64, n: f64, mut w: f64, sigma: f64) -> f64 {
        let back = |w: f64| 1.0 + kappa_minus * libm::pow((-w).max(0.0), n);
        let out = |w: f64| 1.0 - kappa_plus * libm::pow(w.max(0.0), n);
        let mut remaining = sigma;
        while w < 0.0 && remaining > 0.0 {
            let steep = n * kappa_minus * libm::pow(-w, n - 1.0);
            // Shorter steps near zero, for |w|ⁿ with n between 1 and 2.
            let h = (0.01 / steep.max(0.25)).min(remaining).min((-w * 0.05).max(1e-6));
            if w + h * back(w) > 0.0 && crossing(back, w, back(w)) <= h {
                (w, remaining) = (0.0, remaining - crossing(back, w, back(w)));
            } else {
                w = runge_kutta(back, w, back(w), h);
                remaining -= h;
            }
        }
        while remaining > 0.0 {
            let h = (0.01 / n).min((w * 0.05).max(1e-6)).min(remaining);
            w = runge_kutta(out, w, out(w), h);
            remaining -= h;
        }
        w
    }

    fn worst(shapes: &[(f64, f64)], n: f64) -> f64 {
        let mut worst = 0.0f64;
        for &(kappa_plus, kappa_minus) in shapes {
            let branch = Branch::<f64>::new(kappa_plus, kappa_minus, n);
            let unit = if kappa_plus > 0.0 { branch.limit() } else { 2.0 };
            for w in [-1.0, -0.7, -0.3, -0.05, 0.0, 0.3, 0.9] {
                for sigma in [1e-4, 0.02, 0.1, 0.3, 0.7, 1.0, 1.5, 2.5] {
                    let expected = reference(kappa_plus, kappa_minus, n, w * unit, sigma * unit);
                    worst = worst.max((branch.advance(w * unit, sigma * unit) - expected).abs() / unit);
                }
            }
        }
        worst
    }

    #[test]
    fn exact_laws_agree_with_a_fine_integration() {
        for n in [1.0, 2.0] {
            let worst = worst(&SHAPES, n);
            assert!(worst < 1e-10, "n = {n}: {worst:e}");
        }
    }

    #[test]
    fn error_of_the_substeps_is_as_stated() {
        for n in [1.01, 1.1, 1.3, 1.5, 1.8, 2.2, 3.0, 5.0, 10.0] {
            let worst = worst(&SHAPES, n);
            assert!(worst < 1e-5, "n = {n}: {worst:e}");
        }
    }

    #[test]
    fn error_grows_slowly_outside_the_stated_range() {
        for n in [4.0, 20.0] {
            let worst = worst(&[(1e-6, 1.0), (1e-4, 1.0), (1.0, 1.0)], n);
            assert!(worst < 1e-3, "n = {n}: {worst:e}");
        }
    }

    #[test]
    fn short_moves_have_a_smaller_error() {
        for n in [1.5, 3.0, 5.0] {
            let branch = Branch::<f64>::new(1.0, 0.6, n);
            for k in 0..50 {
                let w = -1.0 + 0.04 * f64::from(k);
                let error = (branch.advance(w, 0.01) - reference(1.0, 0.6, n, w, 0.01)).abs();
                assert!(error < 1e-7, "n = {n}, w = {w}: {error:e}");
            }
        }
    }

    #[test]
    fn a_long_move_ends_at_the_attractor() {
        for (kappa_plus, kappa_minus) in SHAPES.into_iter().filter(|s| s.0 > 0.0) {
            for n in [1.0, 1.5, 2.0, 4.0, 20.0] {
                let branch = Branch::<f64>::new(kappa_plus, kappa_minus, n);
                for w in [-0.9, 0.1] {
                    let from = w * branch.limit();
                    for sigma in [50.0, 1e6, 1e300] {
                        let reached = branch.advance(from, sigma * branch.limit());
                        assert!(
                            (reached / branch.limit() - 1.0).abs() < 1e-12,
                            "{kappa_plus} {kappa_minus} {n}: {reached}"
                        );
                    }
                }
            }
        }
    }

    proptest! {
        /// For every law and ratio the branch is continuous, rising and within its bounds, as the search requires.
        #[test]
        fn branch_rises_continuously(
            n in prop_oneof![Just(1.0), Just(2.0), 1.0..20.0f64],
            exponent in -6.0..6.0f64, start in -1.0..1.0f64, reach in -4.0..1.0f64,
        ) {
            let ratio = libm::pow(10.0, exponent);
            let branch = Branch::<f64>::new(1.0f64.min(1.0 / ratio), 1.0f64.min(ratio), n);
            let (w, far) = (start * branch.limit(), libm::pow(10.0, reach) * branch.limit());
            // The slope has its maximum at the start.
            let steepest = if w < 0.0 { 1.0 + branch.kappa_minus * libm::pow(-w, n) } else { 1.0 };
            let points: Vec<f64> = (0..=4000).map(|k| branch.advance(w, far * f64::from(k) / 4000.0)).collect();
            prop_assert!(points[0] == w && points[4000] <= branch.limit());
            for pair in points.windows(2) {
                let rise = pair[1] - pair[0];
                prop_assert!(rise >= -1e-14 * branch.limit());
                prop_assert!(rise <= 1.05 * steepest * far / 4000.0 + 1e-14 * branch.limit(), "{rise} {steepest}");
            }
        }

        /// One move and two consecutive moves give the same memory, to the stated error.
        #[test]
        fn two_moves_equal_one_move(n in 1.0..10.0f64, start in -1.0..1.0f64, a in 0.0..2.0f64, b in 0.0..2.0f64) {
            let branch = Branch::<f64>::new(1.0, 0.5, n);
            let parts = branch.advance(branch.advance(start, a), b);
            prop_assert!((parts - branch.advance(start, a + b)).abs() < 1e-5);
        }
    }
}
