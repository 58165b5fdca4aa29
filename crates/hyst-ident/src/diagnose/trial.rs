//! A fitted set of effects, with its cross-validated errors.

use crate::nested::{Fitted, Problem};

/// A fitted set of effects with its cross-validated errors.
#[derive(Clone)]
pub(crate) struct Trial {
    pub(crate) fit: Fitted,
    /// Σ residual² of each block, predicted from the other blocks.
    pub(crate) blocks: Vec<f64>,
}

impl Trial {
    pub(crate) fn of(problem: &Problem<'_>, fit: Fitted) -> Option<Self> {
        let blocks = problem.cross_validated(&fit)?;
        Some(Self { fit, blocks })
    }

    /// Returns Σ residual² over all blocks, each predicted from the others.
    pub(crate) fn total(&self) -> f64 {
        self.blocks.iter().sum()
    }

    /// Returns the RMS of the cross-validated residual \[output unit\].
    pub(crate) fn cv_rmse(&self) -> f64 {
        (self.total() / self.fit.rows.max(1) as f64).sqrt()
    }
}
