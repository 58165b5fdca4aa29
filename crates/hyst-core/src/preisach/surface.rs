//! Everett maps from tables of Everett values, for example from first-order descent curves.

use super::{Everett, Grid};
use crate::{Error, Real};

/// A rule for the nodes of an Everett surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceRule {
    /// The value is finite.
    Finite,
    /// `E(αᵢ, βⱼ) ≥ E(αᵢ₋₁, βⱼ)`: rising branches rise. E = 0 on the diagonal, so E is also not negative.
    RisesWithAlpha,
    /// `E(αᵢ, βⱼ) ≥ E(αᵢ, βⱼ₊₁)`: falling branches fall.
    FallsWithBeta,
}

/// A node of a table that violates a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// Index i of the node along α.
    pub alpha: usize,
    /// Index j of the node along β.
    pub beta: usize,
    /// The rule that it violates against its neighbour (i − 1, j) or (i, j + 1).
    pub rule: SurfaceRule,
    /// Amount of the violation \[output unit\]; infinite for a non-finite value.
    pub by: f64,
}

/// Calls `visit` for every violation in the table `surface(i, j)`, 0 ≤ j < i ≤ `cells`, row by row, and in each row
/// from the diagonal. A node may violate two rules. A value is not compared with a non-finite neighbour.
///
/// This is the check of [`Everett::from_surface`], but it does not stop at the first violation. A measured table is
/// valid if there is no violation (Schirrer et al., section 4.3: positive and monotone).
pub fn surface_violations(cells: usize, surface: impl Fn(usize, usize) -> f64, mut visit: impl FnMut(Violation)) {
    for alpha in 1..=cells {
        for beta in (0..alpha).rev() {
            let at = |i: usize, j: usize| if i > j { surface(i, j) } else { 0.0 };
            let e = surface(alpha, beta);
            let mut report = |rule, by| visit(Violation { alpha, beta, rule, by });
            if !e.is_finite() {
                report(SurfaceRule::Finite, f64::INFINITY);
                continue;
            }
            let (before, after) = (at(alpha - 1, beta), at(alpha, beta + 1));
            if before.is_finite() && e < before {
                report(SurfaceRule::RisesWithAlpha, before - e);
            }
            if after.is_finite() && e < after {
                report(SurfaceRule::FallsWithBeta, after - e);
            }
        }
    }
}

impl<T: Real, const N: usize> Everett<T, N> {
    /// Creates the map from Everett values at the nodes: `surface(i, j) = E(αᵢ, βⱼ)` for 0 ≤ j < i ≤ cells, with node k
    /// at `low + k (high − low) / cells`. `virgin(i)` is the increase of the output from rest at the low end up to αᵢ.
    ///
    /// A first-order descent curve that rises to αᵢ (output f_α) and falls to βⱼ (output f_αβ) gives `f_α − f_αβ`: this
    /// map contains the whole change of the output. Schirrer et al. (eq. 2) sum relays of ±1 and define
    /// `E = ½ (f_α − f_αβ)`; multiply such values by 2. The density of eq. 4 is then the weight of a cell,
    /// `E(i+1, j) − E(i, j) − E(i+1, j+1) + E(i, j+1)`, divided by its area. In measured tables it may be negative in
    /// some cells. That is valid if the surface is monotone.
    ///
    /// ```
    /// use hyst_core::{Env, Everett, Grid, Stage};
    /// // Two descents, from 50 V (output 4) to 0 V and from 100 V (output 10) to 50 and 0 V.
    /// let grid = Grid { low: 0.0, high: 100.0, cells: 2 };
    /// let top = [0.0, 4.0, 10.0];
    /// let after = [[0.0, 0.0], [0.5, 0.0], [1.0, 6.0]];
    /// let map = Everett::<f64, 3>::from_surface(grid, 0.0, |i, j| top[i] - after[i][j], |i| top[i])?;
    /// let (mut state, env) = (map.state(), Env::default());
    /// map.reset(&mut state, &env, 0.0);
    /// assert_eq!(map.step(&mut state, &env, 100.0), 10.0);
    /// assert_eq!(map.step(&mut state, &env, 50.0), 6.0);
    /// # Ok::<(), hyst_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// If the grid is empty or larger than `N − 1` cells. [`Error::Node`] for the first node whose value is not finite,
    /// does not rise with α or does not fall with β ([`surface_violations`] visits all of them), or where the virgin
    /// curve falls.
    pub fn from_surface(
        grid: Grid,
        rest: f64,
        surface: impl Fn(usize, usize) -> f64,
        virgin: impl Fn(usize) -> f64,
    ) -> Result<Self, Error> {
        Self::from_nodes(grid, rest, |i, j, _| surface(i, j), |i, _| virgin(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Env, Invert, Stage};
    use proptest::prelude::*;
    use std::boxed::Box;
    use std::vec::Vec;

    const CELLS: usize = 8;
    const GRID: Grid = Grid { low: 0.0, high: 80.0, cells: CELLS };
    type Map = Everett<f64, 9>;

    /// A smooth surface in closed form: relays of density 1 (±1 normalisation) over (α, β), plus a reversible slope.
    fn closed_form(alpha: f64, beta: f64) -> f64 {
        let d = alpha - beta;
        2.0 * (0.5 * d * d) + 3.0 * d
    }

    fn node(k: usize) -> f64 {
        10.0 * k as f64
    }

    #[test]
    fn map_from_descents_of_a_relay_bank_equals_the_relay_bank() {
        // Relays of ±1 on a fine grid of (α, β), switched one by one, without an Everett map.
        let fine = 160;
        let width = 80.0 / f64::from(fine);
        let centre = |k: i32| (f64::from(k) + 0.5) * width;
        let output = |u: &[f64]| {
            let mut sum = 0.0;
            for a in 0..fine {
                for b in 0..=a {
                    let mut up = -1.0;
                    for u in u {
                        if *u >= centre(a) {
                            up = 1.0;
                        } else if *u <= centre(b) {
                            up = -1.0;
                        }
                    }
                    // Uniform density. On the diagonal there is half a cell.
                    sum += up * width * width * if a == b { 0.5 } else { 1.0 };
                }
            }
            sum
        };
        let from_relays = |i: usize, j: usize| {
            let (top, bottom) = (output(&[0.0, node(i)]), output(&[0.0, node(i), node(j)]));
            // Eq. 2 of the paper, then the factor 2 of this map.
            let paper = 0.5 * (top - bottom);
            2.0 * paper
        };
        let map = Map::from_surface(GRID, 0.0, from_relays, |i| from_relays(i, 0)).unwrap();
        let (mut s, e) = (map.state(), Env::default());
        map.reset(&mut s, &e, 0.0);
        let u = [0.0, 70.0, 20.0, 50.0, 30.0, 60.0, 10.0, 70.0, 40.0, 80.0, 0.0];
        let zero = output(&[0.0]);
        for k in 1..u.len() {
            let y = map.step(&mut s, &e, u[k]);
            let expected = output(&u[..=k]) - zero;
            assert!((y - expected).abs() < 1e-9 * 6400.0, "{y} {expected}");
        }
    }

    #[test]
    fn the_first_wrong_node_is_named_and_all_are_visited() {
        // (4, 1) is below (3, 1), and (4, 0) violates no rule; (5, 4) is negative; (6, 2) is not finite.
        let broken = |i: usize, j: usize| match (i, j) {
            (4, 1) => closed_form(node(3), node(1)) - 0.5,
            (5, 4) => -0.25,
            (6, 2) => f64::NAN,
            _ => closed_form(node(i), node(j)),
        };
        let built = Map::from_surface(GRID, 0.0, broken, |i| closed_form(node(i), 0.0));
        assert!(matches!(built, Err(Error::Node { name: "preisach surface", alpha: 4, beta: 1, .. })), "{built:?}");
        assert_eq!(
            std::format!("{}", built.unwrap_err()),
            "preisach surface: node (α 4, β 1) must not be below the previous node in alpha"
        );
        let mut seen = Vec::new();
        surface_violations(CELLS, broken, |v| seen.push((v.alpha, v.beta, v.rule, v.by)));
        // E(4, 2) = 460 at a difference of 20 V, and E(3, 1) is equal, because the closed form depends on α − β.
        assert_eq!(
            seen,
            [
                (4, 1, SurfaceRule::RisesWithAlpha, 0.5),
                (4, 1, SurfaceRule::FallsWithBeta, 0.5),
                (5, 4, SurfaceRule::RisesWithAlpha, 0.25),
                (5, 4, SurfaceRule::FallsWithBeta, 0.25),
                (6, 2, SurfaceRule::Finite, f64::INFINITY),
            ]
        );
        let falling_virgin = Map::from_surface(
            GRID,
            0.0,
            |i, j| closed_form(node(i), node(j)),
            |i| if i == 3 { 1.0 } else { closed_form(node(i), 0.0) },
        );
        assert!(matches!(falling_virgin, Err(Error::Node { name: "preisach virgin curve", alpha: 3, .. })));
    }

    proptest! {
        /// Noise on the nodes makes some densities negative. The inverse is exact if the surface is monotone.
        #[test]
        fn inverse_is_exact_with_negative_densities(
            noise in prop::collection::vec(-0.45..0.45f64, 45),
            u in prop::collection::vec(0.0..80.0f64, 20..200),
        ) {
            // Differences between neighbours are at least 1 before the noise.
            let surface = |i: usize, j: usize| {
                let (i0, j0) = (i as f64, j as f64);
                (i0 - j0) * (1.0 + 0.05 * (i0 - j0)) + noise[i * (i - 1) / 2 + j]
            };
            let map = Box::new(Map::from_surface(GRID, 0.0, surface, |i| 1.1 * surface(i, 0) + i as f64).unwrap());
            let weight = |i: usize, j: usize| {
                let at = |i: usize, j: usize| if i > j { surface(i, j) } else { 0.0 };
                at(i + 1, j) - at(i, j) - at(i + 1, j + 1) + at(i, j + 1)
            };
            prop_assume!((2..CELLS).any(|i| (0..i - 1).any(|j| weight(i, j) < -0.05)));
            let inverse = map.invert().unwrap();
            let e = Env::default();
            let (mut f, mut s, mut i) = (map.state(), map.state(), inverse.state());
            map.reset(&mut f, &e, 0.0);
            map.reset(&mut s, &e, 0.0);
            inverse.reset(&mut i, &e, 0.0);
            for u in &u {
                let reference = map.step(&mut s, &e, *u);
                let drive = inverse.step(&mut i, &e, reference);
                prop_assert!((drive - u).abs() < 1e-9 * 80.0, "{drive} {u}");
                prop_assert!((map.step(&mut f, &e, drive) - reference).abs() < 1e-11 * 12.0);
            }
        }
    }

    #[test]
    fn a_flat_part_of_a_branch_has_no_inverse() {
        // A reversible slope everywhere, but relays of negative weight cancel it on one part of the branch from β = 0.
        let flat = |i: usize, j: usize| match (i, j) {
            (3, 0) => 2.2,
            (2, 0) => 2.2,
            _ => (i - j) as f64 * 1.1,
        };
        let map = Map::from_surface(GRID, 0.0, flat, |i| 2.0 * i as f64).unwrap();
        assert!(matches!(map.invert(), Err(Error::NotInvertible(why)) if why.contains("flat")));
    }
}
