//! A model and the details of its fit.

use crate::BetweenSamples;
use crate::identify::{Estimate, TableEstimate};
use crate::model::Model;
use crate::optimize::Trials;

/// A model and the details of its fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// Description of the fit: what was searched, what was solved for, and why.
    pub how: String,
    /// Standard errors and correlations of the parameters; `None` if the parameters are elements of a table.
    pub estimate: Option<Estimate>,
    /// How well the record determines the cells of a Preisach triangle and the nodes of a mirror function.
    pub tables: Vec<TableEstimate>,
    /// The searches; `None` if nothing was searched.
    pub trials: Option<Trials>,
    /// Evaluations of the model.
    pub evaluations: u64,
    /// RMS residual for each interpolation of the drive between samples that was tried \[y\].
    /// Each is fitted to all rows; rows that are start-up for any of them do not count. The model uses the better one.
    pub between_samples: Vec<(BetweenSamples, f64)>,
}

impl Fit {
    /// Returns a fit without a search.
    pub fn at_once(model: Model, how: &str) -> Self {
        let (estimate, tables, trials, between_samples) = (None, Vec::new(), None, Vec::new());
        Self { model, how: how.into(), estimate, tables, trials, evaluations: 1, between_samples }
    }
}
