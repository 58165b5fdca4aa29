//! The history of a dynamic Preisach model, and the stack after a trial input.

use crate::Real;
use crate::preisach::Reversals;

/// Start of a branch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Start<T> {
    pub(super) at: T,
    /// The classical output there.
    pub(super) classical: T,
    /// The output of the model there, without the offset.
    pub(super) output: T,
}

/// Data that the model stores at a reversal: its output, and the duration of the branch that led to it, in samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Note<T> {
    pub(super) output: T,
    pub(super) age: u32,
}

/// History of a dynamic Preisach model.
#[derive(Clone, Debug, PartialEq)]
pub struct DpmState<T, const N: usize> {
    pub(super) memory: Reversals<T, N, Note<T>>,
    /// Number of reversals at the bottom of the stack that did not occur (virgin memory) or to which the model does not
    /// return (eq. 17).
    pub(super) untimed: usize,
    /// Start of the branch after them.
    pub(super) start: Start<T>,
    /// Number of samples since the start of the present branch.
    pub(super) age: u32,
    pub(super) offset: T,
    /// Output of the map at rest. It is subtracted, because the output at rest is zero by definition.
    pub(super) zero: T,
}

impl<T: Real, const N: usize> DpmState<T, N> {
    /// Returns the offset δ from steps at closed loops \[output unit\].
    pub fn offset(&self) -> T {
        self.offset
    }

    /// Returns the dominating reversals of the input, outermost first \[input unit\].
    pub fn in_force(&self) -> &[T] {
        self.memory.in_force()
    }
}

/// The stack after a trial input, without a copy.
pub(super) struct Path<'a, T, const N: usize> {
    pub(super) memory: &'a Reversals<T, N, Note<T>>,
    /// Number of reversals in force, including the new one.
    pub(super) len: usize,
    /// The present input, if the trial reverses there. It is at the top of the stack.
    pub(super) new: Option<(Start<T>, u32)>,
    pub(super) untimed: usize,
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
        let ((at, classical), note) = (self.memory.reversal(k)?, self.memory.note(k)?);
        Some((Start { at, classical, output: note.output }, note.age))
    }

    /// Returns the start of the Everett branch; `None` on the virgin curve.
    #[inline]
    pub(super) fn branch(&self) -> Option<(T, T)> {
        let (r, _) = self.reversal(self.len.checked_sub(1)?)?;
        Some((r.at, r.classical))
    }

    /// Returns the input at which the branch closes its loop.
    #[inline]
    pub(super) fn target(&self) -> Option<T> {
        Some(self.reversal(self.len.checked_sub(2)?)?.0.at)
    }

    /// Returns the start from which rate and change are measured.
    #[inline]
    pub(super) fn start(&self) -> Start<T> {
        match self.len.checked_sub(1) {
            Some(top) if top >= self.untimed => self.reversal(top).map_or(self.start, |r| r.0),
            _ => self.start,
        }
    }

    /// Reverses at the present input.
    pub(super) fn reverse(&mut self, here: Start<T>, drifting: bool) {
        self.new = Some((here, self.age));
        self.len += 1;
        if drifting {
            (self.start, self.untimed) = (here, self.len);
        }
        self.age = 1;
    }

    /// Closes the innermost loop and returns to the branch that it interrupted, with or without the time of the loop.
    /// If that branch did not occur, it has no start and no time, and the present branch continues.
    pub(super) fn close(&mut self, with_the_loop: bool) {
        let target = self.len.saturating_sub(2);
        if target < self.untimed {
            (self.start, self.untimed) = (self.start(), target);
        } else if let Some((_, age)) = self.reversal(target) {
            let inside = self.reversal(target + 1).map_or(0, |(_, age)| age).saturating_add(self.age);
            self.age = if with_the_loop { age.saturating_add(inside) } else { age };
        }
        self.len = target;
    }
}
