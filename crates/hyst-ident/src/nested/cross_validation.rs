//! Cross-validation inside the training record, from the blocks' normal equations.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::Fitted;
use crate::Samples;
use crate::lsq::{Blocks, Bounds, Gram, solve_near};

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
/// them. `grams` and `penalty` are those of the base.
pub(super) fn unpredictable(grams: &[Gram], penalty: &DMatrix<f64>, folds: &[Vec<usize>]) -> Vec<bool> {
    let mut unknown = vec![false; grams.len()];
    let Some(columns) = grams.first().map(|g| g.matrix.ncols()) else { return unknown };
    let n = columns - 1;
    let total = Gram::sum(columns, grams.iter());
    let scale: Vec<f64> = (0..n).map(|i| total.matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let scaled = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |r, c| m[(r, c)] / (scale[r] * scale[c]));
    let prior = scaled(penalty);
    let of_fold = |fold: &Vec<usize>| -> Vec<(usize, bool)> {
        let mut others = scaled(&total.matrix) + &prior;
        fold.iter().for_each(|b| others -= scaled(&grams[*b].matrix));
        (0..n).for_each(|i| others[(i, i)] += 1e-12);
        let inverse = others.cholesky().map(|f| f.inverse());
        // The trace of a product of two symmetric matrices is the sum of their products element by element.
        let spread = |b: usize| inverse.as_ref().map(|inverse| inverse.dot(&scaled(&grams[b].matrix)));
        fold.iter().map(|b| (*b, spread(*b).is_none_or(|s| s > UNKNOWN * grams[*b].rows as f64))).collect()
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
    let columns = fit.grams.first()?.matrix.ncols();
    let total = Gram::sum(columns, fit.grams.iter());
    let nonlinear_from = columns - 1 - fit.hypothesis.nonlinear().len();
    let mut penalty = fit.penalty.clone();
    for i in nonlinear_from..columns - 1 {
        penalty[(i, i)] += 1e-6 * total.matrix[(i, i)];
    }
    // How a segment begins is no law that other parts of the record could tell.
    let mut bounds = fit.bounds.clone();
    fit.layout().owed.for_each(|i| bounds[i] = Bounds::fixed(fit.solution[i]));
    let mut squares = vec![0.0; fit.grams.len()];
    let of_fold = |fold: &Vec<usize>| -> Option<Vec<(usize, f64)>> {
        let mut others = total.clone();
        for b in fold {
            others.matrix -= &fit.grams[*b].matrix;
            others.rows -= fit.grams[*b].rows;
        }
        let z = solve_near(&others, Some(&penalty), &bounds, Some(&fit.solution))?;
        let error = |b: usize| fit.grams[b].error(if unpredictable[b] { &fit.solution } else { &z });
        Some(fold.iter().map(|b| (*b, error(*b))).collect())
    };
    let found: Vec<Option<Vec<(usize, f64)>>> = folds.par_iter().map(of_fold).collect();
    for found in found {
        found?.into_iter().for_each(|(b, error)| squares[b] = error);
    }
    Some(squares)
}
