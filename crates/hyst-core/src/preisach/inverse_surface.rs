//! The inverse Everett surface: an approximate inverse in the form of a Preisach operator.

use super::{Everett, Grid, PreisachState};
use crate::{Env, Error, Invert, Real, Stage};

/// Approximate inverse of a Preisach operator: the same recursion on an Everett map over *outputs* (Schirrer et al.,
/// eq. 5; Chen et al., eq. 23 and 24).
///
/// `E_inv(a, b) = u_a − u_ab`: the input rises from the low end of the grid until the output is a (input u_a), then
/// falls until it is b (input u_ab). There is no factor ½ as in eq. 2 of the paper; see [`Everett::from_surface`].
///
/// Minor loops of a Preisach operator between two inputs are congruent, but those between two outputs are not.
/// Therefore its inverse is not a Preisach operator. At the nodes of the table the inverse surface is exact on the
/// first rise and on the descents that define it. Inside the major loop it is approximate. RMSE of the output on random
/// minor loops, relative to the span: 0.9 % with relays near one point of the triangle; 1.8 % with a density that grows
/// by a factor of e⁶ along the diagonal; 0.02 %, the resolution of 50 cells, if the density depends only on α − β (then
/// the operator and its inverse are Prandtl-Ishlinskii operators). [`EverettInverse`](super::EverettInverse) is exact;
/// this one is for comparison.
///
/// ```
/// use hyst_core::{Env, Everett, Grid, InverseSurface, Stage};
/// let grid = Grid { low: 0.0, high: 100.0, cells: 20 };
/// let map = Everett::<f64, 21>::new(grid, 0.0, |a, b| if a == b { 0.5 } else { 0.02 }, |_| 0.0)?;
/// let inverse = InverseSurface::<f64, 41>::new(&map, 40)?;
/// let (mut forward, mut backward, env) = (map.state(), inverse.state(), Env::default());
/// map.reset(&mut forward, &env, 0.0);
/// inverse.reset(&mut backward, &env, 0.0);
/// let drive = inverse.step(&mut backward, &env, 7.0);
/// assert!((map.step(&mut forward, &env, drive) - 7.0).abs() < 0.01);
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct InverseSurface<T, const N: usize> {
    map: Everett<T, N>,
    /// The input at rest \[V\]. The map gives the difference to it.
    rest: T,
}

impl<T: Real, const N: usize> InverseSurface<T, N> {
    /// Computes the inverse surface from the descent curves of the forward map, with `cells` cells between the outputs
    /// at its lowest and its highest input. `forward` may have another number of nodes.
    ///
    /// # Errors
    /// [`Error::NotInvertible`] as [`Everett::invert`]. Also if there are no cells or more than `N − 1`.
    /// [`Error::Node`] if the inverse table is not monotone, which negative densities can cause.
    pub fn new<const M: usize>(forward: &Everett<T, M>, cells: usize) -> Result<Self, Error> {
        let exact = forward.invert()?;
        let env = Env::default();
        let mut at_rest = forward.state();
        forward.reset(&mut at_rest, &env, forward.rest);
        let top = forward.virgin(forward.high()).to_f64();
        let output = |k: usize| T::from_f64(top * k as f64 / cells as f64);
        // Every relay down, the input at the low end.
        let rise = |to: usize| {
            let mut s = PreisachState::at_low_end(forward);
            let u = exact.step(&mut s, &env, output(to));
            (s, u)
        };
        let descent = |i: usize, j: usize| {
            let (mut s, u) = rise(i);
            u.to_f64() - exact.step(&mut s, &env, output(j)).to_f64()
        };
        let first = |i: usize| rise(i).1.to_f64() - forward.low.to_f64();
        let zero = at_rest.zero.to_f64();
        let grid = Grid { low: -zero, high: top - zero, cells };
        Ok(Self { map: Everett::from_surface(grid, 0.0, descent, first)?, rest: forward.rest })
    }

    /// Returns the Everett map over outputs \[input unit over output unit\].
    pub fn map(&self) -> &Everett<T, N> {
        &self.map
    }

    pub(super) fn into_map(self) -> Everett<T, N> {
        self.map
    }

    /// Returns the input at rest \[input unit\].
    pub fn rest(&self) -> T {
        self.rest
    }
}

impl<T: Real, const N: usize> Stage<T> for InverseSurface<T, N> {
    type State = PreisachState<T, N>;

    fn state(&self) -> Self::State {
        self.map.state()
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        self.rest + self.map.reset(s, e, u0)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        self.rest + self.map.step(s, e, u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::boxed::Box;
    use std::println;
    use std::vec::Vec;

    const CELLS: usize = 50;
    type Map = Everett<f64, 51>;
    const GRID: Grid = Grid { low: 0.0, high: 120.0, cells: CELLS };

    /// Returns maps with total 1, a reversible share and a density of relays, and the expected range of the RMSE on
    /// minor loops.
    fn densities() -> [(&'static str, Box<Map>, core::ops::Range<f64>); 5] {
        let make = |reversible: f64, relays: &dyn Fn(f64, f64) -> f64| {
            let mut sum = 0.0;
            let at = |k: usize| (k as f64 + 0.5) / CELLS as f64;
            for a in 0..CELLS {
                for b in 0..a {
                    sum += relays(at(a), at(b));
                }
            }
            let each = reversible / CELLS as f64;
            let density = |a: usize, b: usize| {
                if a == b { each } else { (1.0 - reversible) * relays(at(a), at(b)) / sum }
            };
            Box::new(Map::new(GRID, 0.0, density, |_| 0.0).unwrap())
        };
        [
            ("uniform", make(0.5, &|_, _| 1.0), 0.0..3e-4),
            ("near the diagonal", make(0.5, &|a, b| libm::exp(-4.0 * (a - b))), 0.0..3e-4),
            ("far from the diagonal", make(0.4, &|a, b| (a - b) * (a - b)), 0.0..3e-4),
            ("rising", make(0.4, &|a, b| libm::exp(3.0 * (a + b))), 0.015..0.02),
            (
                "about a point",
                make(0.4, &|a, b| libm::exp(-8.0 * ((a - 0.6) * (a - 0.6) + (b - 0.4) * (b - 0.4)))),
                0.008..0.011,
            ),
        ]
    }

    #[test]
    fn inverse_is_exact_at_the_nodes_of_its_descents() {
        for (name, map, _) in densities() {
            let inverse = Box::new(InverseSurface::<f64, 51>::new(&map, CELLS).unwrap());
            let e = Env::default();
            let span = map.virgin(120.0);
            for i in (1..=CELLS).rev() {
                let (mut f, mut s) = (map.state(), inverse.state());
                map.reset(&mut f, &e, 0.0);
                inverse.reset(&mut s, &e, 0.0);
                for k in (0..=i).chain((0..i).rev()) {
                    let reference = span * k as f64 / CELLS as f64;
                    let drive = inverse.step(&mut s, &e, reference);
                    let error = map.step(&mut f, &e, drive) - reference;
                    assert!(error.abs() < 1e-10 * span, "{name} {i} {k}: {error}");
                }
            }
        }
    }

    #[test]
    fn minor_loops_are_exact_only_if_the_density_depends_on_the_difference() {
        for (name, map, expected) in densities() {
            let surface = Box::new(InverseSurface::<f64, 51>::new(&map, CELLS).unwrap());
            let exact = Box::new(map.invert().unwrap());
            let e = Env::default();
            let span = map.virgin(120.0);
            // Random minor loops: turning points in the inner 80 % of the span, 20 samples per branch.
            let mut seed = 1u64;
            let mut random = || {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (seed >> 11) as f64 / (1u64 << 53) as f64
            };
            let turns: Vec<f64> = (0..400).map(|_| span * (0.1 + 0.8 * random())).collect();
            let run = |inverse: &dyn Fn(f64) -> f64, f: &mut PreisachState<f64, 51>| {
                let (mut sum, mut worst, mut n) = (0.0, 0.0f64, 0.0);
                for w in turns.windows(2) {
                    for k in 1..=20 {
                        let reference = w[0] + (w[1] - w[0]) * f64::from(k) / 20.0;
                        let error = (map.step(f, &e, inverse(reference)) - reference) / span;
                        (sum, worst, n) = (sum + error * error, worst.max(error.abs()), n + 1.0);
                    }
                }
                ((sum / n).sqrt(), worst)
            };
            let (mut f, s) = (map.state(), std::cell::RefCell::new(surface.state()));
            map.reset(&mut f, &e, 0.0);
            surface.reset(&mut s.borrow_mut(), &e, 0.0);
            let (rmse, worst) = run(&|y| surface.step(&mut s.borrow_mut(), &e, y), &mut f);
            let s = std::cell::RefCell::new(exact.state());
            map.reset(&mut f, &e, 0.0);
            exact.reset(&mut s.borrow_mut(), &e, 0.0);
            let (exact_rmse, _) = run(&|y| exact.step(&mut s.borrow_mut(), &e, y), &mut f);
            println!("{name}: RMSE {:.3} % of span, largest {:.2} %", 100.0 * rmse, 100.0 * worst);
            assert!(exact_rmse < 1e-12, "{name} {exact_rmse}");
            assert!(expected.contains(&rmse), "{name}");
        }
    }
}
