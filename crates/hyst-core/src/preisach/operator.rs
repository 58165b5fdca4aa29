//! The Preisach operator and its exact inverse.

use super::{Everett, Reversals};
use crate::stage::finite_or;
use crate::{Env, Error, Invert, Real, Stage};

/// History of a Preisach operator: the dominating reversals.
#[derive(Clone, Debug, PartialEq)]
pub struct PreisachState<T, const N: usize> {
    pub(super) memory: Reversals<T, N>,
    /// Output of the map at rest. It is subtracted, because the output at rest is zero by definition.
    pub(super) zero: T,
}

impl<T: Real, const N: usize> PreisachState<T, N> {
    /// Returns a memory before the first reset.
    pub fn empty() -> Self {
        Self { memory: Reversals::new(T::ZERO, T::ZERO), zero: T::ZERO }
    }

    /// Returns the memory with every relay down and the input at the low end of the map.
    pub(super) fn at_low_end(map: &Everett<T, N>) -> Self {
        Self { memory: Reversals::new(map.low, T::ZERO), zero: T::ZERO }
    }

    /// Returns the stack of reversals.
    pub fn memory(&self) -> &Reversals<T, N> {
        &self.memory
    }
}

impl<T: Real, const N: usize> Everett<T, N> {
    /// Returns the output at `u` on the present branch.
    #[inline]
    fn output(&self, memory: &Reversals<T, N>, u: T) -> T {
        self.on_branch(memory.branch(), memory.rising(), u)
    }

    /// Sets virgin memory at the rest input: relays with their centre below it are up. Starting from the low end, that
    /// is a decaying oscillation whose amplitude falls by one node per cycle.
    fn virgin_memory(&self, s: &mut PreisachState<T, N>) {
        *s = PreisachState::at_low_end(self);
        let mut reach = (self.high() - self.rest).at_most(self.rest - self.low);
        let middle = self.rest;
        // `reach` falls by one cell per iteration, so there are at most `cells` iterations.
        for _ in 0..self.cells() {
            if reach <= T::ZERO {
                break;
            }
            s.memory.advance(middle + reach, |m, u| self.output(m, u));
            s.memory.advance(middle - reach, |m, u| self.output(m, u));
            reach -= self.width;
        }
        s.memory.advance(middle, |m, u| self.output(m, u));
        s.zero = s.memory.output();
    }

    /// Returns the outputs at the lowest and the highest input of the grid, from the present memory.
    fn reach(&self, s: &PreisachState<T, N>) -> (T, T) {
        let (mut down, mut up) = (s.memory.clone(), s.memory.clone());
        let low = down.advance(self.low, |m, u| self.output(m, u));
        let high = up.advance(self.high(), |m, u| self.output(m, u));
        (low - s.zero, high - s.zero)
    }
}

impl<T: Real, const N: usize> Stage<T> for Everett<T, N> {
    type State = PreisachState<T, N>;

    fn state(&self) -> Self::State {
        PreisachState::empty()
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        self.virgin_memory(s);
        self.step(s, e, finite_or(u0, T::ZERO))
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        s.memory.advance(u, |m, u| self.output(m, u)) - s.zero
    }
}

/// The exact inverse of a Preisach operator.
///
/// The map rises strictly with the input on every branch, also with some negative densities. So the input for an output
/// is unique. First, loops whose closing output is passed are wiped out. Then bisection finds the cell of the branch,
/// and a linear equation the input in the cell. Outputs that the grid does not reach are found on the linear
/// continuation outside it.
#[derive(Clone, Debug, PartialEq)]
pub struct EverettInverse<T, const N: usize> {
    forward: Everett<T, N>,
}

impl<T: Real, const N: usize> Invert<T> for Everett<T, N> {
    type Inverse = EverettInverse<T, N>;

    /// Requires a surface and a virgin curve that rise strictly from node to node. Then every branch does. If no
    /// density is negative, a reversible slope in every diagonal cell is sufficient.
    fn invert(&self) -> Result<Self::Inverse, Error> {
        if !(0..self.cells()).all(|i| self.reversible(i) > T::ZERO) {
            return Err(Error::NotInvertible("a diagonal cell of the Preisach triangle has no reversible slope"));
        }
        if self.slopes().0 > T::ZERO {
            Ok(EverettInverse { forward: self.clone() })
        } else {
            Err(Error::NotInvertible("a branch of the Everett surface is flat between two nodes"))
        }
    }
}

impl<T: Real, const N: usize> EverettInverse<T, N> {
    /// Returns the outputs at the lowest and the highest input of the grid, from the present memory \[output unit\].
    pub fn reach(&self, s: &PreisachState<T, N>) -> (T, T) {
        self.forward.reach(s)
    }

    /// Returns the input on the present branch at which the output is `y`.
    fn solve(&self, memory: &Reversals<T, N>, y: T) -> T {
        let f = &self.forward;
        let up = memory.rising();
        let at = |u: T| f.output(memory, u);
        let last = f.cells();
        // Edges first: outside the grid the branch continues with a constant slope.
        let (lowest, highest) = (f.low, f.high());
        if memory.now() > highest || up {
            let top = at(highest);
            if top <= y {
                return highest + (y - top) / f.reversible(last - 1);
            }
        }
        if memory.now() < lowest || !up {
            let bottom = at(lowest);
            if bottom >= y {
                return lowest + (y - bottom) / f.reversible(0);
            }
        }
        // Between the present input and the edge, in whole cells.
        let from = memory.now().at_least(lowest).at_most(highest);
        let here = f.locate(from).index;
        let (mut a, mut b) = if up { (here, last) } else { (0, here + 1) };
        while b - a > 1 {
            let middle = a + (b - a) / 2;
            if at(f.at(middle)) <= y { a = middle } else { b = middle }
        }
        let (mut left, mut right) = (f.at(a), f.at(b));
        // The cell in which the branch starts has a kink there. Solve on the side of the branch.
        if let Some((start, _)) = memory.branch() {
            if up { left = left.at_least(start.at_most(right)) } else { right = right.at_most(start.at_least(left)) }
        }
        let (y_left, y_right) = (at(left), at(right));
        if y_right > y_left { left + (y - y_left) * ((right - left) / (y_right - y_left)) } else { left }
    }
}

impl<T: Real, const N: usize> Stage<T> for EverettInverse<T, N> {
    type State = PreisachState<T, N>;

    fn state(&self) -> Self::State {
        self.forward.state()
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        self.forward.virgin_memory(s);
        self.step(s, e, finite_or(u0, T::ZERO))
    }

    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let y = u + s.zero;
        let memory = &mut s.memory;
        if y == memory.output() || !y.is_finite() {
            return memory.now();
        }
        let up = y > memory.output();
        memory.start_branch(up);
        while let Some((_, closing)) = memory.target() {
            if if up { y >= closing } else { y <= closing } {
                memory.wipe_out();
            } else {
                break;
            }
        }
        let input = finite_or(self.solve(memory, y), memory.now());
        // The output is `y` by construction. Storing it prevents accumulation of rounding errors.
        memory.set(input, y);
        input
    }
}

#[cfg(test)]
mod tests {
    use super::super::Grid;
    use super::*;
    use proptest::prelude::*;
    use std::boxed::Box;
    use std::vec::Vec;

    type Map = Everett<f64, 13>;
    const CELLS: usize = 12;

    fn map(rest: f64, densities: &[f64]) -> Box<Map> {
        let mut d = densities.iter().copied().cycle();
        let mut next = move || d.next().unwrap();
        let mut other = next.clone();
        let low = if rest > 0.0 { 0.0 } else { rest };
        let grid = Grid { low, high: low + 120.0, cells: CELLS };
        Box::new(
            Everett::new(
                grid,
                rest,
                |a, b| next() + if a == b { 0.3 } else { 0.0 },
                |_| if rest > low { 0.0 } else { other() },
            )
            .unwrap(),
        )
    }

    fn run(m: &Map, u: &[f64]) -> Vec<f64> {
        let (mut s, e) = (m.state(), Env::default());
        m.reset(&mut s, &e, m.rest);
        u.iter().map(|u| m.step(&mut s, &e, *u)).collect()
    }

    fn densities() -> impl Strategy<Value = Vec<f64>> {
        prop::collection::vec(0.0..1.0f64, 90)
    }
    fn inputs() -> impl Strategy<Value = Vec<f64>> {
        prop::collection::vec(0.0..120.0f64, 20..120)
    }

    proptest! {
        /// Wiping out: a loop inside a larger loop has no effect after the larger loop has passed it.
        #[test]
        fn inner_loops_are_wiped_out(d in densities(), inner in prop::collection::vec(40.0..80.0f64, 1..20), after in inputs(), bipolar: bool) {
            let m = map(if bipolar { 60.0 } else { 0.0 }, &d);
            let mut with: Vec<f64> = std::vec![100.0, 20.0];
            with.extend(&inner);
            with.push(100.0);
            with.extend(&after);
            let mut without: Vec<f64> = std::vec![100.0, 20.0, 100.0];
            without.extend(&after);
            let (a, b) = (run(&m, &with), run(&m, &without));
            let tail = after.len() + 1;
            for (x, y) in a[a.len() - tail..].iter().zip(&b[b.len() - tail..]) {
                prop_assert!((x - y).abs() < 1e-10, "{x} {y}");
            }
        }

        /// Congruency: minor loops between the same two inputs have the same shape for any history.
        #[test]
        fn minor_loops_are_congruent(d in densities(), history in inputs(), low in 5.0..60.0f64, swing in 1.0..55.0f64) {
            let m = map(0.0, &d);
            let high = low + swing;
            let sweep: Vec<f64> = (0..=20).map(|k| low + swing * f64::from(k) / 20.0).collect();
            let shape = |history: &[f64]| {
                let mut u = history.to_vec();
                // Reach `low` from a larger swing, so the loop is inside it.
                u.extend([119.0, 0.5, high, low]);
                u.extend(&sweep);
                let y = run(&m, &u);
                let tail = &y[y.len() - sweep.len()..];
                tail.iter().map(|v| v - tail[0]).collect::<Vec<_>>()
            };
            let (a, b) = (shape(&history), shape(&[119.0, 0.5, 118.0, 3.0, 117.0]));
            for (x, y) in a.iter().zip(&b) {
                prop_assert!((x - y).abs() < 1e-10);
            }
        }

        #[test]
        fn inverse_reaches_every_reference(d in densities(), u in inputs(), bipolar: bool) {
            let m = map(if bipolar { 60.0 } else { 0.0 }, &d);
            let inverse = m.invert().unwrap();
            let e = Env::default();
            let (mut f, mut s, mut i) = (m.state(), m.state(), inverse.state());
            m.reset(&mut f, &e, m.rest);
            m.reset(&mut s, &e, m.rest);
            inverse.reset(&mut i, &e, 0.0);
            let span = m.value(120.0, 0.0);
            for u in &u {
                // Reachable references: outputs of the operator for some input.
                let reference = m.step(&mut s, &e, *u);
                let drive = inverse.step(&mut i, &e, reference);
                prop_assert!((m.step(&mut f, &e, drive) - reference).abs() < 1e-11 * span.max(1.0), "{reference}");
            }
        }
    }

    #[test]
    fn virgin_output_at_rest_is_zero() {
        for rest in [0.0, 60.0] {
            let m = map(rest, &[0.3, 0.1, 0.7]);
            let mut s = m.state();
            assert!(m.reset(&mut s, &Env::default(), rest).abs() < 1e-12);
        }
    }

    #[test]
    fn output_is_bounded_with_a_full_stack() {
        let m = map(0.0, &[0.3, 0.1, 0.7]);
        let u: Vec<f64> =
            (0..1000).map(|k| 60.0 + if k % 2 == 0 { 1.0 } else { -1.0 } * (59.0 - 0.05 * f64::from(k))).collect();
        let y = run(&m, &u);
        let top = m.virgin(120.0);
        assert!(y.iter().all(|y| y.is_finite() && *y >= 0.0 && *y <= top));
    }

    #[test]
    fn reversible_slope_continues_outside_the_grid() {
        let m = map(0.0, &[0.3, 0.1, 0.7]);
        let y = run(&m, &[130.0, 140.0, 130.0]);
        assert!((y[0] - y[2]).abs() < 1e-9 && y[1] > y[0]);
    }
}
