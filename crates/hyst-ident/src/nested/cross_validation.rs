//! Cross-validation inside the training record, from the blocks' normal equations.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::Fitted;
use crate::Samples;
use crate::lsq::{Blocks, Bounds, Gram, Share, solve_near};

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

/// Whole experiments left out, one fold each: the segments of a record, or `parts` stretches of one that has a single segment. What helps
/// only where it was fitted does not transfer.
pub(crate) fn folds_by_experiment(blocks: &Blocks, samples: &Samples, parts: usize) -> Vec<Vec<usize>> {
    let n = blocks.rows.len();
    let experiment = |b: usize| match samples.segments.len() {
        0 | 1 => b * parts / n.max(1),
        _ => samples.segments.iter().position(|s| s.contains(&blocks.rows[b].start)).unwrap_or(0),
    };
    let mut folds: Vec<Vec<usize>> = vec![Vec::new(); samples.segments.len().max(parts)];
    (0..n).for_each(|b| folds[experiment(b)].push(b));
    folds.retain(|fold| !fold.is_empty());
    folds
}

/// Mean variance of a block's prediction by the other folds, in variances of a row, beyond which they say nothing about it.
const UNKNOWN: f64 = 1.0;

/// Blocks that move the base where no block outside their own fold does (a first rise from rest, say): the others cannot predict
/// them. `shares` and `penalty` are those of the base.
pub(super) fn unpredictable(shares: &[Share], penalty: &DMatrix<f64>, folds: &[Vec<usize>]) -> Vec<bool> {
    let mut unknown = vec![false; shares.len()];
    let Some(columns) = shares.first().map(Share::columns) else { return unknown };
    let n = columns - 1;
    let total = Share::sum(columns, shares.iter());
    let scale: Vec<f64> = (0..n).map(|i| total.matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let scaled = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |r, c| m[(r, c)] / (scale[r] * scale[c]));
    let prior = scaled(penalty);
    let of_fold = |fold: &Vec<usize>| -> Vec<(usize, bool)> {
        let own: Vec<DMatrix<f64>> = fold.iter().map(|b| scaled(&shares[*b].gram().matrix)).collect();
        let mut others = scaled(&total.matrix) + &prior;
        own.iter().for_each(|own| others -= own);
        (0..n).for_each(|i| others[(i, i)] += 1e-12);
        let inverse = others.cholesky().map(|f| f.inverse());
        // The trace of a product of two symmetric matrices is the sum of their products element by element.
        let spread = |own: &DMatrix<f64>| inverse.as_ref().map(|inverse| inverse.dot(own));
        let is = |b: usize, own| spread(own).is_none_or(|s| s > UNKNOWN * shares[b].rows() as f64);
        fold.iter().zip(&own).map(|(b, own)| (*b, is(*b, own))).collect()
    };
    let found: Vec<Vec<(usize, bool)>> = folds.par_iter().map(of_fold).collect();
    found.into_iter().flatten().for_each(|(b, is)| unknown[b] = is);
    unknown
}

/// Σ residual² of each block, predicted by a fit to the blocks of all other folds; of the `unpredictable` ones as they are fitted.
///
/// The fit to the others is one Gauss-Newton step away from the fit to all, taken with every weight
/// and parameter free: exact for what is linear, and close for the rest, since one fold moves the
/// solution little.
pub(super) fn cross_validate(fit: &Fitted, folds: &[Vec<usize>], unpredictable: &[bool]) -> Option<Vec<f64>> {
    let columns = fit.shares.first()?.columns();
    let own: Vec<Gram> =
        folds.par_iter().map(|fold| Share::sum(columns, fold.iter().map(|b| &fit.shares[*b]))).collect();
    let total = Gram::sum(columns, own.iter());
    let nonlinear_from = columns - 1 - fit.hypothesis.nonlinear().len();
    let mut penalty = fit.penalty.clone();
    for i in nonlinear_from..columns - 1 {
        penalty[(i, i)] += 1e-6 * total.matrix[(i, i)];
    }
    // How a segment begins is no law that other parts of the record could tell.
    let mut bounds = fit.bounds.clone();
    fit.layout().owed.for_each(|i| bounds[i] = Bounds::fixed(fit.solution[i]));
    let mut squares = vec![0.0; fit.shares.len()];
    let of_fold = |(fold, own): (&Vec<usize>, &Gram)| -> Option<Vec<(usize, f64)>> {
        let others = Gram { matrix: &total.matrix - &own.matrix, rows: total.rows - own.rows };
        let z = solve_near(&others, Some(&penalty), &bounds, Some(&fit.solution))?;
        let error = |b: usize| fit.shares[b].error(if unpredictable[b] { &fit.solution } else { &z });
        Some(fold.iter().map(|b| (*b, error(*b))).collect())
    };
    let found: Vec<Option<Vec<(usize, f64)>>> = folds.par_iter().zip(&own).map(of_fold).collect();
    for found in found {
        found?.into_iter().for_each(|(b, error)| squares[b] = error);
    }
    Some(squares)
}
