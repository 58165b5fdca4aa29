//! One branch of a Bouc-Wen memory: how far it moves while the input does.
//!
//! With w the memory in the direction of travel and σ the distance travelled, both scaled to one unit, every branch of
//! every Bouc-Wen operator is the same autonomous flow,
//!
//! ```text
//! dw/dσ = 1 − κ₊ wⁿ     for w ≥ 0,
//! dw/dσ = 1 + κ₋ |w|ⁿ   for w < 0,      0 ≤ κ₊, κ₋ ≤ 1.
//! ```
//!
//! It rises towards the attractor `w∞ = κ₊^(−1/n)` and passes zero once. A turn of the input changes the sign of w.

use crate::Real;

/// Longest substep, as |∂F/∂w| times its length.
const SUBSTEP: f64 = 0.125;
/// Most substeps to either side of zero.
const SUBSTEPS: u32 = 64;
/// The attractor is reached to the last bit of an `f64` this many of its space constants beyond it.
const SETTLED: f64 = 40.0;

/// The flow with fixed κ₊, κ₋ and n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Branch<T> {
    law: Law<T>,
    /// κ₊: what slows the memory down on its way out.
    ahead: T,
    /// κ₋: what speeds it up on its way back to zero.
    behind: T,
    /// w∞; infinite if κ₊ = 0.
    limit: T,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Law<T> {
    /// n = 1: exponentials.
    One,
    /// n = 2: hyperbolic tangent ahead of zero, tangent behind it.
    Two,
    /// Any other n: fourth-order Runge-Kutta.
    Power {
        n: T,
        /// Substep ahead of zero: [`SUBSTEP`] over the steepest |∂F/∂w| there.
        step: T,
        /// Distance from zero after which only the attractor is left.
        settled: T,
    },
}

impl<T: Real> Branch<T> {
    /// The flow for `ahead` and `behind` in 0..=1, the larger of them 1 or both 0, and `n` ≥ 1.
    pub(super) fn new(ahead: f64, behind: f64, n: f64) -> Self {
        let limit = if ahead > 0.0 { libm::pow(ahead, -1.0 / n) } else { f64::INFINITY };
        // |∂F/∂w| at the attractor; 0 if there is none.
        let steepest = n * libm::pow(ahead, 1.0 / n);
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
        Self { law, ahead: T::from_f64(ahead), behind: T::from_f64(behind), limit: T::from_f64(limit) }
    }

    /// w∞: the memory never leaves ±w∞ once it is inside. Infinite if κ₊ = 0.
    pub(super) fn limit(&self) -> T {
        self.limit
    }

    /// Least and greatest dw/dσ over the memory's range ±w∞: at the attractor and just after a turn from it. Without an
    /// attractor 1 and infinity, or 1 and 1.
    pub(super) fn forces(&self) -> (T, T) {
        if self.ahead > T::ZERO {
            (T::ZERO, T::ONE + self.behind / self.ahead)
        } else if self.behind > T::ZERO {
            (T::ONE, self.limit)
        } else {
            (T::ONE, T::ONE)
        }
    }

    /// |w| on the way back to zero at which dw/dσ is 1 + `room`.
    pub(super) fn where_behind(&self, room: T) -> T {
        let power = room / self.behind;
        match self.law {
            Law::One => power,
            Law::Two => power.sqrt(),
            Law::Power { n, .. } => power.powf(T::ONE / n),
        }
    }

    /// Memory after the distance `sigma ≥ 0` from `w`. Continuous and rising in `sigma`, never outside `w`..w∞.
    pub(super) fn advance(&self, w: T, sigma: T) -> T {
        let moved = match self.law {
            Law::One => {
                let back = self.exponential_to_zero(w);
                if w >= T::ZERO {
                    relax(self.ahead, w, sigma)
                } else if sigma < back {
                    relax(self.behind, w, sigma).at_most(T::ZERO)
                } else {
                    relax(self.ahead, T::ZERO, sigma - back)
                }
            }
            Law::Two => {
                let back = self.tangent_to_zero(w);
                if w >= T::ZERO {
                    let t = scaled(self.ahead, sigma, T::tanh);
                    (w + t) / (T::ONE + self.ahead * w * t)
                } else if sigma < back {
                    let t = scaled(self.behind, sigma, T::tan);
                    ((w + t) / (T::ONE - self.behind * w * t)).at_most(T::ZERO)
                } else {
                    scaled(self.ahead, sigma - back, T::tanh)
                }
            }
            Law::Power { n, step, settled } => {
                if sigma >= settled + (-w).at_least(T::ZERO) {
                    self.limit
                } else {
                    let (w, left) = if w < T::ZERO { self.come_back(n, w, sigma) } else { (w, sigma) };
                    self.go_out(n, step, w, left)
                }
            }
        };
        moved.at_most(self.limit).at_least(w)
    }

    /// n = 1: distance to zero from `w` < 0.
    fn exponential_to_zero(&self, w: T) -> T {
        let x = self.behind * -w;
        if x > T::EPSILON { x.ln_1p() / self.behind } else { -w }
    }

    /// n = 2: distance to zero from `w` < 0.
    fn tangent_to_zero(&self, w: T) -> T {
        let root = self.behind.sqrt();
        let x = root * -w;
        if x > T::EPSILON { x.atan() / root } else { -w }
    }

    /// From `w` < 0 towards zero and not beyond: the memory, and what is left of the distance.
    ///
    /// Substeps depend on w alone and the last is the remainder, so the result is continuous in the distance: a search for an
    /// input meets no steps.
    fn come_back(&self, n: T, w: T, sigma: T) -> (T, T) {
        let quarter = T::from_f64(0.25);
        let force = |w: T| T::ONE + self.behind * (-w).at_least(T::ZERO).powf(n);
        let (mut w, mut left) = (w, sigma);
        // ∫|∂F/∂w| dσ to zero is ln F: far out, fewer and longer substeps must do.
        let far = T::from_f64(1.4) * force(w).ln() / (T::from_f64(f64::from(SUBSTEPS)) - n - n);
        let substep = T::from_f64(SUBSTEP).at_least(far);
        for _ in 0..SUBSTEPS {
            let power = (-w).powf(n - T::ONE);
            let first = T::ONE + self.behind * power * -w;
            let longest = substep / (n * (self.behind * power).at_least(quarter));
            // |w|ⁿ has no higher derivatives at zero: shorter substeps on the way there.
            let h = longest.at_most((-w * (quarter + quarter)).at_least(longest * quarter)).at_most(left);
            if w + h * first <= T::ZERO {
                w = runge_kutta(force, w, first, h).at_most(T::ZERO);
            } else {
                let zero = crossing(force, w, first);
                if zero <= h {
                    return (T::ZERO, left - zero);
                }
                w = runge_kutta(force, w, first, h).at_most(T::ZERO);
            }
            left -= h;
            if left <= T::ZERO || w >= T::ZERO {
                return (w, left);
            }
        }
        // Only beyond the range that the error is stated for.
        let zero = crossing(force, w, force(w));
        if zero <= left { (T::ZERO, left - zero) } else { (runge_kutta(force, w, force(w), left), T::ZERO) }
    }

    /// From `w` ≥ 0 towards the attractor.
    fn go_out(&self, n: T, step: T, w: T, sigma: T) -> T {
        if self.ahead <= T::ZERO {
            return w + sigma;
        }
        let force = |w: T| T::ONE - self.ahead * w.at_least(T::ZERO).powf(n);
        let shortest = step * T::from_f64(0.25);
        let (mut w, mut left) = (w, sigma);
        for remaining in (1..=SUBSTEPS).rev() {
            let h = step.at_most(w.at_least(shortest));
            // An equal share of the rest, if that is longer: then most of the way is along the attractor.
            let h = h.at_least(left / T::from_f64(f64::from(remaining))).at_most(left);
            w = runge_kutta(force, w, force(w), h).at_most(self.limit);
            left -= h;
            if left <= T::ZERO {
                break;
            }
        }
        w
    }
}

/// `dw/dσ = 1 − κ w` over `sigma`.
fn relax<T: Real>(kappa: T, w: T, sigma: T) -> T {
    let x = kappa * sigma;
    // (1 − e^(−κσ))/κ; for small κσ also where κ itself has lost its bits.
    let gain = if x > T::EPSILON { -(-x).exp_m1() / kappa } else { sigma };
    w + (T::ONE - kappa * w) * gain
}

/// `f(√κ σ)/√κ` for a function with f(x) ≈ x near zero.
fn scaled<T: Real>(kappa: T, sigma: T, f: impl Fn(T) -> T) -> T {
    let root = kappa.sqrt();
    let x = root * sigma;
    if x > T::EPSILON { f(x) / root } else { sigma }
}

/// One classical Runge-Kutta step of `dw/dσ = f(w)`; `first` = f(w).
fn runge_kutta<T: Real>(f: impl Fn(T) -> T, w: T, first: T, h: T) -> T {
    let half = h * T::from_f64(0.5);
    let second = f(w + half * first);
    let third = f(w + half * second);
    let fourth = f(w + h * third);
    w + h * T::from_f64(1.0 / 6.0) * (first + (second + second) + (third + third) + fourth)
}

/// Length of the Runge-Kutta step that ends at zero. Its own root, not the flow's: so the branch has no jump there.
fn crossing<T: Real>(f: impl Fn(T) -> T, w: T, first: T) -> T {
    // The force is `first` here and 1 at zero, so the way is between these two.
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

    /// (κ₊, κ₋) as parameters give them: the larger one is 1.
    const SHAPES: [(f64, f64); 6] = [(1.0, 1.0), (1.0, 0.0), (1.0, 0.01), (0.3, 1.0), (0.01, 1.0), (0.0, 1.0)];

    /// The same flow by 100 Runge-Kutta steps a unit of |∂F/∂w|, each side of zero on its own.
    fn reference(ahead: f64, behind: f64, n: f64, mut w: f64, sigma: f64) -> f64 {
        let back = |w: f64| 1.0 + behind * libm::pow((-w).max(0.0), n);
        let out = |w: f64| 1.0 - ahead * libm::pow(w.max(0.0), n);
        let mut left = sigma;
        while w < 0.0 && left > 0.0 {
            let steep = n * behind * libm::pow(-w, n - 1.0);
            // Near zero ever shorter, for |w|ⁿ with n between 1 and 2.
            let h = (0.01 / steep.max(0.25)).min(left).min((-w * 0.05).max(1e-6));
            if w + h * back(w) > 0.0 && crossing(back, w, back(w)) <= h {
                (w, left) = (0.0, left - crossing(back, w, back(w)));
            } else {
                w = runge_kutta(back, w, back(w), h);
                left -= h;
            }
        }
        while left > 0.0 {
            let h = (0.01 / n).min((w * 0.05).max(1e-6)).min(left);
            w = runge_kutta(out, w, out(w), h);
            left -= h;
        }
        w
    }

    fn worst(shapes: &[(f64, f64)], n: f64) -> f64 {
        let mut worst = 0.0f64;
        for &(ahead, behind) in shapes {
            let branch = Branch::<f64>::new(ahead, behind, n);
            let unit = if ahead > 0.0 { branch.limit() } else { 2.0 };
            for w in [-1.0, -0.7, -0.3, -0.05, 0.0, 0.3, 0.9] {
                for sigma in [1e-4, 0.02, 0.1, 0.3, 0.7, 1.0, 1.5, 2.5] {
                    let expected = reference(ahead, behind, n, w * unit, sigma * unit);
                    worst = worst.max((branch.advance(w * unit, sigma * unit) - expected).abs() / unit);
                }
            }
        }
        worst
    }

    #[test]
    fn the_exact_laws_meet_a_fine_integration() {
        for n in [1.0, 2.0] {
            let worst = worst(&SHAPES, n);
            assert!(worst < 1e-10, "n = {n}: {worst:e}");
        }
    }

    #[test]
    fn the_error_of_the_substeps_is_the_stated_one() {
        for n in [1.01, 1.1, 1.3, 1.5, 1.8, 2.2, 3.0, 5.0, 10.0] {
            let worst = worst(&SHAPES, n);
            assert!(worst < 1e-5, "n = {n}: {worst:e}");
        }
    }

    #[test]
    fn beyond_that_range_it_degrades_slowly() {
        for n in [4.0, 20.0] {
            let worst = worst(&[(1e-6, 1.0), (1e-4, 1.0), (1.0, 1.0)], n);
            assert!(worst < 1e-3, "n = {n}: {worst:e}");
        }
    }

    #[test]
    fn short_moves_are_far_more_accurate() {
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
    fn a_long_way_ends_on_the_attractor() {
        for (ahead, behind) in SHAPES.into_iter().filter(|s| s.0 > 0.0) {
            for n in [1.0, 1.5, 2.0, 4.0, 20.0] {
                let branch = Branch::<f64>::new(ahead, behind, n);
                for w in [-0.9, 0.1] {
                    let from = w * branch.limit();
                    for sigma in [50.0, 1e6, 1e300] {
                        let reached = branch.advance(from, sigma * branch.limit());
                        assert!((reached / branch.limit() - 1.0).abs() < 1e-12, "{ahead} {behind} {n}: {reached}");
                    }
                }
            }
        }
    }

    proptest! {
        /// Continuous, rising and inside its bounds for every law and every ratio: what the search needs.
        #[test]
        fn the_branch_rises_without_steps(
            n in prop_oneof![Just(1.0), Just(2.0), 1.0..20.0f64],
            exponent in -6.0..6.0f64, start in -1.0..1.0f64, reach in -4.0..1.0f64,
        ) {
            let ratio = libm::pow(10.0, exponent);
            let branch = Branch::<f64>::new(1.0f64.min(1.0 / ratio), 1.0f64.min(ratio), n);
            let (w, far) = (start * branch.limit(), libm::pow(10.0, reach) * branch.limit());
            // The force is greatest at the start.
            let steepest = if w < 0.0 { 1.0 + branch.behind * libm::pow(-w, n) } else { 1.0 };
            let points: Vec<f64> = (0..=4000).map(|k| branch.advance(w, far * f64::from(k) / 4000.0)).collect();
            prop_assert!(points[0] == w && points[4000] <= branch.limit());
            for pair in points.windows(2) {
                let rise = pair[1] - pair[0];
                prop_assert!(rise >= -1e-14 * branch.limit());
                prop_assert!(rise <= 1.05 * steepest * far / 4000.0 + 1e-14 * branch.limit(), "{rise} {steepest}");
            }
        }

        /// Where the input stops on its way does not matter, to the stated error.
        #[test]
        fn a_way_in_two_parts_is_the_same_way(n in 1.0..10.0f64, start in -1.0..1.0f64, a in 0.0..2.0f64, b in 0.0..2.0f64) {
            let branch = Branch::<f64>::new(1.0, 0.5, n);
            let parts = branch.advance(branch.advance(start, a), b);
            prop_assert!((parts - branch.advance(start, a + b)).abs() < 1e-5);
        }
    }
}
