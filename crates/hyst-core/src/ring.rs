//! The last samples of a signal.

use crate::Real;

/// The last `N` samples: the newest at `newest`, older ones behind it and, wrapped, before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ring<T, const N: usize> {
    samples: [T; N],
    newest: usize,
}

impl<T: Real, const N: usize> Ring<T, N> {
    /// As if the signal had been `x` for ever.
    pub(crate) fn filled(x: T) -> Self {
        Self { samples: [x; N], newest: 0 }
    }

    /// Takes the newest sample and returns the one that it drives out.
    #[inline]
    pub(crate) fn push(&mut self, x: T) -> T {
        self.newest = if self.newest > 0 { self.newest - 1 } else { N.saturating_sub(1) };
        self.samples.get_mut(self.newest).map_or(x, |slot| core::mem::replace(slot, x))
    }

    /// The sample `k` before the newest; `other` if the ring is shorter.
    #[inline]
    pub(crate) fn back(&self, k: usize, other: T) -> T {
        let at = self.newest.saturating_add(k);
        self.samples.get(if at < N { at } else { at - N }).copied().unwrap_or(other)
    }

    /// The samples in two runs, newest first.
    #[inline]
    pub(crate) fn newest_first(&self) -> (&[T], &[T]) {
        let (wrapped, recent) = self.samples.split_at(self.newest.min(N));
        (recent, wrapped)
    }
}
