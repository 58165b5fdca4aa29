//! Least squares with bounds, from normal equations.

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

    pub(crate) fn above(lower: f64) -> Self {
        Self { lower, ..Self::FREE }
    }
}

/// Relative ridge on scaled columns: keeps two collinear columns from growing against each other
/// without moving what the record determines.
const RIDGE: f64 = 1e-10;

/// Minimises `|y − X z|² + zᵀ P z` within bounds. `penalty` is P's upper triangle or `None`.
///
/// Returns `None` if the equations are not finite or the solver gives up.
pub(crate) fn solve(gram: &Gram, penalty: Option<&DMatrix<f64>>, bounds: &[Bounds]) -> Option<DVector<f64>> {
    let n = gram.unknowns();
    let mut h: DMatrix<f64> = gram.matrix.view((0, 0), (n, n)).into();
    let mut g: DVector<f64> = gram.matrix.view((0, n), (n, 1)).column(0).into();
    if let Some(p) = penalty {
        h += p;
    }
    // Columns of unit length: volts, micrometres and hertz stand side by side here.
    let scale: Vec<f64> = (0..n).map(|i| if h[(i, i)] > 0.0 { h[(i, i)].sqrt() } else { 1.0 }).collect();
    for i in 0..n {
        g[i] /= scale[i];
        for j in 0..n {
            h[(i, j)] /= scale[i] * scale[j];
        }
        h[(i, i)] += RIDGE;
    }
    if !h.iter().chain(g.iter()).all(|x| x.is_finite()) {
        return None;
    }
    let scaled: Vec<Bounds> =
        bounds.iter().zip(&scale).map(|(b, s)| Bounds { lower: b.lower * s, upper: b.upper * s }).collect();
    // Where no bound binds, the answer is the plain one.
    let free = h.clone().cholesky().map(|c| c.solve(&g));
    let inside = |z: &DVector<f64>| z.iter().zip(&scaled).all(|(z, b)| *z >= b.lower && *z <= b.upper);
    let z = match free {
        Some(z) if inside(&z) => z,
        _ => bounded(&h, &g, &scaled)?,
    };
    Some(DVector::from_fn(n, |i, _| z[i] / scale[i]))
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
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .max_iter(100)
        .tol_gap_abs(1e-11)
        .tol_gap_rel(1e-11)
        .tol_feas(1e-11)
        .build()
        .ok()?;
    let mut solver = DefaultSolver::new(&p, &q, &a, &limit, &[SupportedConeT::NonnegativeConeT(m)], settings).ok()?;
    solver.solve();
    if !matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress) {
        return None;
    }
    // An interior point ends just inside or, within its tolerance, outside.
    let z = DVector::from_iterator(n, solver.solution.x.iter().zip(bounds).map(|(z, b)| z.max(b.lower).min(b.upper)));
    z.iter().all(|x| x.is_finite()).then_some(z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_that_binds_holds_and_the_rest_is_refitted() {
        // y = 2 a − b on orthogonal columns; b ≥ 0 leaves a = 2.
        let a: Vec<f64> = (0..40).map(|k| f64::from(k % 2)).collect();
        let b: Vec<f64> = (0..40).map(|k| f64::from((k + 1) % 2)).collect();
        let y: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - b).collect();
        let gram = Gram::of(&[&a, &b, &y], 0..40);
        let free = solve(&gram, None, &[Bounds::FREE; 2]).unwrap();
        assert!((free[1] + 1.0).abs() < 1e-8);
        let z = solve(&gram, None, &[Bounds::FREE, Bounds::above(0.0)]).unwrap();
        assert!((z[0] - 2.0).abs() < 1e-6 && z[1].abs() < 1e-6, "{z}");
        assert!((gram.error(&z) - 20.0).abs() < 1e-4);
    }
}
