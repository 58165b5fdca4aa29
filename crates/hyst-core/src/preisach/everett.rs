//! The Everett map on a uniform grid.

use crate::error::{finite, within};
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

/// Where an input lies on a grid: `cell` and the fraction of it that lies below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell<T> {
    /// Index of the cell.
    pub index: usize,
    /// Fraction of the cell below the input, 0 to 1.
    pub fraction: T,
}

/// Everett map of a Preisach operator: `E(α, β) ≥ 0` is what the output gains when the input rises
/// monotonically from β to α, and loses when it falls from α to β, on any branch that begins there.
///
/// Between nodes the map is bilinear (cells of constant relay density), in the triangles on the
/// diagonal linear in α − β (relays without width: the reversible part). `first[i]` is the virgin
/// curve: what the output gains from rest at the low end up to node i. It lies above `E(αᵢ, low)`,
/// because some relays switch up once and stay up as long as the input does not go below `low`.
///
/// Nodes: `N` must be the number of cells + 1 at least. Outside the grid the map continues with the
/// reversible slope of the outermost diagonal cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Everett<T, const N: usize> {
    pub(super) nodes: [[T; N]; N],
    pub(super) first: [T; N],
    pub(super) cells: usize,
    pub(super) low: T,
    pub(super) width: T,
    per_width: T,
    pub(super) rest: T,
}

impl<T: Real, const N: usize> Everett<T, N> {
    /// From relay densities. `density(a, b)`, b ≤ a: output gained by all relays of the cell with α
    /// in grid interval a and β in interval b; `once(a)`: by those with α in interval a and β below
    /// the grid. `rest` is the input at which the virgin memory was left \[V\]: relays that straddle
    /// it with their centre below are up.
    ///
    /// # Errors
    /// If the grid is empty, larger than `N − 1` cells, or a density is negative or not finite.
    pub fn new(
        grid: Grid,
        rest: f64,
        mut density: impl FnMut(usize, usize) -> f64,
        mut once: impl FnMut(usize) -> f64,
    ) -> Result<Self, Error> {
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
            low: T::from_f64(low),
            width: T::from_f64(width),
            per_width: T::from_f64(1.0 / width),
            rest: T::from_f64(rest),
        };
        let check = |d: f64| within("preisach density", d, d >= 0.0, "zero or positive");
        // E(i, j) = E(i−1, j) + Σ_{b=j}^{i−1} density(i−1, b): one more row of cells.
        let mut above_low = 0.0;
        for i in 1..=cells {
            let mut row = 0.0;
            for j in (0..i).rev() {
                row += check(density(i - 1, j))?;
                let below = map.node(i - 1, j).to_f64();
                map.set(i, j, below + row);
            }
            above_low += check(once(i - 1))?;
            let e = map.node(i, 0).to_f64() + above_low;
            if let Some(f) = map.first.get_mut(i) {
                *f = T::from_f64(e);
            }
        }
        Ok(map)
    }

    fn set(&mut self, i: usize, j: usize, value: f64) {
        if let Some(slot) = self.nodes.get_mut(i).and_then(|row| row.get_mut(j)) {
            *slot = T::from_f64(value);
        }
    }

    #[inline]
    pub(super) fn node(&self, i: usize, j: usize) -> T {
        self.nodes.get(i).and_then(|row| row.get(j)).copied().unwrap_or(T::ZERO)
    }

    #[inline]
    pub(super) fn first_node(&self, i: usize) -> T {
        self.first.get(i).copied().unwrap_or(T::ZERO)
    }

    /// Number of cells along one edge.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// Voltage of node `i` \[V\].
    #[inline]
    pub(super) fn at(&self, i: usize) -> T {
        self.low + self.width * T::from_f64(i as f64)
    }

    /// Where `u` lies on the grid; inputs outside lie on its edge.
    #[inline]
    pub fn locate(&self, u: T) -> Cell<T> {
        let x = (u - self.low) * self.per_width;
        let index = x.index(self.cells - 1);
        let fraction = (x - T::from_f64(index as f64)).at_least(T::ZERO).at_most(T::ONE);
        Cell { index, fraction }
    }

    /// What lies outside the grid: `u` minus the nearest input on it \[V\].
    #[inline]
    fn beyond(&self, u: T) -> T {
        let high = self.at(self.cells);
        if u > high {
            u - high
        } else if u < self.low {
            u - self.low
        } else {
            T::ZERO
        }
    }

    /// Reversible slope of diagonal cell `i` \[output unit/V\].
    #[inline]
    pub(super) fn reversible(&self, i: usize) -> T {
        self.node(i + 1, i) * self.per_width
    }

    /// Calls `f(i, j, weight)` for the nodes whose weighted sum is `E(α, β)`, α ≥ β on the grid.
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

    /// The map at (α, β), α ≥ β \[output unit\].
    #[inline]
    pub fn value(&self, alpha: T, beta: T) -> T {
        let mut e = T::ZERO;
        Self::interpolate(self.locate(alpha), self.locate(beta), |i, j, w| e += w * self.node(i, j));
        e + self.outside(alpha) - self.outside(beta)
    }

    /// The virgin curve at `u` \[output unit\].
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
}
