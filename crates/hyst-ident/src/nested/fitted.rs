//! The result of a fit.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::{Hypothesis, Layout};
use crate::lsq::{Bounds, Share};

/// A converged fit.
#[derive(Clone)]
pub(crate) struct Fitted {
    pub(crate) hypothesis: Hypothesis,
    pub(crate) weights: Vec<f64>,
    /// One zero, or one for each file.
    pub(crate) zeros: Vec<f64>,
    /// Σ residual² over the rows that count.
    pub(crate) squares: f64,
    pub(crate) rows: usize,
    /// Contribution of each block to the normal equations at the solution. Columns: the linear unknowns in the order of
    /// their [`Layout`], the derivatives with respect to the nonlinear parameters, and the measured output. This is
    /// most of the memory of a fit, so copies share it.
    pub(crate) shares: Arc<[Share]>,
    pub(crate) solution: DVector<f64>,
    pub(crate) bounds: Vec<Bounds>,
    /// Penalty of the same unknowns.
    pub(crate) penalty: DMatrix<f64>,
}

impl Fitted {
    /// Returns the RMS of the residual over the rows that count \[y\].
    pub(crate) fn rmse(&self) -> f64 {
        (self.squares / self.rows.max(1) as f64).sqrt()
    }

    /// Returns the positions of the linear unknowns.
    pub(crate) fn layout(&self) -> Layout {
        let of = |initial| Layout::of(&self.hypothesis, self.weights.len(), self.zeros.len(), initial);
        let linear = self.solution.len() - self.hypothesis.nonlinear().len();
        of(linear - of(0).len())
    }
}
