//! The stack of dominating reversals: the memory of every Preisach operator.

use crate::Real;

/// Nested reversals of the input, outermost first: maxima at even indices, minima at odd indices.
///
/// An input that passes a reversal wipes out this reversal and the next inner one. At most `N` pairs are stored, one
/// per node along an edge of the map. Virgin memory in the middle of a grid of `N − 1` cells needs one reversal per
/// cell and always fits. If the stack is full, the pair whose relays cover the smallest rectangle of the plane of α and
/// β is removed. Nested reversals share one span, so that rectangle is at most a quarter of a cell. This is the largest
/// share of relays that are wrong after one removal, until an outer reversal is passed. `K` is further data that an
/// operator stores at each reversal.
#[derive(Clone, Debug, PartialEq)]
pub struct Reversals<T, const N: usize, K = ()> {
    at: [[T; 2]; N],
    /// Output of the operator at each reversal.
    output: [[T; 2]; N],
    note: [[K; 2]; N],
    len: usize,
    now: T,
    output_now: T,
}

impl<T: Real, const N: usize, K: Copy + Default> Reversals<T, N, K> {
    /// Returns virgin memory at input `u` and output `y`.
    pub fn new(u: T, y: T) -> Self {
        Self {
            at: [[T::ZERO; 2]; N],
            output: [[T::ZERO; 2]; N],
            note: [[K::default(); 2]; N],
            len: 0,
            now: u,
            output_now: y,
        }
    }

    /// Returns the reversals in force, outermost first.
    pub fn in_force(&self) -> &[T] {
        self.at.as_flattened().get(..self.len).unwrap_or_default()
    }

    /// Returns the number of reversals in force.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Returns the last input.
    #[inline]
    pub fn now(&self) -> T {
        self.now
    }

    /// Returns the last output.
    #[inline]
    pub fn output(&self) -> T {
        self.output_now
    }

    /// Returns whether the present branch is a rising one.
    #[inline]
    pub fn rising(&self) -> bool {
        self.len.is_multiple_of(2)
    }

    /// Returns the input at which the present branch started, and the output there; `None` on the virgin curve.
    #[inline]
    pub fn branch(&self) -> Option<(T, T)> {
        self.reversal(self.len.checked_sub(1)?)
    }

    /// Returns the reversal at which the present branch closes its loop, and the output there; `None` if the branch
    /// ends at the edge of the range.
    #[inline]
    pub(crate) fn target(&self) -> Option<(T, T)> {
        self.reversal(self.len.checked_sub(2)?)
    }

    /// Returns reversal `k` and the output there.
    #[inline]
    pub(crate) fn reversal(&self, k: usize) -> Option<(T, T)> {
        Some((*self.at.as_flattened().get(k)?, *self.output.as_flattened().get(k)?))
    }

    /// Returns the further data of reversal `k`.
    #[inline]
    pub(crate) fn note(&self, k: usize) -> Option<K> {
        self.note.as_flattened().get(k).copied()
    }

    /// Makes the present input a reversal if the stack is not full.
    #[inline]
    pub(crate) fn push(&mut self, note: K) {
        let slots = (
            self.at.as_flattened_mut().get_mut(self.len),
            self.output.as_flattened_mut().get_mut(self.len),
            self.note.as_flattened_mut().get_mut(self.len),
        );
        if let (Some(u), Some(y), Some(k)) = slots {
            (*u, *y, *k) = (self.now, self.output_now, note);
            self.len += 1;
        }
    }

    /// Keeps only the outermost `len` reversals.
    #[inline]
    pub(crate) fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len);
    }

    /// Sets the present input and output.
    #[inline]
    pub(crate) fn set(&mut self, u: T, y: T) {
        (self.now, self.output_now) = (u, y);
    }

    /// Returns the index k of the pair (k, k + 1) that must be removed before another reversal is stored; `None` if the
    /// stack is not full. Its relays cover the smallest rectangle between the pair and its neighbours k − 1 and k + 2.
    /// For the last pair the present input is a neighbour. The outermost reversal is never removed: it has no outer
    /// neighbour, and its relays extend to the low end.
    #[inline]
    pub(crate) fn pair_to_remove(&self) -> Option<usize> {
        if self.len < 2 * N { None } else { Some(self.smallest_pair()) }
    }

    fn smallest_pair(&self) -> usize {
        let at = self.in_force();
        let area = |a: T, b: T, c: T, d: T| (c - a).abs() * (d - b).abs();
        let mut first = self.len.saturating_sub(2);
        let mut least = match at.last_chunk() {
            Some([a, b, c]) => area(*a, *b, *c, self.now),
            None => T::ZERO,
        };
        for (k, four) in at.windows(4).enumerate() {
            if let [a, b, c, d] = four {
                let area = area(*a, *b, *c, *d);
                if area < least {
                    (first, least) = (k + 1, area);
                }
            }
        }
        first
    }

    /// Removes reversals `k` and `k + 1`.
    pub(crate) fn remove(&mut self, k: usize) {
        remove_two(self.at.as_flattened_mut(), k);
        remove_two(self.output.as_flattened_mut(), k);
        remove_two(self.note.as_flattened_mut(), k);
        self.len = self.len.saturating_sub(2);
    }

    /// Iterates over outputs and further data of the reversals from `k`.
    pub(crate) fn tail_mut(&mut self, k: usize) -> impl Iterator<Item = (&mut T, &mut K)> {
        let (outputs, notes) = (self.output.as_flattened_mut(), self.note.as_flattened_mut());
        outputs.iter_mut().zip(notes).take(self.len).skip(k)
    }
}

impl<T: Real, const N: usize> Reversals<T, N> {
    /// Returns the same reversals with default further data.
    pub(crate) fn with_notes<K: Copy + Default>(self) -> Reversals<T, N, K> {
        let Self { at, output, len, now, output_now, .. } = self;
        Reversals { at, output, note: [[K::default(); 2]; N], len, now, output_now }
    }

    /// Starts a branch in the direction `up` (or down) if the present branch has the other direction.
    #[inline]
    pub(crate) fn start_branch(&mut self, up: bool) {
        if self.rising() != up {
            if let Some(k) = self.pair_to_remove() {
                self.remove(k);
            }
            self.push(());
        }
    }

    /// Wipes out the innermost pair, after the input has passed the target of the branch.
    #[inline]
    pub(crate) fn wipe_out(&mut self) {
        self.truncate(self.len.saturating_sub(2));
    }

    /// Moves the input to `u` and returns the output: starts a branch if needed, and wipes out reversals. `output`
    /// computes the output at the end from the branch.
    #[inline]
    pub fn advance(&mut self, u: T, output: impl FnOnce(&Self, T) -> T) -> T {
        if u == self.now || !u.is_finite() {
            return self.output_now;
        }
        let up = u > self.now;
        self.start_branch(up);
        while let Some((target, _)) = self.target() {
            if if up { u >= target } else { u <= target } {
                self.wipe_out();
            } else {
                break;
            }
        }
        let y = output(self, u);
        self.set(u, y);
        y
    }
}

fn remove_two<X: Copy>(list: &mut [X], first: usize) {
    for k in first..list.len().saturating_sub(2) {
        if let (Some(x), Some(slot)) = (list.get(k + 2).copied(), list.get_mut(k)) {
            *slot = x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const PAIRS: usize = 6;

    /// Returns a decaying oscillation between 0 and 1. `steps` are the steps by which maxima fall and minima rise.
    fn spiral(steps: &[(f64, f64)]) -> Vec<f64> {
        let (mut high, mut low) = (1.0, 0.0);
        let total: f64 = steps.iter().map(|(a, b)| a + b).sum();
        let mut u = Vec::new();
        for (a, b) in steps {
            u.extend([high, low]);
            high -= a / total;
            low += b / total;
        }
        u
    }

    proptest! {
        /// The removed pair has the smallest rectangle, which is at most a quarter of a cell.
        #[test]
        fn a_removed_pair_covers_at_most_a_quarter_of_a_cell(
            steps in prop::collection::vec((0.01..1.0f64, 0.01..1.0f64), PAIRS),
        ) {
            let mut m = Reversals::<f64, PAIRS>::new(0.0, 0.0);
            let u = spiral(&steps);
            let [.., high, low] = u[..] else { unreachable!() };
            for u in u {
                m.advance(u, |_, u| u);
            }
            // Two more reversals inside the last loop: the first fills the stack, the second needs a removal.
            let (last, inside) = (low + 0.9 * (high - low), low + 0.1 * (high - low));
            m.advance(last, |_, u| u);
            let mut all: Vec<f64> = m.in_force().to_vec();
            prop_assert_eq!(all.len(), 2 * PAIRS);
            m.advance(inside, |_, u| u);
            let after: Vec<f64> = m.in_force().to_vec();
            prop_assert_eq!(after.len(), 2 * PAIRS - 1);
            all.push(last);
            let areas: Vec<f64> = all.windows(4).map(|w| (w[2] - w[0]).abs() * (w[3] - w[1]).abs()).collect();
            let least = areas.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert!(least <= 0.25 / ((PAIRS - 1) * (PAIRS - 1)) as f64);
            let k = 1 + areas.iter().position(|a| *a == least).unwrap();
            all.drain(k..k + 2);
            prop_assert_eq!(after, all);
        }

        /// Maxima fall and minima rise for any input, also when pairs are removed.
        #[test]
        fn reversals_stay_nested(u in prop::collection::vec(-1.0..1.0f64, 1..400), decay in 0.9..1.0f64) {
            let mut m = Reversals::<f64, 3>::new(-1.0, 0.0);
            let mut scale = 1.0;
            for u in u {
                m.advance(u * scale, |_, u| u);
                scale *= decay;
                for three in m.in_force().windows(3) {
                    let inside = (three[1] - three[0]) * (three[2] - three[0]) >= 0.0;
                    prop_assert!(inside && (three[2] - three[1]).abs() <= (three[1] - three[0]).abs());
                }
            }
        }
    }

    #[test]
    fn a_stack_of_a_single_pair_follows_the_input() {
        let mut m = Reversals::<f64, 1>::new(0.0, 0.0);
        for k in 0..100 {
            let u = if k % 2 == 0 { 1.0 } else { -1.0 } / f64::from(k + 1);
            assert_eq!(m.advance(u, |_, u| u), u);
        }
    }
}
