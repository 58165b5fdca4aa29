//! Columns of the basis for a drive: kept if they fit into memory, otherwise recomputed when needed.

use std::borrow::Cow;
use std::ops::Range;

use rayon::prelude::*;

use crate::Samples;
use crate::base::{Basis, Drag, SIDE_BY_SIDE, past};

/// Maximum number of values that are kept: 64 MB.
const MAX_KEPT_VALUES: usize = 8_000_000;
/// Maximum number of values that are computed in one pass over a drive, unless [`SIDE_BY_SIDE`] columns are more: 16
/// MB.
const MAX_VALUES_PER_PASS: usize = 2_000_000;
/// Number of rows that stay in the cache while many columns are added.
const ROWS_IN_CACHE: usize = 2048;

/// Returns whether the columns of a basis of this width are kept for this number of rows.
pub(super) fn may_be_kept(rows: usize, width: usize) -> bool {
    rows.saturating_mul(width) <= MAX_KEPT_VALUES
}

/// Returns the indices of the columns that are computed in each pass, in order.
pub(super) fn passes(basis: &dyn Basis, rows: usize) -> Vec<Range<usize>> {
    let (width, together) = (basis.len(), basis.together().min(MAX_VALUES_PER_PASS / rows.max(1)).max(SIDE_BY_SIDE));
    (0..width).step_by(together).map(|first| first..(first + together).min(width)).collect()
}

/// Columns of a basis for one drive.
pub(super) enum BaseColumns<'a> {
    Kept(Cow<'a, [Vec<f64>]>),
    Made { samples: &'a Samples, basis: &'a dyn Basis, drive: Vec<f64>, pasts: Cow<'a, [Vec<f64>]>, drag: Drag },
}

impl BaseColumns<'_> {
    /// Applies `f` to all columns, a few at a time, in order.
    pub(super) fn map<T: Send>(&self, f: impl Fn(Vec<Vec<f64>>) -> T + Sync) -> Vec<T> {
        match self {
            Self::Kept(columns) => columns.par_chunks(2 * SIDE_BY_SIDE).map(|columns| f(columns.to_vec())).collect(),
            Self::Made { samples, basis, drive, pasts, drag } => {
                let passes = passes(*basis, samples.len());
                let some = |of| past::columns(*basis, of, drive, &samples.segments, pasts, drag);
                passes.into_par_iter().map(|of| f(some(of))).collect()
            }
        }
    }

    /// Returns the values of all columns in these rows, which ascend, in order.
    pub(super) fn at_rows(&self, rows: &[usize]) -> Vec<Vec<f64>> {
        match self {
            Self::Kept(columns) => columns.iter().map(|column| rows.iter().map(|k| column[*k]).collect()).collect(),
            Self::Made { samples, basis, drive, pasts, drag } => {
                let parts = passes(*basis, rows.len());
                let some = |of| past::columns_at(*basis, of, (drive, &samples.segments, pasts), drag, rows);
                parts.into_par_iter().map(some).flatten_iter().collect()
            }
        }
    }

    /// Returns Σ wᵢ φᵢ over the rows of a record.
    pub(super) fn combined(&self, weights: &[f64], rows: usize) -> Vec<f64> {
        match self {
            Self::Kept(columns) => {
                let mut v = vec![0.0; rows];
                v.par_chunks_mut(ROWS_IN_CACHE).enumerate().for_each(|(i, v)| {
                    let own = ROWS_IN_CACHE * i..ROWS_IN_CACHE * i + v.len();
                    for (w, column) in weights.iter().zip(columns.iter()) {
                        v.iter_mut().zip(&column[own.clone()]).for_each(|(v, x)| *v += w * x);
                    }
                });
                v
            }
            Self::Made { samples, basis, drive, pasts, drag } => {
                let combined = past::combined(*basis, weights, drive, &samples.segments, pasts, drag);
                combined.unwrap_or_else(|| {
                    let passes = passes(*basis, samples.len());
                    let part = |of: Range<usize>| {
                        let columns = past::columns(*basis, of.clone(), drive, &samples.segments, pasts, drag);
                        Self::Kept(Cow::Owned(columns)).combined(&weights[of], rows)
                    };
                    let mut v = vec![0.0; rows];
                    // A few at a time, independent of the number of threads: each is as long as the record.
                    for some in passes.chunks(SIDE_BY_SIDE) {
                        let parts: Vec<Vec<f64>> = some.par_iter().cloned().map(part).collect();
                        parts.iter().for_each(|part| v.iter_mut().zip(part).for_each(|(v, x)| *v += x));
                    }
                    v
                })
            }
        }
    }
}
