//! Levenberg-Marquardt on the projected residual.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::projection::{Projected, Projection};
use crate::optimize::Space;

/// Step of the difference quotients, as a share of the box.
const STEP: f64 = 1e-4;
/// Most iterations.
const ITERATIONS: usize = 60;
/// Relative fall of the sum of squares below which it has converged.
pub(crate) const SETTLED: f64 = 1e-12;

/// Where a local search ended.
#[derive(Clone, Debug)]
pub(crate) struct Polished {
    /// In the unit cube.
    pub(crate) point: Vec<f64>,
    pub(crate) projected: Projected,
    /// Evaluations of the model.
    pub(crate) evaluations: u64,
}

/// Goes downhill from `point` (in the unit cube) until the sum of squares falls by no more than its `settled`th part: Levenberg-Marquardt with Marquardt's scaling
/// on the residual after projection (Golub & Pereyra's functional, its derivative by central differences); variables at a
/// side of the box stay there while they are pushed outwards. Never ends higher than it began.
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
        // Downhill is −gradient.
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

/// A place of one variable, and the residual there, if there is a model.
type Side = (f64, Option<DVector<f64>>);

/// Slopes of the residual, one column for each variable; zero where no model is on either side.
fn jacobian(x: &[f64], now: &Projected, at: &(dyn Fn(&[f64]) -> Option<Projected> + Sync)) -> DMatrix<f64> {
    // All sides at once: pairs of them would leave a core without work at the end.
    let sides: Vec<Side> = (0..2 * x.len())
        .into_par_iter()
        .with_max_len(1)
        .map(|i| {
            let (mut to, d) = (x.to_vec(), i / 2);
            to[d] = (to[d] + if i % 2 == 0 { STEP } else { -STEP }).clamp(0.0, 1.0);
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
