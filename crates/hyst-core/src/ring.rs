//! Ring buffer with the last samples of a signal.

use crate::Real;

/// The last `N` samples: the newest is at `newest`, older ones follow it and wrap around to the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ring<T, const N: usize> {
    samples: [T; N],
    newest: usize,
}

impl<T: Real, const N: usize> Ring<T, N> {
    /// Returns the ring of a signal that was always `x`.
    pub(crate) fn filled(x: T) -> Self {
        Self { samples: [x; N], newest: 0 }
    }

    /// Stores the newest sample and returns the oldest, which it replaces.
    #[inline]
    pub(crate) fn push(&mut self, x: T) -> T {
        self.newest = if self.newest > 0 { self.newest - 1 } else { N.saturating_sub(1) };
        self.samples.get_mut(self.newest).map_or(x, |slot| core::mem::replace(slot, x))
    }

    /// Returns the sample `k` before the newest; `other` if the ring is shorter.
    #[inline]
    pub(crate) fn back(&self, k: usize, other: T) -> T {
        let at = self.newest.saturating_add(k);
        self.samples.get(if at < N { at } else { at - N }).copied().unwrap_or(other)
    }

    /// Returns the samples in two slices, newest first.
    #[inline]
    pub(crate) fn newest_first(&self) -> (&[T], &[T]) {
        let (wrapped, recent) = self.samples.split_at(self.newest.min(N));
        (recent, wrapped)
    }
}
