//! Parameters of a Preisach operator, as stored in files.

use super::{Everett, Grid};
use crate::{Build, Error, Meta, Params, Real};

/// Parameters of the classical Preisach operator: relay weights on a triangle. `L` is any list of numbers: a vector, an
/// array, a slice.
///
/// ```
/// use hyst_core::{Build, Env, Everett, PreisachParams, Stage};
/// let density: &[f64] = &[4.0, 1.0, 4.0];
/// let params = PreisachParams { low: 0.0, high: 100.0, cells: 2, rest: 0.0, density, once: &[0.5, 0.5] };
/// let map: Everett<f64, 3> = params.build(&())?;
/// let (mut state, env) = (map.state(), Env::default());
/// map.reset(&mut state, &env, 0.0);
/// assert_eq!(map.step(&mut state, &env, 100.0), 10.0);
/// assert_eq!(map.step(&mut state, &env, 50.0), 6.0);
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PreisachParams<L> {
    /// Lowest input of the grid \[u\].
    pub low: f64,
    /// Highest input of the grid \[u\].
    pub high: f64,
    /// Number of cells along one edge of the triangle.
    pub cells: usize,
    /// Input at rest with virgin memory \[u\].
    pub rest: f64,
    /// Output of the relays of each cell \[y\]: α interval by α interval, β ≤ α, cell (a, b) at
    /// [`preisach_cell`]`(a, b)`.
    pub density: L,
    /// Output of the relays that never switch back, per α interval \[y\].
    pub once: L,
}

/// Returns the index of the cell with α in grid interval `a` and β in interval `b ≤ a` in the list of the cells.
pub fn preisach_cell(a: usize, b: usize) -> usize {
    a * (a + 1) / 2 + b
}

impl<L: AsMut<[f64]>> Params for PreisachParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        self.visit_as(["low", "high", "rest", "density", "once"], f);
    }
}

impl<L: AsMut<[f64]>> PreisachParams<L> {
    /// Visits the parameters with their paths in a larger model.
    pub(super) fn visit_as(
        &mut self,
        [low, high, rest, density, once]: [&'static str; 5],
        f: &mut dyn FnMut(&Meta, &mut f64),
    ) {
        let input = |name| Meta { name, unit: "u", lower: f64::NEG_INFINITY, upper: f64::INFINITY };
        f(&input(low), &mut self.low);
        f(&input(high), &mut self.high);
        f(&input(rest), &mut self.rest);
        for d in self.density.as_mut() {
            f(&Meta { name: density, unit: "y", lower: 0.0, upper: f64::INFINITY }, d);
        }
        for d in self.once.as_mut() {
            f(&Meta { name: once, unit: "y", lower: 0.0, upper: f64::INFINITY }, d);
        }
    }
}

impl<L> PreisachParams<L> {
    /// Returns the input grid.
    pub fn grid(&self) -> Grid {
        Grid { low: self.low, high: self.high, cells: self.cells }
    }

    /// Rejects lists whose lengths do not match `cells`.
    fn lengths(&self, density: usize, once: usize) -> Result<(), Error> {
        let needed = self.cells.saturating_mul(self.cells.saturating_add(1)) / 2;
        if density != needed || once != self.cells {
            return Err(Error::Lengths("preisach.density or preisach.once and the triangle of preisach.cells"));
        }
        Ok(())
    }
}

impl<L: AsMut<[f64]>> PreisachParams<L> {
    /// Sets the weights from a table of Everett values, `surface(i, j) = E(αᵢ, βⱼ)` and `virgin(i)` as for
    /// [`Everett::from_surface`]. The table is checked when the operator is built.
    ///
    /// # Errors
    /// If the lengths of the lists do not match `cells`.
    pub fn set_surface(
        &mut self,
        surface: impl Fn(usize, usize) -> f64,
        virgin: impl Fn(usize) -> f64,
    ) -> Result<(), Error> {
        let (density, once) = (self.density.as_mut().len(), self.once.as_mut().len());
        self.lengths(density, once)?;
        let at = |i: usize, j: usize| if i > j { surface(i, j) } else { 0.0 };
        let mut slots = self.density.as_mut().iter_mut();
        for a in 0..self.cells {
            for (b, slot) in slots.by_ref().take(a + 1).enumerate() {
                *slot = (at(a + 1, b) - at(a, b)) - (at(a + 1, b + 1) - at(a, b + 1));
            }
        }
        let first = |i: usize| if i > 0 { virgin(i) - at(i, 0) } else { 0.0 };
        for (a, slot) in self.once.as_mut().iter_mut().enumerate() {
            *slot = first(a + 1) - first(a);
        }
        Ok(())
    }
}

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<Everett<T, N>> for PreisachParams<L> {
    type Context = ();

    /// # Errors
    /// As [`Everett::new`], or if the lengths of the lists do not match `cells`.
    fn build(&self, (): &()) -> Result<Everett<T, N>, Error> {
        let (density, once) = (self.density.as_ref(), self.once.as_ref());
        self.lengths(density.len(), once.len())?;
        // Both lists have the length of the grid. NaN for an index beyond them would be rejected.
        let at = |list: &[f64], k: usize| list.get(k).copied().unwrap_or(f64::NAN);
        Everett::new(self.grid(), self.rest, |a, b| at(density, preisach_cell(a, b)), |a| at(once, a))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;
    use std::vec::Vec;

    #[test]
    fn lists_of_other_lengths_are_rejected() {
        let params = PreisachParams { low: 0.0, high: 1.0, cells: 2, rest: 0.0, density: &[1.0, 1.0][..], once: &[] };
        let built: Result<Everett<f64, 4>, _> = params.build(&());
        assert!(matches!(built, Err(Error::Lengths(_))));
        let huge = PreisachParams { cells: usize::MAX, ..params };
        let built: Result<Everett<f64, 4>, _> = huge.build(&());
        assert!(built.is_err());
    }

    #[test]
    fn a_table_is_reproduced_by_the_parameters() {
        let cells = 5;
        let surface =
            |i: usize, j: usize| ((i - j) as f64) * (2.0 + 0.1 * i as f64 - 0.05 * j as f64) + (i as f64).sqrt();
        let virgin = |i: usize| surface(i, 0) + 0.3 * i as f64;
        let mut params =
            PreisachParams { low: -2.0, high: 3.0, cells, rest: 0.0, density: vec![0.0; 15], once: vec![0.0; 5] };
        params.set_surface(surface, virgin).unwrap();
        let from_params: Everett<f64, 6> = params.build(&()).unwrap();
        let direct = Everett::<f64, 6>::from_surface(params.grid(), 0.0, surface, virgin).unwrap();
        for i in 0..=cells {
            let alpha = -2.0 + i as f64;
            assert!((from_params.virgin(alpha) - direct.virgin(alpha)).abs() < 1e-13);
            for j in 0..i {
                let beta = -2.0 + j as f64;
                assert!((from_params.value(alpha, beta) - surface(i, j)).abs() < 1e-13);
                assert_eq!(direct.value(alpha, beta), surface(i, j));
            }
        }
    }

    #[test]
    fn every_number_is_visited_once() {
        let mut params =
            PreisachParams { low: 0.0, high: 1.0, cells: 2, rest: 0.0, density: vec![1.0; 3], once: vec![0.0; 2] };
        let mut names = Vec::new();
        params.visit(&mut |m, _| names.push(m.name));
        assert_eq!(names, ["low", "high", "rest", "density", "density", "density", "once", "once"]);
    }
}
