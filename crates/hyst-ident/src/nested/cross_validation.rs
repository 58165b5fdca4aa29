//! Cross-validation inside the training record, from the blocks' normal equations.

use super::Fitted;
use crate::lsq::{Blocks, Gram, solve};

/// Blocks dealt out in turn to `count` folds: each fold has pieces of every segment.
pub(crate) fn folds_interleaved(blocks: &Blocks, count: usize) -> Vec<Vec<usize>> {
    let n = blocks.rows.len();
    // Shifted by one each round, so that equal segments do not lose the same piece together.
    let fold = |b: usize| (b + b / count) % count;
    (0..count.min(n))
        .map(|f| (0..n).filter(|b| fold(*b) == f).collect())
        .filter(|f: &Vec<usize>| !f.is_empty())
        .collect()
}

/// Σ residual² of each block, predicted by a fit to the blocks of all other folds.
///
/// The fit to the others is one Gauss-Newton step away from the fit to all, taken with every weight
/// and parameter free: exact for what is linear, and close for the rest, since one fold moves the
/// solution little.
pub(crate) fn cross_validate(fit: &Fitted, folds: &[Vec<usize>]) -> Option<Vec<f64>> {
    let columns = fit.grams.first()?.matrix.ncols();
    let total = Gram::sum(columns, fit.grams.iter());
    let nonlinear_from = columns - 1 - fit.hypothesis.nonlinear().len();
    let mut penalty = fit.penalty.clone();
    for i in nonlinear_from..columns - 1 {
        penalty[(i, i)] += 1e-6 * total.matrix[(i, i)];
    }
    let mut squares = vec![0.0; fit.grams.len()];
    for fold in folds {
        let mut others = total.clone();
        for b in fold {
            others.matrix -= &fit.grams[*b].matrix;
            others.rows -= fit.grams[*b].rows;
        }
        let z = solve(&others, Some(&penalty), &fit.bounds)?;
        for b in fold {
            squares[*b] = fit.grams[*b].error(&z);
        }
    }
    Some(squares)
}
