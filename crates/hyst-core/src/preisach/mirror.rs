//! The mirror function of the dynamic Preisach model: the weight of a branch as a function of rate and change.

use crate::error::{coefficient, finite, within};
use crate::{Build, Error, Meta, Params, Real};

/// Parameters of a mirror function ξ(D, P): its values at the nodes of a uniform grid. `L` is any list of numbers.
///
/// Chen et al. use D = 2…16 V/ms in steps of 2 and P = −80…80 V in steps of 20
/// ([`on_printed_grid`](Self::on_printed_grid)); here D is in input units per *second*.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MirrorParams<L> {
    /// Lowest rate D of the grid \[u/s\], positive.
    pub rate_low: f64,
    /// Highest rate D of the grid \[u/s\].
    pub rate_high: f64,
    /// Number of nodes along D.
    pub rates: usize,
    /// Lowest change P of the grid \[u\]; negative for falling branches.
    pub change_low: f64,
    /// Highest change P of the grid \[u\].
    pub change_high: f64,
    /// Number of nodes along P.
    pub changes: usize,
    /// ξ at the nodes \[ratio\], positive: node (d, p) at index `d * changes + p`.
    pub weights: L,
}

impl<L> MirrorParams<L> {
    /// Returns parameters with these `weights` on the grid of Chen et al.: D = 2000, 4000 … 16000 V/s, P = −80, −60 …
    /// 80 V.
    pub const fn on_printed_grid(weights: L) -> Self {
        Self { rate_low: 2e3, rate_high: 16e3, rates: 8, change_low: -80.0, change_high: 80.0, changes: 9, weights }
    }
}

impl<L: AsMut<[f64]>> Params for MirrorParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        self.visit_as(["rate_low", "rate_high", "change_low", "change_high", "weights"], f);
    }
}

impl<L: AsMut<[f64]>> MirrorParams<L> {
    /// Visits the parameters with their paths in a larger model.
    pub(super) fn visit_as(
        &mut self,
        [rate_low, rate_high, change_low, change_high, weights]: [&'static str; 5],
        f: &mut dyn FnMut(&Meta, &mut f64),
    ) {
        let rate = |name| Meta { name, unit: "u/s", lower: 0.0, upper: f64::INFINITY };
        let change = |name| Meta { name, unit: "u", lower: f64::NEG_INFINITY, upper: f64::INFINITY };
        f(&rate(rate_low), &mut self.rate_low);
        f(&rate(rate_high), &mut self.rate_high);
        f(&change(change_low), &mut self.change_low);
        f(&change(change_high), &mut self.change_high);
        for w in self.weights.as_mut() {
            f(&Meta { name: weights, unit: "", lower: 0.0, upper: f64::INFINITY }, w);
        }
    }
}

/// One axis of a uniform grid.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Axis<T> {
    low: T,
    step: T,
    per_step: T,
    last: usize,
}

impl Axis<f64> {
    fn new(low: f64, high: f64, nodes: usize) -> Self {
        let last = nodes.saturating_sub(1);
        // An axis with one node is constant.
        let step = if last == 0 { 0.0 } else { (high - low) / last as f64 };
        Self { low, step, per_step: if step > 0.0 { 1.0 / step } else { 0.0 }, last }
    }

    fn cast<T: Real>(self) -> Axis<T> {
        let Self { low, step, per_step, last } = self;
        Axis { low: T::from_f64(low), step: T::from_f64(step), per_step: T::from_f64(per_step), last }
    }
}

impl<T: Real> Axis<T> {
    /// Returns the cell of `x` and the fraction of it below `x`; the edge for an `x` outside.
    #[inline]
    fn locate(&self, x: T) -> (usize, T) {
        let x = (x - self.low) * self.per_step;
        let index = x.index(self.last.saturating_sub(1));
        (index, (x - T::from_f64(index as f64)).at_least(T::ZERO).at_most(T::ONE))
    }

    fn at(&self, k: usize) -> T {
        self.low + self.step * T::from_f64(k as f64)
    }
}

/// The mirror function ξ(D, P) of Chen et al. (eq. 2): the ratio of the change of the output along a branch to that of
/// the classical Preisach model. It depends on the average rate D = |Δu/Δt| \[u/s\] and the change P = Δu \[u\] since
/// the start of the branch (eq. 3 and 4).
///
/// It is bilinear inside the cells of a uniform grid (eq. 20) of at most `R` rates by `C` changes. From D = 0 to the
/// first rate it is interpolated from ξ = 1, the classical model. Beyond the other edges it is constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror<T, const R: usize, const C: usize> {
    nodes: [[T; C]; R],
    rate: Axis<T>,
    change: Axis<T>,
    per_rate_low: T,
}

impl<T: Real, L: AsRef<[f64]>, const R: usize, const C: usize> Build<Mirror<T, R, C>> for MirrorParams<L> {
    type Context = ();

    /// # Errors
    /// As [`Mirror::from_fn`], or if the length of the list is not `rates × changes`.
    fn build(&self, (): &()) -> Result<Mirror<T, R, C>, Error> {
        let weights = self.weights.as_ref();
        if weights.len() != self.rates.saturating_mul(self.changes) {
            return Err(Error::Lengths("mirror.weights and mirror.rates × mirror.changes"));
        }
        let mut weights = weights.iter();
        Mirror::from_fn(self, |_, _| weights.next().copied().unwrap_or(f64::NAN))
    }
}

impl<T: Real, const R: usize, const C: usize> Mirror<T, R, C> {
    /// Creates the function on the grid of `params`, with ξ = `xi(D, P)` at its nodes, rate by rate.
    ///
    /// # Errors
    /// If the grid is not rising or larger than `R` by `C`, its first rate is not positive, or a value of ξ is not
    /// positive.
    pub fn from_fn<L>(params: &MirrorParams<L>, mut xi: impl FnMut(f64, f64) -> f64) -> Result<Self, Error> {
        let &MirrorParams { rate_low, rate_high, rates, change_low, change_high, changes, .. } = params;
        within("mirror.rate_low", rate_low, rate_low > 0.0, "positive")?;
        let rising = |low: f64, high: f64, nodes: usize| if nodes > 1 { high > low } else { high >= low };
        within("mirror.rate_high", rate_high, rising(rate_low, rate_high, rates), "above mirror.rate_low")?;
        finite("mirror.change_low", change_low)?;
        let ok = rising(change_low, change_high, changes);
        within("mirror.change_high", change_high, ok, "above mirror.change_low")?;
        for (name, nodes, holds) in [("mirror.rates", rates, R), ("mirror.changes", changes, C)] {
            if nodes == 0 {
                return Err(Error::OutOfRange { name, must: "at least 1" });
            }
            if nodes > holds {
                return Err(Error::Capacity { name, needed: nodes, holds });
            }
        }
        let (rate, change) = (Axis::new(rate_low, rate_high, rates), Axis::new(change_low, change_high, changes));
        let mut nodes = [[T::ONE; C]; R];
        for (d, row) in nodes.iter_mut().enumerate().take(rates) {
            for (p, slot) in row.iter_mut().enumerate().take(changes) {
                let w = xi(rate.at(d), change.at(p));
                *slot = coefficient("mirror.weights", within("mirror.weights", w, w > 0.0, "positive")?)?;
            }
        }
        Ok(Self { nodes, rate: rate.cast(), change: change.cast(), per_rate_low: T::from_f64(1.0 / rate_low) })
    }

    #[inline]
    fn node(&self, d: usize, p: usize) -> T {
        self.nodes.get(d).and_then(|row| row.get(p)).copied().unwrap_or(T::ONE)
    }

    /// Returns ξ at a rate D ≥ 0 \[u/s\] and a change P \[u\].
    #[inline]
    pub fn weight(&self, rate: T, change: T) -> T {
        let (p, t) = self.change.locate(change);
        // In the form a + t (b − a), so a mirror of ones is exactly one.
        let row = |d: usize| {
            let (a, b) = (self.node(d, p), self.node(d, p + 1));
            a + t * (b - a)
        };
        if rate < self.rate.low {
            T::ONE + rate * self.per_rate_low * (row(0) - T::ONE)
        } else {
            let (d, s) = self.rate.locate(rate);
            let (a, b) = (row(d), row(d + 1));
            a + s * (b - a)
        }
    }

    /// Returns minimum and maximum of ξ, including ξ = 1 at D = 0.
    pub fn range(&self) -> (T, T) {
        let mut range = (T::ONE, T::ONE);
        for row in self.nodes.iter().take(self.rate.last + 1) {
            for w in row.iter().take(self.change.last + 1) {
                range = (range.0.at_most(*w), range.1.at_least(*w));
            }
        }
        range
    }

    /// Returns the global minimum of `κ ξ + D ∂ξ/∂D + P ∂ξ/∂P`.
    ///
    /// On a branch that has lasted n samples of period h, D = |P| / (n h). As the input moves, (D, P) moves along a ray
    /// from the origin. For any n and h, `D ∂ξ/∂D + P ∂ξ/∂P` is |P| times the slope of ξ along the ray. With κ = 1 a
    /// positive result means that |P| ξ rises along every ray. Inside a cell the sum is bilinear like ξ. So its minimum
    /// is at a corner of a cell, and the result is exact.
    pub fn least_rise(&self, kappa: T) -> T {
        let (rates, changes) = (self.rate.last, self.change.last);
        // Row 0 is D = 0, row d + 1 is row d of the grid. ξ is constant beyond the last row and the outer columns.
        let row_at = |r: usize| if r == 0 { T::ZERO } else { self.rate.at(r - 1) };
        let at = |r: usize, c: usize| if r == 0 { T::ONE } else { self.node(r - 1, c) };
        let mut least = kappa;
        for r in 0..=rates + 1 {
            for c in 0..=changes {
                let (d, p, xi) = (row_at(r), self.change.at(c), at(r, c));
                // The slopes on both sides; zero beyond an edge.
                let slope = |there: T, distance: T| (there - xi) / distance;
                let below = if r > 0 { slope(at(r - 1, c), row_at(r - 1) - d) } else { T::ZERO };
                let above = if r <= rates { slope(at(r + 1, c), row_at(r + 1) - d) } else { T::ZERO };
                let left = if c > 0 { slope(at(r, c - 1), -self.change.step) } else { T::ZERO };
                let right = if c < changes { slope(at(r, c + 1), self.change.step) } else { T::ZERO };
                let by_rate = (d * below).at_most(d * above);
                let by_change = (p * left).at_most(p * right);
                least = least.at_most(kappa * xi + by_rate + by_change);
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const GRID: MirrorParams<()> = MirrorParams::on_printed_grid(());

    fn mirror(weights: &[f64]) -> Mirror<f64, 8, 9> {
        MirrorParams::on_printed_grid(weights).build(&()).unwrap()
    }

    #[test]
    fn an_axis_with_one_node_is_constant() {
        let params = MirrorParams {
            rate_low: 2e3,
            rate_high: 16e3,
            rates: 1,
            change_low: -80.0,
            change_high: 80.0,
            changes: 1,
            weights: [0.8],
        };
        let mirror: Mirror<f64, 1, 1> = params.build(&()).unwrap();
        for (d, p) in [(2e3, -80.0), (2e3, 80.0), (16e3, 80.0), (1e5, 0.0)] {
            assert_eq!(mirror.weight(d, p), 0.8);
        }
    }

    #[test]
    fn values_at_nodes_beyond_edges_and_below_the_first_rate() {
        let weights: Vec<f64> = (0..72).map(|k| 0.5 + 0.005 * f64::from(k * k % 71)).collect();
        let m = mirror(&weights);
        for d in 0..8 {
            for p in 0..9 {
                let (rate, change) = (2e3 * (d + 1) as f64, -80.0 + 20.0 * p as f64);
                let xi = weights[d * 9 + p];
                assert!((m.weight(rate, change) - xi).abs() < 1e-14);
                if d == 0 {
                    assert_eq!(m.weight(0.0, change), 1.0);
                    assert!((m.weight(500.0, change) - (1.0 + 0.25 * (xi - 1.0))).abs() < 1e-14);
                }
                if d == 7 {
                    assert!((m.weight(1e9, change) - xi).abs() < 1e-14);
                }
                if p == 0 || p == 8 {
                    assert!((m.weight(rate, 7.0 * change) - xi).abs() < 1e-14);
                }
            }
        }
    }

    proptest! {
        /// Eq. 20, with its four coefficients solved from the corners of the cell.
        #[test]
        fn weight_is_bilinear_inside_a_cell(w in prop::collection::vec(0.3..1.3f64, 72), d in 2e3..16e3f64, p in -80.0..80.0f64) {
            let m = mirror(&w);
            let (i, j) = (((d / 2e3) as usize - 1).min(6), (((p + 80.0) / 20.0) as usize).min(7));
            let (d0, p0) = (2e3 * (i + 1) as f64, -80.0 + 20.0 * j as f64);
            let at = |i: usize, j: usize| w[i * 9 + j];
            let a3 = (at(i + 1, j + 1) - at(i + 1, j) - at(i, j + 1) + at(i, j)) / (2e3 * 20.0);
            let a1 = (at(i + 1, j) - at(i, j)) / 2e3 - a3 * p0;
            let a2 = (at(i, j + 1) - at(i, j)) / 20.0 - a3 * d0;
            let a0 = at(i, j) - a1 * d0 - a2 * p0 - a3 * d0 * p0;
            prop_assert!((m.weight(d, p) - (a0 + a1 * d + a2 * p + a3 * d * p)).abs() < 1e-12);
        }

        /// `least_rise` is below every finite difference along a ray, and close to the smallest.
        #[test]
        fn least_rise_is_the_minimum(w in prop::collection::vec(0.5..1.2f64, 72), kappa in 0.3..1.0f64) {
            let m = mirror(&w);
            let bound = m.least_rise(kappa);
            let mut least = f64::INFINITY;
            for i in 0..=190 {
                for j in -100..=100 {
                    let (d, p) = (f64::from(i) * 100.0, f64::from(j));
                    for by in [1e-6, -1e-6] {
                        let slope = (m.weight(d * (1.0 + by), p * (1.0 + by)) - m.weight(d, p)) / by;
                        least = least.min(kappa * m.weight(d, p) + slope);
                    }
                }
            }
            // The grid of rays contains every corner, so the two agree to the error of the difference quotient.
            prop_assert!(bound <= least + 1e-4, "{bound} {least}");
            prop_assert!(bound >= least - 0.3, "{bound} {least}");
        }
    }

    #[test]
    fn wrong_parameters_are_named() {
        let good = MirrorParams { weights: [0.9; 72].to_vec(), ..copy() };
        let bad = |change: &dyn Fn(&mut MirrorParams<Vec<f64>>)| {
            let mut params = good.clone();
            change(&mut params);
            let built: Result<Mirror<f64, 8, 9>, _> = params.build(&());
            built.unwrap_err()
        };
        assert!(matches!(bad(&|p| p.rate_low = 0.0), Error::OutOfRange { name: "mirror.rate_low", .. }));
        assert!(matches!(bad(&|p| p.change_high = -80.0), Error::OutOfRange { name: "mirror.change_high", .. }));
        assert!(matches!(
            bad(&|p| (p.rates, p.weights) = (9, std::vec![0.9; 81])),
            Error::Capacity { name: "mirror.rates", .. }
        ));
        assert!(matches!(
            bad(&|p| (p.changes, p.weights) = (0, Vec::new())),
            Error::OutOfRange { name: "mirror.changes", .. }
        ));
        assert!(matches!(bad(&|p| p.weights[5] = 0.0), Error::OutOfRange { name: "mirror.weights", .. }));
        assert!(matches!(bad(&|p| p.weights[5] = f64::NAN), Error::NonFinite("mirror.weights")));
        assert!(matches!(
            bad(&|p| {
                p.weights.pop();
            }),
            Error::Lengths(_)
        ));
    }

    fn copy() -> MirrorParams<Vec<f64>> {
        let MirrorParams { rate_low, rate_high, rates, change_low, change_high, changes, .. } = GRID;
        MirrorParams { rate_low, rate_high, rates, change_low, change_high, changes, weights: Vec::new() }
    }
}
