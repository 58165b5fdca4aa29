//! The Everett map on a uniform grid.

use crate::error::{coefficient, finite, within};
use crate::{Error, Real};

/// A uniform grid of `cells` cells from `low` to `high` \[V\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Lowest input \[V\].
    pub low: f64,
    /// Highest input \[V\].
    pub high: f64,
    /// Number of cells along one edge of the triangle.
    pub cells: usize,
}

/// Position of an input on a grid: the cell, and the fraction of the cell below the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell<T> {
    /// Index of the cell.
    pub index: usize,
    /// Fraction of the cell below the input, 0 to 1.
    pub fraction: T,
}

/// Everett map of a Preisach operator: `E(α, β) ≥ 0` is the increase of the output when the input rises monotonically
/// from β to α, and the decrease when it falls from α to β, on any branch that starts there.
///
/// Between nodes the map is bilinear (cells of constant relay density). In the triangles on the diagonal it is linear
/// in α − β (relays without width: the reversible part). `first[i]` is the virgin curve: the increase of the output
/// from rest at the low end up to node i. It is above `E(αᵢ, low)`, because some relays switch up once and stay up as
/// long as the input does not go below `low`.
///
/// The number of nodes `N` must be at least the number of cells + 1. Outside the grid the map continues with the
/// reversible slope of the outermost diagonal cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Everett<T, const N: usize> {
    nodes: [[T; N]; N],
    first: [T; N],
    cells: usize,
    pub(super) low: T,
    pub(super) width: T,
    per_width: T,
    pub(super) rest: T,
}

impl<T: Real, const N: usize> Everett<T, N> {
    /// Creates the map from relay densities. `density(a, b)`, b ≤ a, is the output of all relays of the cell with α in
    /// grid interval a and β in interval b. `once(a)` is the output of relays with α in interval a and β below the
    /// grid. `rest` is the input at rest with virgin memory \[V\]. Relays with β below and α above `rest` are up if
    /// their centre is below `rest`.
    ///
    /// Single densities may be negative (noise of an identification) if the surface still rises with α and falls with
    /// β.
    ///
    /// # Errors
    /// If the grid is empty or larger than `N − 1` cells, a density is not finite, or the surface or the virgin curve
    /// is not monotone: [`Error::Node`] names the node.
    pub fn new(
        grid: Grid,
        rest: f64,
        mut density: impl FnMut(usize, usize) -> f64,
        mut once: impl FnMut(usize) -> f64,
    ) -> Result<Self, Error> {
        // E(i, j) = E(i−1, j) + Σ_{b=j}^{i−1} density(i−1, b): one more row of cells.
        let (mut row, mut above_low) = (0.0, 0.0);
        Self::from_nodes(
            grid,
            rest,
            |i, j, below| {
                row = density(i - 1, j) + if j + 1 == i { 0.0 } else { row };
                below + row
            },
            |i, edge| {
                above_low += once(i - 1);
                edge + above_low
            },
        )
    }

    /// Creates the map with `surface(i, j, E(i−1, j))` at node (i, j) and the virgin curve `virgin(i, E(i, 0))`. Visits
    /// the nodes row by row, and each row from the diagonal. Checks that both are monotone.
    pub(super) fn from_nodes(
        grid: Grid,
        rest: f64,
        mut surface: impl FnMut(usize, usize, f64) -> f64,
        mut virgin: impl FnMut(usize, f64) -> f64,
    ) -> Result<Self, Error> {
        const SURFACE: &str = "preisach surface";
        const VIRGIN: &str = "preisach virgin curve";
        let Grid { low, high, cells } = grid;
        finite("preisach.low", low)?;
        within("preisach.high", high, high > low, "above preisach.low")?;
        finite("preisach.rest", rest)?;
        if cells == 0 {
            return Err(Error::OutOfRange { name: "preisach.cells", must: "at least 1" });
        }
        if cells >= N {
            return Err(Error::Capacity { name: "preisach nodes", needed: cells.saturating_add(1), holds: N });
        }
        let width = (high - low) / cells as f64;
        let mut map = Self {
            nodes: [[T::ZERO; N]; N],
            first: [T::ZERO; N],
            cells,
            low: coefficient("preisach.low", low)?,
            width: coefficient("preisach.high", width)?,
            per_width: T::from_f64(1.0 / width),
            rest: coefficient("preisach.rest", rest)?,
        };
        // The previous row in f64 for any T: nodes are sums of many cells.
        let (mut last, mut last_first) = ([0.0; N], 0.0);
        let rows = map.nodes.iter_mut().zip(&mut map.first).enumerate().skip(1).take(cells);
        for (i, (row, first)) in rows {
            let (mut right, mut edge) = (0.0, 0.0);
            for (j, (slot, below)) in row.iter_mut().zip(&mut last).enumerate().take(i).rev() {
                let e = surface(i, j, *below);
                let wrong = |must| Err(Error::Node { name: SURFACE, alpha: i, beta: j, must });
                if !T::from_f64(e).is_finite() {
                    return wrong("be a finite number");
                }
                if e < *below {
                    return wrong("not be below the previous node in alpha");
                }
                if e < right {
                    return wrong("not be below the next node in beta");
                }
                (*slot, *below) = (T::from_f64(e), e);
                (right, edge) = (e, e);
            }
            let e = virgin(i, edge);
            let finite = T::from_f64(e).is_finite();
            if !finite || e < last_first {
                let must = if finite { "not be below the previous node" } else { "be a finite number" };
                return Err(Error::Node { name: VIRGIN, alpha: i, beta: 0, must });
            }
            (*first, last_first) = (T::from_f64(e), e);
        }
        Ok(map)
    }

    #[inline]
    pub(super) fn node(&self, i: usize, j: usize) -> T {
        self.nodes.get(i).and_then(|row| row.get(j)).copied().unwrap_or(T::ZERO)
    }

    #[inline]
    fn first_node(&self, i: usize) -> T {
        self.first.get(i).copied().unwrap_or(T::ZERO)
    }

    /// Returns the number of cells along one edge.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// Returns the input at node `i` \[V\].
    #[inline]
    pub(super) fn at(&self, i: usize) -> T {
        self.low + self.width * T::from_f64(i as f64)
    }

    /// Returns the highest input of the grid \[V\].
    #[inline]
    pub(super) fn high(&self) -> T {
        self.at(self.cells)
    }

    /// Returns the position of `u` on the grid. Inputs outside are moved to its edge.
    #[inline]
    pub fn locate(&self, u: T) -> Cell<T> {
        let x = (u - self.low) * self.per_width;
        let index = x.index(self.cells - 1);
        let fraction = (x - T::from_f64(index as f64)).at_least(T::ZERO).at_most(T::ONE);
        Cell { index, fraction }
    }

    /// Returns `u` minus the nearest input on the grid \[V\].
    #[inline]
    fn beyond(&self, u: T) -> T {
        let high = self.high();
        if u > high {
            u - high
        } else if u < self.low {
            u - self.low
        } else {
            T::ZERO
        }
    }

    /// Returns the reversible slope of diagonal cell `i` \[output unit/V\].
    #[inline]
    pub(super) fn reversible(&self, i: usize) -> T {
        self.node(i + 1, i) * self.per_width
    }

    /// Calls `f(i, j, weight)` for the nodes whose weighted sum is `E(α, β)`, for α ≥ β on the grid.
    #[inline]
    pub fn interpolate(alpha: Cell<T>, beta: Cell<T>, mut f: impl FnMut(usize, usize, T)) {
        let (i, j, s, t) = (alpha.index, beta.index, alpha.fraction, beta.fraction);
        if i == j {
            f(i + 1, i, s - t);
        } else {
            f(i, j, (T::ONE - s) * (T::ONE - t));
            f(i + 1, j, s * (T::ONE - t));
            f(i, j + 1, (T::ONE - s) * t);
            f(i + 1, j + 1, s * t);
        }
    }

    /// Returns the map at (α, β), α ≥ β \[output unit\].
    #[inline]
    pub fn value(&self, alpha: T, beta: T) -> T {
        let mut e = T::ZERO;
        Self::interpolate(self.locate(alpha), self.locate(beta), |i, j, w| e += w * self.node(i, j));
        e + self.outside(alpha) - self.outside(beta)
    }

    /// Returns the virgin curve at `u` \[output unit\].
    #[inline]
    pub fn virgin(&self, u: T) -> T {
        let c = self.locate(u);
        let (a, b) = (self.first_node(c.index), self.first_node(c.index + 1));
        a + c.fraction * (b - a) + self.outside(u)
    }

    #[inline]
    fn outside(&self, u: T) -> T {
        let d = self.beyond(u);
        let edge = if d > T::ZERO { self.cells - 1 } else { 0 };
        d * self.reversible(edge)
    }

    /// Returns the output at `u` on the branch that started at `from` (input, output), or on the virgin curve.
    #[inline]
    pub(super) fn on_branch(&self, from: Option<(T, T)>, rising: bool, u: T) -> T {
        match (from, rising) {
            (None, _) => self.virgin(u),
            (Some((from, y)), true) => y + self.value(u, from),
            (Some((from, y)), false) => y - self.value(from, u),
        }
    }

    /// Returns the minimum slope of any branch on the grid, and the minimum ratio of a slope to an earlier slope of the
    /// same branch (1 if the slope of every branch only rises, which is nearly so for piezoceramics).
    ///
    /// A branch that starts inside a cell has slopes between those of the two nodes, so the nodes determine both.
    pub(super) fn slopes(&self) -> (T, T) {
        let mut all = Slopes { least: self.first_node(1), ratio: T::ONE, steepest: T::ZERO };
        for i in 0..self.cells {
            all.next(self.first_node(i + 1) - self.first_node(i));
        }
        for k in 0..=self.cells {
            // From node k upwards, after the rest of the diagonal cell below it; then downwards in the same way.
            all.begin(if k > 0 { self.node(k, k - 1) } else { T::ZERO });
            for i in k..self.cells {
                all.next(self.node(i + 1, k) - self.node(i, k));
            }
            all.begin(if k < self.cells { self.node(k + 1, k) } else { T::ZERO });
            for j in (0..k).rev() {
                all.next(self.node(k, j) - self.node(k, j + 1));
            }
        }
        (all.least * self.per_width, all.ratio)
    }
}

/// Statistics of the increments of branches from node to node.
struct Slopes<T> {
    least: T,
    ratio: T,
    steepest: T,
}

impl<T: Real> Slopes<T> {
    fn begin(&mut self, first: T) {
        self.steepest = first;
    }

    fn next(&mut self, rise: T) {
        self.least = self.least.at_most(rise);
        self.steepest = self.steepest.at_least(rise);
        // A branch that is flat everywhere has no ratio. Then `least` is zero.
        if self.steepest > T::ZERO {
            self.ratio = self.ratio.at_most(rise / self.steepest);
        }
    }
}
