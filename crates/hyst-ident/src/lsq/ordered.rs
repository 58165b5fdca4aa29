//! The closest values that satisfy order constraints.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// An order constraint: `x[upper] − x[lower] ≥ least`; without a lower index, `x[upper] ≥ least`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Order {
    pub(crate) upper: usize,
    pub(crate) lower: Option<usize>,
    pub(crate) least: f64,
}

/// Maximum ratio of two weights: a standard error of zero would make the equations singular.
const MAX_WEIGHT_RATIO: f64 = 1e6;

/// Minimises `Σ wᵢ (xᵢ − tᵢ)²` under all order constraints. Returns `None` if a number is not finite or the solver
/// fails.
///
/// The interior-point solution satisfies an active constraint within its tolerance (10⁻⁸ of the largest target).
pub(crate) fn nearest_ordered(target: &[f64], weight: &[f64], orders: &[Order]) -> Option<Vec<f64>> {
    let n = target.len();
    // Targets and weights are scaled to unit size, because the solver's tolerances are absolute.
    let size = target.iter().fold(0.0f64, |m, t| m.max(t.abs())).max(f64::MIN_POSITIVE);
    let finite = weight.iter().copied().filter(|w| w.is_finite()).fold(0.0f64, f64::max);
    let heaviest = if finite > 0.0 { finite } else { 1.0 };
    let w: Vec<f64> = weight.iter().map(|w| (w / heaviest).clamp(1.0 / MAX_WEIGHT_RATIO, 1.0)).collect();
    if !target.iter().chain(&w).all(|x| x.is_finite()) {
        return None;
    }
    // If every constraint holds, nothing has to move. The solver would give only an approximate result, less accurate
    // for a small weight.
    if orders.iter().all(|o| target[o.upper] - o.lower.map_or(0.0, |l| target[l]) >= o.least) {
        return Some(target.to_vec());
    }
    let diagonal: Vec<usize> = (0..n).collect();
    let p = CscMatrix::new_from_triplets(n, n, diagonal.clone(), diagonal, w.clone());
    let q: Vec<f64> = target.iter().zip(&w).map(|(t, w)| -w * t / size).collect();
    let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let mut entry = |row, column, value| {
        rows.push(row);
        columns.push(column);
        values.push(value);
    };
    for (row, order) in orders.iter().enumerate() {
        entry(row, order.upper, -1.0);
        if let Some(lower) = order.lower {
            entry(row, lower, 1.0);
        }
    }
    let m = orders.len();
    let a = CscMatrix::new_from_triplets(m, n, rows, columns, values);
    let limit: Vec<f64> = orders.iter().map(|o| -o.least / size).collect();
    let settings = DefaultSettingsBuilder::default().verbose(false).max_iter(200).build().ok()?;
    let mut solver = DefaultSolver::new(&p, &q, &a, &limit, &[SupportedConeT::NonnegativeConeT(m)], settings).ok()?;
    solver.solve();
    let done = matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
    let x: Vec<f64> = solver.solution.x.iter().map(|x| x * size).collect();
    (done && x.iter().all(|x| x.is_finite())).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_order_meet_at_their_weighted_mean() {
        // 3 with weight 1 above 1 with weight 3, in the wrong order: both become 1.5. The third is free.
        let order = |upper, lower, least| Order { upper, lower, least };
        let x = nearest_ordered(&[1.0, 3.0, -2.0], &[3.0, 1.0, 1.0], &[order(0, Some(1), 0.0)]).unwrap();
        for (x, expected) in x.iter().zip([1.5, 1.5, -2.0]) {
            assert!((x - expected).abs() < 1e-6, "{x} {expected}");
        }
        let x = nearest_ordered(&[1.0, 3.0, -2.0], &[3.0, 1.0, 1.0], &[order(0, Some(1), 0.4), order(2, None, 0.5)]);
        for (x, expected) in x.unwrap().iter().zip([1.6, 1.2, 0.5]) {
            assert!((x - expected).abs() < 1e-6, "{x} {expected}");
        }
        assert_eq!(nearest_ordered(&[f64::NAN], &[1.0], &[]), None);
    }

    #[test]
    fn values_in_order_stay() {
        let target = [5.0, 2.0, 1.0];
        let orders = [Order { upper: 0, lower: Some(1), least: 1.0 }, Order { upper: 1, lower: Some(2), least: 0.5 }];
        let x = nearest_ordered(&target, &[1.0, f64::INFINITY, 1e-9], &orders).unwrap();
        assert_eq!(x, target);
    }
}
