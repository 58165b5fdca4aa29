//! The stack of dominating reversals: the memory of every Preisach operator.

use crate::Real;

/// Nested reversals of the input, outermost first: maxima at even, minima at odd places.
///
/// An input that passes a reversal wipes it out together with its partner. At most `M` reversals
/// are kept. When one more is needed, the pair with the smallest swing is forgotten: the output
/// then errs by at most the Everett value of that swing, until an outer reversal is passed.
#[derive(Clone, Debug, PartialEq)]
pub struct Reversals<T, const M: usize> {
    at: [T; M],
    /// What the operator's output was at each reversal.
    output: [T; M],
    len: usize,
    now: T,
    output_now: T,
}

impl<T: Real, const M: usize> Reversals<T, M> {
    /// Virgin memory at input `u`, output `y`.
    pub fn new(u: T, y: T) -> Self {
        Self { at: [T::ZERO; M], output: [T::ZERO; M], len: 0, now: u, output_now: y }
    }

    /// The reversals in force, outermost first.
    pub fn in_force(&self) -> &[T] {
        self.at.get(..self.len).unwrap_or_default()
    }

    /// The last input.
    pub fn now(&self) -> T {
        self.now
    }

    /// The last output.
    pub fn output(&self) -> T {
        self.output_now
    }

    /// Whether the branch that the input is on is a rising one.
    pub fn rising(&self) -> bool {
        self.len.is_multiple_of(2)
    }

    /// Where the present branch began, and the output there; `None` on the virgin curve.
    pub fn branch(&self) -> Option<(T, T)> {
        self.back(1)
    }

    /// The reversal that the present branch closes on, and the output there; `None` if it ends at
    /// the edge of the range.
    pub(crate) fn target(&self) -> Option<(T, T)> {
        self.back(2)
    }

    fn back(&self, k: usize) -> Option<(T, T)> {
        let i = self.len.checked_sub(k)?;
        Some((*self.at.get(i)?, *self.output.get(i)?))
    }

    /// Begins the branch that leads towards `up` (or down), if the input is not on it yet.
    pub(crate) fn turn(&mut self, up: bool) {
        if self.rising() == up {
            return;
        }
        if self.len == M {
            self.forget_smallest();
        }
        if let (Some(u), Some(y)) = (self.at.get_mut(self.len), self.output.get_mut(self.len)) {
            (*u, *y) = (self.now, self.output_now);
            self.len += 1;
        }
    }

    /// Wipes out the innermost pair: the input has passed the branch's target.
    pub(crate) fn wipe(&mut self) {
        self.len = self.len.saturating_sub(2);
    }

    /// Records where the input and the output are.
    pub(crate) fn set(&mut self, u: T, y: T) {
        (self.now, self.output_now) = (u, y);
    }

    /// Follows the input to `u`: turns, wipes out, moves. `output` tells the operator's output at
    /// the end, given the branch.
    pub fn advance(&mut self, u: T, output: impl FnOnce(&Self, T) -> T) -> T {
        if u == self.now || !u.is_finite() {
            return self.output_now;
        }
        let up = u > self.now;
        self.turn(up);
        while let Some((target, _)) = self.target() {
            if if up { u >= target } else { u <= target } {
                self.wipe();
            } else {
                break;
            }
        }
        let y = output(self, u);
        self.set(u, y);
        y
    }

    fn forget_smallest(&mut self) {
        let mut smallest = (0, None);
        for (i, pair) in self.at.windows(2).enumerate() {
            let swing = match pair {
                [a, b] => (*a - *b).abs(),
                _ => continue,
            };
            if smallest.1.is_none_or(|s| swing < s) {
                smallest = (i, Some(swing));
            }
        }
        if smallest.1.is_some() {
            drop_pair(&mut self.at, smallest.0);
            drop_pair(&mut self.output, smallest.0);
            self.wipe();
        }
    }
}

/// Moves what lies behind the pair at `first` over it.
fn drop_pair<T: Copy>(list: &mut [T], first: usize) {
    let tail = list.get_mut(first..).unwrap_or_default();
    if tail.len() >= 2 {
        tail.copy_within(2.., 0);
    }
}
