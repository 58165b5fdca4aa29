//! Bounded least squares from normal equations.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{DMatrix, DVector};

use super::Gram;

/// Bounds of one unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

impl Bounds {
    pub(crate) const FREE: Self = Self { lower: f64::NEG_INFINITY, upper: f64::INFINITY };

    /// Returns whether both bounds are equal.
    fn is_fixed(self) -> bool {
        self.lower == self.upper
    }

    pub(crate) fn fixed(value: f64) -> Self {
        Self { lower: value, upper: value }
    }

    pub(crate) fn above(lower: f64) -> Self {
        Self { lower, ..Self::FREE }
    }
}

/// Maximum distance from a bound at which an unknown counts as held there, relative to the sum of all bounded unknowns:
/// a solver ends within rounding of it.
const NEAR_BOUND: f64 = 1e-9;

/// Returns which values are held at a bound.
pub(crate) fn held<'a>(values: impl Iterator<Item = &'a f64> + Clone, bounds: &[Bounds]) -> Vec<bool> {
    let bounded = values.clone().zip(bounds).filter(|(_, b)| b.lower.is_finite());
    let near = NEAR_BOUND * bounded.map(|(value, _)| value.abs()).sum::<f64>();
    values.zip(bounds).map(|(value, b)| *value <= b.lower + near || *value >= b.upper - near).collect()
}

/// Relative ridge on scaled columns. It prevents two collinear columns from growing against each other, without
/// changing what the record determines.
const RIDGE: f64 = 1e-10;

/// Maximum number of exchanges of the block pivoting; the interior-point solver is tried after that.
const MAX_EXCHANGES: usize = 60;
/// Maximum number of successive exchanges without fewer wrongly placed unknowns than before.
const MAX_STALLED_EXCHANGES: usize = 5;

/// Minimises `|y − X z|² + zᵀ P z` within bounds. `penalty` is the upper triangle of P, or `None`.
///
/// Returns `None` if the equations are not finite or the solver fails.
pub(crate) fn solve(gram: &Gram, penalty: Option<&DMatrix<f64>>, bounds: &[Bounds]) -> Option<DVector<f64>> {
    solve_near(gram, penalty, bounds, None)
}

/// Solves as [`solve`] does, starting from the solution of similar equations: its active bounds are nearly right.
pub(crate) fn solve_near(
    gram: &Gram,
    penalty: Option<&DMatrix<f64>>,
    bounds: &[Bounds],
    near: Option<&DVector<f64>>,
) -> Option<DVector<f64>> {
    let n = gram.unknowns();
    let mut h: DMatrix<f64> = gram.matrix.view((0, 0), (n, n)).into();
    let mut g: DVector<f64> = gram.matrix.view((0, n), (n, 1)).column(0).into();
    if let Some(p) = penalty {
        h += p;
    }
    // The target is scaled to unit length, because the solver's tolerances are absolute.
    let size = gram.matrix[(n, n)].sqrt().max(f64::MIN_POSITIVE);
    // Columns are scaled to unit length, because their units differ.
    let scale: Vec<f64> = (0..n).map(|i| if h[(i, i)] > 0.0 { h[(i, i)].sqrt() } else { 1.0 }).collect();
    for i in 0..n {
        g[i] /= scale[i] * size;
        for j in 0..n {
            h[(i, j)] /= scale[i] * scale[j];
        }
        h[(i, i)] += RIDGE;
    }
    if !h.iter().chain(g.iter()).all(|x| x.is_finite()) {
        return None;
    }
    let scaled: Vec<Bounds> = bounds
        .iter()
        .zip(&scale)
        .map(|(b, s)| Bounds { lower: b.lower * s / size, upper: b.upper * s / size })
        .collect();
    // Without a start, no bound is active.
    let place = |i: usize| match (bounds[i], near.map(|near| (near[i], 1e-12 * near[i].abs()))) {
        (b, _) if b.is_fixed() => At::Lower,
        (b, Some((z, room))) if z - b.lower <= room => At::Lower,
        (b, Some((z, room))) if b.upper - z <= room => At::Upper,
        _ => At::Free,
    };
    let at = (0..n).map(place).collect();
    let z = match pivoted(&h, &g, &scaled, at) {
        Some(z) => z,
        None => bounded(&h, &g, &scaled)?,
    };
    // Scaling back may exceed a bound by rounding.
    Some(DVector::from_fn(n, |i, _| (z[i] / scale[i] * size).max(bounds[i].lower).min(bounds[i].upper)))
}

fn bounded(h: &DMatrix<f64>, g: &DVector<f64>, bounds: &[Bounds]) -> Option<DVector<f64>> {
    let n = g.len();
    let mut upper = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..n {
        for i in 0..=j {
            upper.0.push(i);
            upper.1.push(j);
            upper.2.push(h[(i, j)]);
        }
    }
    let p = CscMatrix::new_from_triplets(n, n, upper.0, upper.1, upper.2);
    // −z ≤ −lower and z ≤ upper, one row for each finite bound.
    let (mut rows, mut columns, mut values, mut limit) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (j, b) in bounds.iter().enumerate() {
        for (sign, at) in [(-1.0, -b.lower), (1.0, b.upper)] {
            if at.is_finite() {
                rows.push(limit.len());
                columns.push(j);
                values.push(sign);
                limit.push(at);
            }
        }
    }
    let m = limit.len();
    let a = CscMatrix::new_from_triplets(m, n, rows, columns, values);
    let q: Vec<f64> = g.iter().map(|x| -x).collect();
    let settings = DefaultSettingsBuilder::default().verbose(false).max_iter(100).build().ok()?;
    let mut solver = DefaultSolver::new(&p, &q, &a, &limit, &[SupportedConeT::NonnegativeConeT(m)], settings).ok()?;
    solver.solve();
    if !matches!(
        solver.solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress
    ) {
        return None;
    }
    // An interior point ends just inside the bounds or, within its tolerance, outside.
    let z = DVector::from_iterator(n, solver.solution.x.iter().zip(bounds).map(|(z, b)| z.max(b.lower).min(b.upper)));
    if !z.iter().all(|x| x.is_finite()) {
        return None;
    }
    Some(polish(h, g, bounds, z))
}

/// Position of an unknown relative to its bounds.
#[derive(Clone, Copy, PartialEq)]
enum At {
    Lower,
    Upper,
    Free,
}

/// Finds the optimum by block principal pivoting: all wrongly placed unknowns change their position together, a single
/// one if that does not help (Júdice and Pires 1994). Returns `None` if it takes too long or the free unknowns are not
/// determined.
fn pivoted(h: &DMatrix<f64>, g: &DVector<f64>, bounds: &[Bounds], mut at: Vec<At>) -> Option<DVector<f64>> {
    let n = g.len();
    let tolerance = 1e-11 * g.amax();
    let (mut least, mut chances) = (usize::MAX, MAX_STALLED_EXCHANGES);
    for _ in 0..MAX_EXCHANGES {
        let mut z = DVector::from_fn(n, |i, _| match at[i] {
            At::Lower => bounds[i].lower,
            At::Upper => bounds[i].upper,
            At::Free => 0.0,
        });
        let free: Vec<usize> = (0..n).filter(|i| at[*i] == At::Free).collect();
        let minimum = minimum(h, g, &z, &free)?;
        free.iter().zip(&minimum).for_each(|(i, m)| z[*i] = *m);
        if !z.iter().all(|x| x.is_finite()) {
            return None;
        }
        let pull = g - h * &z;
        let correct_position = |i: usize| match at[i] {
            stays if bounds[i].is_fixed() => stays,
            At::Free if z[i] < bounds[i].lower => At::Lower,
            At::Free if z[i] > bounds[i].upper => At::Upper,
            At::Lower if pull[i] > tolerance => At::Free,
            At::Upper if -pull[i] > tolerance => At::Free,
            stays => stays,
        };
        let wrong: Vec<(usize, At)> =
            (0..n).map(|i| (i, correct_position(i))).filter(|(i, to)| *to != at[*i]).collect();
        let Some(last) = wrong.last() else { return Some(z) };
        if wrong.len() < least {
            (least, chances) = (wrong.len(), MAX_STALLED_EXCHANGES);
        } else if chances > 0 {
            chances -= 1;
        } else {
            at[last.0] = last.1;
            continue;
        }
        wrong.iter().for_each(|(i, to)| at[*i] = *to);
    }
    None
}

/// Moves a nearly right solution to the exact optimum by a primal active-set search.
///
/// Play operators with similar thresholds make the problem ill-conditioned: a duality gap of 10⁻⁸ still leaves several
/// times the smallest possible residual. Its active set is nearly right.
fn polish(h: &DMatrix<f64>, g: &DVector<f64>, bounds: &[Bounds], mut z: DVector<f64>) -> DVector<f64> {
    let n = g.len();
    let size = z.amax().max(f64::MIN_POSITIVE);
    let mut at: Vec<At> = (0..n)
        .map(|i| match bounds[i] {
            b if z[i] - b.lower < 1e-6 * size => At::Lower,
            b if b.upper - z[i] < 1e-6 * size => At::Upper,
            _ => At::Free,
        })
        .collect();
    let bound = |i: usize, a: At| if a == At::Lower { bounds[i].lower } else { bounds[i].upper };
    for i in 0..n {
        if at[i] != At::Free {
            z[i] = bound(i, at[i]);
        }
    }
    let tolerance = 1e-11 * g.amax();
    for _ in 0..10 * n {
        let free: Vec<usize> = (0..n).filter(|i| at[*i] == At::Free).collect();
        let target = match minimum(h, g, &z, &free) {
            Some(target) => target,
            None => return z,
        };
        // Towards the minimum over the free unknowns, as far as the bounds allow.
        let (mut reach, mut hit) = (1.0, None);
        for (i, t) in free.iter().zip(&target) {
            let d = t - z[*i];
            let (limit, side) = if d < 0.0 { (bounds[*i].lower, At::Lower) } else { (bounds[*i].upper, At::Upper) };
            if (d < 0.0 && *t < limit) || (d > 0.0 && *t > limit) {
                let share = ((limit - z[*i]) / d).clamp(0.0, 1.0);
                if share < reach {
                    (reach, hit) = (share, Some((*i, side)));
                }
            }
        }
        for (i, t) in free.iter().zip(&target) {
            z[*i] += reach * (t - z[*i]);
        }
        if let Some((i, side)) = hit {
            at[i] = side;
            z[i] = bound(i, side);
            continue;
        }
        // Release the bound with the largest gradient towards the inside.
        let pull = g - h * &z;
        let outward = |i: usize| match at[i] {
            At::Lower => pull[i],
            At::Upper => -pull[i],
            At::Free => 0.0,
        };
        match (0..n).max_by(|a, b| outward(*a).total_cmp(&outward(*b))) {
            Some(i) if outward(i) > tolerance => at[i] = At::Free,
            _ => return z,
        }
    }
    z
}

/// Returns the minimum over the free unknowns, with the others held.
fn minimum(h: &DMatrix<f64>, g: &DVector<f64>, z: &DVector<f64>, free: &[usize]) -> Option<Vec<f64>> {
    let mut held = z.clone();
    free.iter().for_each(|i| held[*i] = 0.0);
    let right = g - h * held;
    let own = DMatrix::from_fn(free.len(), free.len(), |r, c| h[(free[r], free[c])]);
    let g = DVector::from_fn(free.len(), |r, _| right[free[r]]);
    Some(own.cholesky()?.solve(&g).iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From any start (near, far, outside of the bounds) the solution is the same as without one.
    #[test]
    fn the_solution_does_not_depend_on_the_start() {
        let n = 40;
        // Overlapping hat functions over 300 rows with alternating weights: half of them end at a bound.
        let hat = |k: usize, c: usize| (1.0 - (k as f64 / 7.5 - c as f64).abs() / 3.0).max(0.0);
        let y =
            |k: usize| (0..n).map(|c| hat(k, c) * if c % 2 == 0 { 1.0 } else { -0.6 }).sum::<f64>() + (k as f64).sin();
        let x = DMatrix::from_fn(300, n + 1, |k, c| if c < n { hat(k, c) } else { y(k) });
        let gram = Gram { matrix: x.transpose() * &x, rows: 300 };
        let bounds = vec![Bounds { lower: 0.0, upper: 0.8 }; n];
        let exact = solve(&gram, None, &bounds).unwrap();
        let bound = exact.iter().filter(|z| **z == 0.0 || **z == 0.8).count();
        assert!(bound > n / 4 && bound < n, "{bound} of {n} at a bound");
        let beside = exact.map(|z| z + 0.05 * (17.0 * z).sin());
        let outside = DVector::from_fn(n, |i, _| if i % 2 == 0 { 9.0 } else { -9.0 });
        for near in [exact.clone(), beside, DVector::zeros(n), DVector::from_element(n, 0.4), outside] {
            let found = solve_near(&gram, None, &bounds, Some(&near)).unwrap();
            assert!((&found - &exact).amax() < 1e-8, "{}", (&found - &exact).amax());
        }
    }

    /// For any gradient at the fixed unknown and any start.
    #[test]
    fn a_fixed_unknown_stays() {
        let column = |c: usize, k: usize| ((c + 1) as f64 * 0.7 * k as f64).sin() + 0.2;
        for fixed in [-3.0, 0.4, 3.0] {
            let y = |k: usize| 0.5 * column(0, k) + column(1, k) + 0.8 * column(2, k);
            let x = DMatrix::from_fn(50, 4, |k, c| if c < 3 { column(c, k) } else { y(k) });
            let bounds = [Bounds::FREE, Bounds { lower: fixed, upper: fixed }, Bounds::above(0.0)];
            let cold = solve(&Gram::of(&x), None, &bounds).unwrap();
            assert_eq!(cold[1], fixed);
            let warm = solve_near(&Gram::of(&x), None, &bounds, Some(&cold)).unwrap();
            assert!((cold - warm).amax() < 1e-12);
        }
    }

    #[test]
    fn an_active_bound_holds_and_the_rest_is_refitted() {
        // y = 2 a − b on orthogonal columns; with b ≥ 0 the solution is a = 2.
        let a: Vec<f64> = (0..40).map(|k| f64::from(k % 2)).collect();
        let b: Vec<f64> = (0..40).map(|k| f64::from((k + 1) % 2)).collect();
        let y: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - b).collect();
        let x = DMatrix::from_fn(40, 3, |k, c| [&a, &b, &y][c][k]);
        let gram = Gram { matrix: x.tr_mul(&x), rows: 40 };
        let free = solve(&gram, None, &[Bounds::FREE; 2]).unwrap();
        assert!((free[1] + 1.0).abs() < 1e-8);
        let z = solve(&gram, None, &[Bounds::FREE, Bounds::above(0.0)]).unwrap();
        assert!((z[0] - 2.0).abs() < 1e-6 && z[1].abs() < 1e-6, "{z}");
        assert!((gram.error(&z) - 20.0).abs() < 1e-4);
    }
}
