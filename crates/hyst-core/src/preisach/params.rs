//! Parameters of a Preisach operator.

use super::{Everett, Grid};
use crate::{Build, Error, Meta, Params, Real};

/// Relay densities on a triangle of `cells` intervals per edge. `L` is any list of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PreisachParams<L> {
    /// Lowest input of the grid \[u\].
    pub low: f64,
    /// Highest input of the grid \[u\].
    pub high: f64,
    /// Intervals along one edge.
    pub cells: usize,
    /// Input at which the virgin memory was left \[u\].
    pub rest: f64,
    /// Output gained by each cell \[y\]: α interval by α interval, β ≤ α, cell (a, b) at a (a + 1)/2 + b.
    pub density: L,
    /// Output gained once per α interval by relays that never switch back \[y\].
    pub once: L,
}

/// Place of the cell with α interval `a` and β interval `b ≤ a` in a list of the triangle's cells.
pub fn cell_index(a: usize, b: usize) -> usize {
    a.saturating_mul(a.saturating_add(1)) / 2 + b
}

impl<L: AsMut<[f64]>> Params for PreisachParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const INF: f64 = f64::INFINITY;
        f(&Meta { name: "low", unit: "u", lower: -INF, upper: INF }, &mut self.low);
        f(&Meta { name: "high", unit: "u", lower: -INF, upper: INF }, &mut self.high);
        f(&Meta { name: "rest", unit: "u", lower: -INF, upper: INF }, &mut self.rest);
        for d in self.density.as_mut() {
            f(&Meta { name: "density", unit: "y", lower: 0.0, upper: INF }, d);
        }
        for d in self.once.as_mut() {
            f(&Meta { name: "once", unit: "y", lower: 0.0, upper: INF }, d);
        }
    }
}

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<Everett<T, N>> for PreisachParams<L> {
    type Context = ();
    fn build(&self, (): &()) -> Result<Everett<T, N>, Error> {
        let (density, once) = (self.density.as_ref(), self.once.as_ref());
        if density.len() != cell_index(self.cells, 0) || once.len() != self.cells {
            return Err(Error::Lengths("preisach.density and preisach.once, and what preisach.cells asks for,"));
        }
        let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(0.0);
        let grid = Grid { low: self.low, high: self.high, cells: self.cells };
        Everett::new(grid, self.rest, |a, b| at(density, cell_index(a, b)), |a| at(once, a))
    }
}
