//! Levenberg-Marquardt on the projected residual.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::projection::{Projected, Projection};
use crate::optimize::Space;

/// Step of the difference quotients, as a share of the box.
const STEP_SHARE: f64 = 1e-4;
/// Maximum number of iterations.
const ITERATIONS: usize = 60;
/// Relative fall of the sum of squares below which the iteration has converged.
pub(crate) const CONVERGED_FALL: f64 = 1e-12;

/// Result of a local search.
#[derive(Clone, Debug)]
pub(crate) struct Polished {
    /// Position in the unit cube.
    pub(crate) point: Vec<f64>,
    pub(crate) projected: Projected,
    /// Number of evaluations of the model.
    pub(crate) evaluations: u64,
}

/// Minimises the sum of squares from `point` (in the unit cube) until it falls by at most the fraction `settled` in an
/// iteration.
/// Levenberg-Marquardt with Marquardt's scaling on the residual after projection (the functional of Golub & Pereyra,
/// derivatives by central differences). A variable at a side of the box stays there while the gradient points outwards.
/// The result is never worse than the start.
pub(crate) fn polish(projection: &Projection<'_>, space: &Space, point: &[f64], settled: f64) -> Option<Polished> {
    let at = |x: &[f64]| projection.at(&space.values(x));
    let mut x = point.to_vec();
    let mut now = at(&x)?;
    let mut evaluations = 1u64;
    let mut damping = 1e-3;
    for _ in 0..ITERATIONS {
        let slopes = jacobian(&x, &now, &at);
        evaluations += 2 * x.len() as u64;
        let gradient = slopes.tr_mul(&now.residual);
        // The descent direction is −gradient.
        let free: Vec<usize> = (0..x.len())
            .filter(|d| !((x[*d] <= 0.0 && gradient[*d] > 0.0) || (x[*d] >= 1.0 && gradient[*d] < 0.0)))
            .collect();
        if free.is_empty() {
            break;
        }
        let own = slopes.select_columns(&free);
        let (normal, right) = (own.tr_mul(&own), own.tr_mul(&now.residual));
        let mut better = None;
        for _ in 0..12 {
            let mut damped = normal.clone();
            for i in 0..free.len() {
                damped[(i, i)] += damping * normal[(i, i)].max(1e-30);
            }
            let Some(step) = damped.cholesky().map(|c| c.solve(&right)) else {
                damping *= 4.0;
                continue;
            };
            let mut to = x.clone();
            for (d, s) in free.iter().zip(step.iter()) {
                to[*d] = (to[*d] - s).clamp(0.0, 1.0);
            }
            evaluations += 1;
            match at(&to) {
                Some(there) if there.squares() < now.squares() => {
                    damping = (damping * 0.2).max(1e-12);
                    better = Some((to, there));
                    break;
                }
                _ => damping *= 4.0,
            }
        }
        let Some((to, there)) = better else { break };
        let fall = now.squares() - there.squares();
        let converged = fall <= settled * now.squares();
        (x, now) = (to, there);
        if converged {
            break;
        }
    }
    Some(Polished { point: x, projected: now, evaluations })
}

/// A position of one variable, and the residual there if there is a model.
type Side = (f64, Option<DVector<f64>>);

/// Returns the derivatives of the residual, one column per variable; zero if there is no model on either side.
fn jacobian(x: &[f64], now: &Projected, at: &(dyn Fn(&[f64]) -> Option<Projected> + Sync)) -> DMatrix<f64> {
    // All sides in one queue: with pairs a core would be idle at the end.
    let sides: Vec<Side> = (0..2 * x.len())
        .into_par_iter()
        .with_max_len(1)
        .map(|i| {
            let (mut to, d) = (x.to_vec(), i / 2);
            to[d] = (to[d] + if i % 2 == 0 { STEP_SHARE } else { -STEP_SHARE }).clamp(0.0, 1.0);
            (to[d], at(&to).map(|there| there.residual))
        })
        .collect();
    let column = |(d, pair): (usize, &[Side])| {
        let side = |i: usize| match &pair[i] {
            (there, Some(residual)) => (*there, residual),
            (_, None) => (x[d], &now.residual),
        };
        let ((high, a), (low, b)) = (side(0), side(1));
        if high > low { (a - b) / (high - low) } else { DVector::zeros(now.residual.len()) }
    };
    let columns: Vec<DVector<f64>> = sides.chunks(2).enumerate().map(column).collect();
    DMatrix::from_columns(&columns)
}
