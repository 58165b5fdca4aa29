//! Cross-validation inside the training record, from the normal equations of the blocks.

use std::sync::OnceLock;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::{Fitted, Hypothesis, Problem};
use crate::Samples;
use crate::lsq::{Blocks, Bounds, Gram, Share, folds_interleaved, solve_near};

/// Folds of the cross-validation.
const FOLDS: usize = 8;
/// Number of stretches of a record with a single segment; each is left out once.
const STRETCHES: usize = 4;

/// Returns one fold for each experiment: the segments of a record, or `parts` equal stretches of a record with a single
/// segment. Leaving out whole experiments tests whether a fit transfers.
fn folds_by_experiment(blocks: &Blocks, samples: &Samples, parts: usize) -> Vec<Vec<usize>> {
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

/// Maximum mean variance of the prediction of a block by the other folds, in variances of a row. Above it the block is
/// unpredictable.
const MAX_PREDICTION_VARIANCE: f64 = 1.0;

/// Returns which blocks are unpredictable: they move the base where no block outside their own fold does (a first rise
/// from rest, for example). `shares` and `penalty` are those of the base.
fn unpredictable(shares: &[Share], penalty: &DMatrix<f64>, folds: &[Vec<usize>]) -> Vec<bool> {
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
        // The trace of a product of two symmetric matrices is the sum of the products of their elements.
        let spread = |own: &DMatrix<f64>| inverse.as_ref().map(|inverse| inverse.dot(own));
        let is = |b: usize, own| spread(own).is_none_or(|s| s > MAX_PREDICTION_VARIANCE * shares[b].rows() as f64);
        fold.iter().zip(&own).map(|(b, own)| (*b, is(*b, own))).collect()
    };
    let found: Vec<Vec<(usize, bool)>> = folds.par_iter().map(of_fold).collect();
    found.into_iter().flatten().for_each(|(b, is)| unknown[b] = is);
    unknown
}

/// Returns Σ residual² of each block, predicted by a fit to the blocks of all other folds; fitted for the
/// `unpredictable` blocks.
///
/// The fit to the other folds is one Gauss-Newton step from the fit to all, with every weight and parameter free. This
/// is exact for the linear unknowns and close for the others, since one fold changes the solution only a little.
fn cross_validate(fit: &Fitted, folds: &[Vec<usize>], unpredictable: &[bool]) -> Option<Vec<f64>> {
    let columns = fit.shares.first()?.columns();
    let own: Vec<Gram> =
        folds.par_iter().map(|fold| Share::sum(columns, fold.iter().map(|b| &fit.shares[*b]))).collect();
    let total = Gram::sum(columns, own.iter());
    let nonlinear_from = columns - 1 - fit.hypothesis.nonlinear().len();
    let mut penalty = fit.penalty.clone();
    for i in nonlinear_from..columns - 1 {
        penalty[(i, i)] += 1e-6 * total.matrix[(i, i)];
    }
    // The initial state of a segment cannot be predicted from other parts of the record.
    let mut bounds = fit.bounds.clone();
    fit.layout().initial.for_each(|i| bounds[i] = Bounds::fixed(fit.solution[i]));
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

impl Problem<'_> {
    /// Uses the unpredictable blocks of a problem with another basis over the same rows, so that the errors are
    /// comparable.
    pub(crate) fn with_blocks_of(mut self, other: &Self) -> Self {
        self.unpredictable = OnceLock::from(other.unpredictable().to_vec());
        self
    }

    fn unpredictable(&self) -> &[bool] {
        if let Some(known) = self.unpredictable.get() {
            return known;
        }
        // The same for all trials that are compared: the effects hardly change what moves the base. Computed outside of
        // the cell, because a thread that waits inside may execute another job that enters here again.
        let found = self.unpredictable_in(&folds_interleaved(self.blocks, FOLDS));
        self.unpredictable.get_or_init(|| found)
    }

    /// Returns the blocks that move the base where no block of another fold does.
    fn unpredictable_in(&self, folds: &[Vec<usize>]) -> Vec<bool> {
        let base = self.assemble(&Hypothesis::default(), None).ok().flatten();
        base.map_or_else(
            || vec![false; self.blocks.rows.len()],
            |base| {
                let penalty = self.penalty(&Hypothesis::default(), &base.linear.total, base.solution.len());
                let shares: Vec<Share> = base.linear.blocks.into_iter().map(Share::of).collect();
                unpredictable(&shares, &penalty, folds)
            },
        )
    }

    /// Returns Σ residual² of the whole record for two fits to the blocks of this problem, each experiment predicted by
    /// a fit to the others; the bases of the fits may differ. Returns `None` if the equations cannot be solved or nothing
    /// is predictable.
    pub(crate) fn transferred(&self, fits: [&Fitted; 2]) -> Option<[f64; 2]> {
        let folds = folds_by_experiment(self.blocks, self.samples, STRETCHES);
        let unpredictable = self.unpredictable_in(&folds);
        let [first, second] = fits.map(|fit| cross_validate(fit, &folds, &unpredictable));
        Some([first?.iter().sum(), second?.iter().sum()])
    }

    /// Returns Σ residual² of each block, predicted from the other folds; `None` if the equations cannot be solved.
    pub(crate) fn cross_validated(&self, fit: &Fitted) -> Option<Vec<f64>> {
        cross_validate(fit, &folds_interleaved(self.blocks, FOLDS), self.unpredictable())
    }
}
