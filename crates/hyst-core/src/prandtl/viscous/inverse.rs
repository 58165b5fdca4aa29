//! The input that makes dragging plays reach an output.

use super::{Drag, ViscousPi, ViscousPiState, dead};
use crate::stage::{hold, rest};
use crate::{Env, Error, Invert, Real, Stage};

/// The inverse of a viscous operator.
///
/// In one sample the output is a rising function of the input: play i begins to slide at `pᵢ ± rᵢ`, these places stay in the order of
/// the thresholds for ever, and beyond its own a play adds a share of `a wᵢ` to the slope, the first one the largest. So every slope
/// is a mean of p₀ and of p₀ plus a times the first weights, and rises where those do.
///
/// - J = 0: the function is piecewise linear, and one pass over the plays finds the input.
/// - J > 0: where no play slides, the input is that of plays at rest. Beyond, Newton's method in a bracket, from what the first play alone would
///   need. It ends when the operator's own output misses the reference by at most 4 ε of `p₀|u| + Σᵢ |wᵢ| (|pᵢ| + how far it moves)`
///   plus ε of slope times |u|, where ε is the precision of `T`, or when no number lies between: within 1e-12 of the output's span in
///   `f64`. Each of at most [`EVALUATIONS`](Self::EVALUATIONS) evaluations halves the least miss so far, or the one after it the
///   bracket; 3 are usual, 10 rare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousPiInverse<T, const N: usize> {
    forward: ViscousPi<T, N>,
    /// The least slope \[y/u\].
    least: T,
}

impl<T: Real, const N: usize> Invert<T> for ViscousPi<T, N> {
    type Inverse = ViscousPiInverse<T, N>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        let mut least = self.gain;
        // Both slopes: within a sample, and settled.
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

/// History of the inverse: that of the operator, and the last reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousPiInverseState<T, const N: usize> {
    forward: ViscousPiState<T, N>,
    reference: T,
}

impl<T: Real, const N: usize> ViscousPiInverse<T, N> {
    /// Most evaluations of the operator for one sample: twice the bits of a number, with room for slopes that differ a million times.
    pub const EVALUATIONS: usize = 128;

    /// The plays with their thresholds and weights.
    fn plays<'a>(&'a self, s: &'a ViscousPiState<T, N>) -> impl Iterator<Item = (T, T, T)> + 'a {
        let f = &self.forward;
        s.plays.iter().zip(&f.thresholds).zip(&f.weights).take(f.len).map(|((p, r), w)| (*p, *r, *w))
    }

    fn solve(&self, s: &mut ViscousPiState<T, N>, y: T, drag: &Drag<T>) -> T {
        // With the plays at rest.
        let mut rest = y;
        for (p, _, w) in self.plays(s) {
            rest -= w * p;
        }
        let u = rest / self.forward.gain;
        let u = if drag.is_linear() { self.pass(s, rest, u, drag) } else { self.search(s, y, u, drag) };
        self.forward.advance(s, u, drag);
        u
    }

    /// The input for J = 0, from what is left of the output by plays at rest and the input that this would take: each play that
    /// slides adds its slope.
    #[inline]
    fn pass(&self, s: &ViscousPiState<T, N>, mut rest: T, mut u: T, drag: &Drag<T>) -> T {
        let mut slope = self.forward.gain;
        // The plays leave their bands in order, all on the side on which the first one does.
        let up = self.plays(s).next().is_some_and(|(p, ..)| u > p);
        for (p, r, w) in self.plays(s) {
            let edge = p + if up { r } else { -r };
            if if up { u <= edge } else { u >= edge } {
                break;
            }
            let share = drag.slide * w;
            slope += share;
            rest += share * edge;
            u = rest / slope;
        }
        u
    }

    /// The input for J > 0, from the one that plays at rest would take.
    #[inline(never)]
    fn search(&self, s: &ViscousPiState<T, N>, y: T, u: T, drag: &Drag<T>) -> T {
        let (gain, four, half) = (self.forward.gain, T::from_f64(4.0), T::from_f64(0.5));
        let Some((p, r, w)) = self.plays(s).next() else { return u };
        let (side, edge) = if u > p { (T::ONE, p + r) } else { (-T::ONE, p - r) };
        let push = gain * side * (u - edge);
        // With room for what rounding took from the two.
        let room = four * T::EPSILON * gain * (u.abs() + edge.abs());
        let (mut near, mut far) = (edge, edge + side * ((push + room) / self.least));
        // No play slides, or no number is as large as the input.
        if push <= T::ZERO || !far.is_finite() {
            return u;
        }
        let between = |x: T, near: T, far: T| side * x > side * near && side * x < side * far;
        let first = edge + side * drag.alone(gain, w, push);
        let mut u = if between(first, near, far) { first } else { far };
        let mut best = T::from_f64(f64::INFINITY);
        for _ in 0..Self::EVALUATIONS {
            let (reached, parts, slope) = self.probe(s, u, drag);
            let miss = reached - y;
            if miss.abs() <= T::EPSILON * (four * parts + slope * u.abs()) {
                break;
            }
            if side * miss > T::ZERO {
                far = u;
            } else {
                near = u;
            }
            let newton = u - miss / slope;
            let halved = miss.abs() <= half * best;
            best = miss.abs().at_most(best);
            let next = if halved && between(newton, near, far) { newton } else { near + (far - near) * half };
            if next == u {
                break;
            }
            u = next;
        }
        u
    }

    /// What the operator would give for the input `u`, the sum of its parts without their signs (what rounding is relative to), and
    /// how the output rises with the input; J > 0.
    fn probe(&self, s: &ViscousPiState<T, N>, u: T, drag: &Drag<T>) -> (T, T, T) {
        let mut y = self.forward.gain * u;
        let (mut parts, mut slope) = (y.abs(), self.forward.gain);
        for (p, r, w) in self.plays(s) {
            let (moves, rises) = drag.rooted(dead(u - p, r));
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
