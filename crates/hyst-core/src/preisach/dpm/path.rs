//! The history of a dynamic Preisach model, and the stack as a trial input would leave it.

use crate::Real;
use crate::preisach::Reversals;

/// Where a branch begins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Start<T> {
    pub(super) at: T,
    /// The classical output there.
    pub(super) classical: T,
    /// The model's output there, without the offset.
    pub(super) output: T,
}

/// What the model notes at a reversal: its output, and how many samples the branch that led there had lasted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Turn<T> {
    pub(super) output: T,
    pub(super) age: u32,
}

/// History of a dynamic Preisach model.
#[derive(Clone, Debug, PartialEq)]
pub struct DpmState<T, const N: usize> {
    pub(super) memory: Reversals<T, N, Turn<T>>,
    /// Reversals at the bottom of the stack that never happened (virgin memory) or that are not returned to (eq. 17).
    pub(super) undated: usize,
    /// Where the branch began that leads away from them.
    pub(super) start: Start<T>,
    /// Samples since the present branch began.
    pub(super) age: u32,
    pub(super) offset: T,
    /// The output at rest is zero by definition; this is what the map says it is.
    pub(super) zero: T,
}

impl<T: Real, const N: usize> DpmState<T, N> {
    /// The offset δ that is left of steps at closed loops \[output unit\].
    pub fn offset(&self) -> T {
        self.offset
    }

    /// The dominating reversals of the input, outermost first \[input unit\].
    pub fn in_force(&self) -> &[T] {
        self.memory.in_force()
    }
}

/// The stack as it would be for a trial input, told without copying it.
pub(super) struct Path<'a, T, const N: usize> {
    pub(super) memory: &'a Reversals<T, N, Turn<T>>,
    /// Reversals in force, with the new one.
    pub(super) len: usize,
    /// The present input, where the trial turns there; its place is the top of the memory.
    pub(super) new: Option<(Start<T>, u32)>,
    pub(super) undated: usize,
    pub(super) start: Start<T>,
    pub(super) age: u32,
}

impl<T: Real, const N: usize> Path<'_, T, N> {
    #[inline]
    pub(super) fn rising(&self) -> bool {
        self.len.is_multiple_of(2)
    }

    #[inline]
    fn reversal(&self, k: usize) -> Option<(Start<T>, u32)> {
        if k == self.memory.len() {
            return self.new;
        }
        let ((at, classical), turn) = (self.memory.reversal(k)?, self.memory.note(k)?);
        Some((Start { at, classical, output: turn.output }, turn.age))
    }

    /// Where the Everett branch began; `None` on the virgin curve.
    #[inline]
    pub(super) fn branch(&self) -> Option<(T, T)> {
        let (r, _) = self.reversal(self.len.checked_sub(1)?)?;
        Some((r.at, r.classical))
    }

    /// The input at which the branch closes its loop.
    #[inline]
    pub(super) fn target(&self) -> Option<T> {
        Some(self.reversal(self.len.checked_sub(2)?)?.0.at)
    }

    /// From where rate and change count.
    #[inline]
    pub(super) fn start(&self) -> Start<T> {
        match self.len.checked_sub(1) {
            Some(top) if top >= self.undated => self.reversal(top).map_or(self.start, |r| r.0),
            _ => self.start,
        }
    }

    /// Turns at the present input.
    pub(super) fn turn(&mut self, here: Start<T>, drifting: bool) {
        self.new = Some((here, self.age));
        self.len += 1;
        if drifting {
            (self.start, self.undated) = (here, self.len);
        }
        self.age = 1;
    }

    /// The innermost loop closes: back on the branch that it interrupted, with the time of the loop or without it. A branch
    /// that never began has no start and no time of its own, and the present one simply goes on.
    pub(super) fn close(&mut self, with_the_loop: bool) {
        let target = self.len.saturating_sub(2);
        if target < self.undated {
            (self.start, self.undated) = (self.start(), target);
        } else if let Some((_, age)) = self.reversal(target) {
            let inside = self.reversal(target + 1).map_or(0, |(_, age)| age).saturating_add(self.age);
            self.age = if with_the_loop { age.saturating_add(inside) } else { age };
        }
        self.len = target;
    }
}
