//! The inverse of the operator with viscous plays.

use super::{Drag, ViscousPi, ViscousPiState, dead_zone};
use crate::stage::{hold, rest};
use crate::{Env, Error, Invert, Real, Stage};

/// The inverse of a viscous operator.
///
/// In one sample the output is a rising function of the input. Play i starts to slide at the edge `pᵢ ± rᵢ`, and the
/// edges always stay in the order of the thresholds. Beyond its edge a play adds a share of `a wᵢ` to the slope; the
/// first play has the largest share. So every slope is a mean of p₀ and of p₀ plus a times the first weights, and is
/// positive if those are.
///
/// - J = 0: the function is piecewise linear, and one pass over the plays finds the input.
/// - J > 0: if no play slides, the input is that of plays at rest. Else Newton's method in a bracket finds it. It
///   starts at the solution for the first play alone. It ends when the error of the output is at most 4 ε of `p₀|u| +
///   Σᵢ |wᵢ| (|pᵢ| + motion of play i)` plus ε of slope times |u|, where ε is the precision of `T`, or when the bracket
///   contains no other number. In `f64` the error is within 1e-12 of the output span. Each of at most
///   [`EVALUATIONS`](Self::EVALUATIONS) evaluations halves the smallest error so far, or the next one halves the
///   bracket. Usually there are 3, rarely 10.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousPiInverse<T, const N: usize> {
    forward: ViscousPi<T, N>,
    /// Smallest slope \[y/u\].
    least: T,
}

impl<T: Real, const N: usize> Invert<T> for ViscousPi<T, N> {
    type Inverse = ViscousPiInverse<T, N>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        let mut least = self.gain;
        // Both slopes: within a sample and after settling.
        for slide in [self.drag.slide, T::ONE] {
            let mut slope = self.gain;
            let mut rises = slope > T::ZERO;
            for w in self.weights.iter().take(self.len) {
                slope += slide * *w;
                rises &= slope > T::ZERO;
                least = least.at_most(slope);
            }
            if !rises {
                return Err(Error::NotInvertible("p0 plus the first weights must stay positive for a rising curve"));
            }
        }
        Ok(ViscousPiInverse { forward: *self, least })
    }
}

/// History of the inverse: the history of the operator, and the last reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousPiInverseState<T, const N: usize> {
    forward: ViscousPiState<T, N>,
    reference: T,
}

impl<T: Real, const N: usize> ViscousPiInverse<T, N> {
    /// Maximum number of evaluations of the operator for one sample: twice the bits of a number, sufficient for slopes
    /// that differ by a factor of 10⁶.
    pub const EVALUATIONS: usize = 128;

    /// Iterates over the plays with their thresholds and weights.
    fn plays<'a>(&'a self, s: &'a ViscousPiState<T, N>) -> impl Iterator<Item = (T, T, T)> + 'a {
        let f = &self.forward;
        s.plays.iter().zip(&f.thresholds).zip(&f.weights).take(f.len).map(|((p, r), w)| (*p, *r, *w))
    }

    fn solve(&self, s: &mut ViscousPiState<T, N>, y: T, drag: &Drag<T>) -> T {
        // Solution with the plays at rest.
        let mut remaining = y;
        for (p, _, w) in self.plays(s) {
            remaining -= w * p;
        }
        let u = remaining / self.forward.gain;
        let u = if drag.is_linear() { self.pass(s, remaining, u, drag) } else { self.search(s, y, u, drag) };
        self.forward.advance(s, u, drag);
        u
    }

    /// Returns the input for J = 0. `remaining` is the output without the plays at rest, and `u` the input for it. Each
    /// play that slides adds its slope.
    #[inline]
    fn pass(&self, s: &ViscousPiState<T, N>, mut remaining: T, mut u: T, drag: &Drag<T>) -> T {
        let mut slope = self.forward.gain;
        // The plays start to slide in order, all on the side of the first one.
        let up = self.plays(s).next().is_some_and(|(p, ..)| u > p);
        for (p, r, w) in self.plays(s) {
            let edge = p + if up { r } else { -r };
            if if up { u <= edge } else { u >= edge } {
                break;
            }
            let share = drag.slide * w;
            slope += share;
            remaining += share * edge;
            u = remaining / slope;
        }
        u
    }

    /// Returns the input for J > 0. `u` is the input for plays at rest.
    #[inline(never)]
    fn search(&self, s: &ViscousPiState<T, N>, y: T, u: T, drag: &Drag<T>) -> T {
        let (gain, four, half) = (self.forward.gain, T::from_f64(4.0), T::from_f64(0.5));
        let Some((p, r, w)) = self.plays(s).next() else { return u };
        let (side, edge) = if u > p { (T::ONE, p + r) } else { (-T::ONE, p - r) };
        let push = gain * side * (u - edge);
        // A margin for the rounding of both.
        let margin = four * T::EPSILON * gain * (u.abs() + edge.abs());
        let (mut near, mut far) = (edge, edge + side * ((push + margin) / self.least));
        // No play slides, or the input overflows.
        if push <= T::ZERO || !far.is_finite() {
            return u;
        }
        let between = |x: T, near: T, far: T| side * x > side * near && side * x < side * far;
        let first = edge + side * drag.overdrive_of_one(gain, w, push);
        let mut u = if between(first, near, far) { first } else { far };
        let mut best = T::from_f64(f64::INFINITY);
        for _ in 0..Self::EVALUATIONS {
            let (reached, parts, slope) = self.probe(s, u, drag);
            let error = reached - y;
            if error.abs() <= T::EPSILON * (four * parts + slope * u.abs()) {
                break;
            }
            if side * error > T::ZERO {
                far = u;
            } else {
                near = u;
            }
            let newton = u - error / slope;
            let halved = error.abs() <= half * best;
            best = error.abs().at_most(best);
            let next = if halved && between(newton, near, far) { newton } else { near + (far - near) * half };
            if next == u {
                break;
            }
            u = next;
        }
        u
    }

    /// Returns for the input `u` the output of the operator, the sum of the absolute values of its parts (the scale of
    /// rounding errors), and the slope of the output; for J > 0.
    fn probe(&self, s: &ViscousPiState<T, N>, u: T, drag: &Drag<T>) -> (T, T, T) {
        let mut y = self.forward.gain * u;
        let (mut parts, mut slope) = (y.abs(), self.forward.gain);
        for (p, r, w) in self.plays(s) {
            let (moves, rises) = drag.rooted(dead_zone(u - p, r));
            y += w * (p + moves);
            parts += w.abs() * (p.abs() + moves.abs());
            slope += w * rises;
        }
        (y, parts, slope)
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
        self.solve(&mut s.forward, y, &Drag::none())
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let y = hold(&mut s.reference, u);
        self.solve(&mut s.forward, y, &self.forward.drag)
    }
}
