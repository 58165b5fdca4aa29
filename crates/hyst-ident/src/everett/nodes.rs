//! Nodes of a measured surface on a uniform grid.

use hyst_core::Grid;

/// A node of the surface: the fall of the output from α to β.
///
/// All nodes of a row share the output at the top. Its variance is separate, because this error cancels between
/// neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Node {
    pub(super) value: f64,
    /// Variance of the output at the top.
    pub(super) top: f64,
    /// Variance of the output at β.
    pub(super) end: f64,
}

impl Node {
    pub(super) fn towards(self, other: Self, share: f64) -> Self {
        let (a, b) = (1.0 - share, share);
        Self {
            value: a * self.value + b * other.value,
            top: a * a * self.top + b * b * other.top,
            end: a * a * self.end + b * b * other.end,
        }
    }
}

/// Returns the index of node (i, j), j < i.
pub(super) fn place(i: usize, j: usize) -> usize {
    i * (i - 1) / 2 + j
}

/// Returns the input at node k of a grid.
pub(super) fn at(grid: &Grid, k: usize) -> f64 {
    grid.low + (grid.high - grid.low) * k as f64 / grid.cells as f64
}
