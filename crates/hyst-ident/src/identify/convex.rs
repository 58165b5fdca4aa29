//! Standard errors of a convex fit from its normal equations.

use nalgebra::DMatrix;
use serde::Serialize;

use super::uncertainty::{Estimate, Evidence, MAX_RELATIVE_ERROR, Noise};
use crate::lsq::{Bounds, Gram, held};
use crate::model::ZERO;

/// Mean square of a column, relative to that of all columns, below which no row determines it.
const UNTOUCHED: f64 = 1e-6;

/// Kind of a table's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TableOf {
    /// Cells of a Preisach triangle, and relays that never switch back.
    Cells,
    /// Nodes of a mirror function.
    Nodes,
}

/// How much of a table of weights the record determines.
/// The fit gives undetermined elements the values of their neighbours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableEstimate {
    /// Kind of the elements.
    pub of: TableOf,
    /// Number of elements.
    pub elements: usize,
    /// Number of elements with a standard error below half of the mean element.
    pub determined: usize,
    /// Number of elements held at a bound; they have no standard error.
    pub held: usize,
    /// Number of elements that no row depends on.
    pub untouched: usize,
    /// Mean of all elements \[their unit\].
    pub mean: f64,
    /// Standard error of each element, in the order of the model's file.
    /// `None` if it is held or no row depends on it.
    pub std_errors: Vec<Option<f64>>,
}

impl TableEstimate {
    /// Estimates the table of the first unknowns of a fit, `elements`, with bounds `bounds`; the other unknowns are the
    /// sensor's zeros. `mean` is the mean element, also if the unknowns are differences between elements and a minimum.
    pub(crate) fn of(of: TableOf, elements: &[f64], mean: f64, total: &Gram, bounds: &[Bounds], noise: &Noise) -> Self {
        let (n, unknowns) = (elements.len(), total.unknowns());
        let untouched = untouched(total, n);
        let values: Vec<f64> = (0..unknowns).map(|i| elements.get(i).copied().unwrap_or(0.0)).collect();
        let free = free(&values, total, bounds);
        let named = values.iter().map(|value| (String::new(), *value)).collect();
        let estimate = estimate(named, &vec![mean; unknowns], total, &free, noise);
        let mut std_errors = vec![None; n];
        for (i, p) in free.iter().zip(&estimate.parameters).filter(|(i, _)| **i < n && !untouched[**i]) {
            std_errors[*i] = Some(p.std_error);
        }
        let untouched = untouched.iter().filter(|u| **u).count();
        Self {
            of,
            elements: n,
            determined: std_errors.iter().flatten().filter(|e| **e < MAX_RELATIVE_ERROR * mean).count(),
            held: std_errors.iter().filter(|e| e.is_none()).count() - untouched,
            untouched,
            mean,
            std_errors,
        }
    }

    /// Returns the number of elements that the record determines partly.
    pub fn vague(&self) -> usize {
        self.elements - self.determined - self.held - self.untouched
    }
}

/// Returns which of the first `n` columns no row depends on.
pub(crate) fn untouched(total: &Gram, n: usize) -> Vec<bool> {
    let level = (0..n).map(|i| total.matrix[(i, i)]).sum::<f64>() / n.max(1) as f64;
    (0..n).map(|i| total.matrix[(i, i)] <= UNTOUCHED * level).collect()
}

/// Returns the unknowns that are not held at a bound. An unknown that no row depends on is not held.
pub(crate) fn free(values: &[f64], total: &Gram, bounds: &[Bounds]) -> Vec<usize> {
    let untouched = untouched(total, values.len());
    let held = held(values.iter(), bounds);
    (0..values.len()).filter(|i| untouched[*i] || !held[*i]).collect()
}

/// Returns the standard errors of the `free` ones of `parameters`, the unknowns of `total`; the others are held. The
/// regularisation of the fit is left out, so the errors follow from the record alone.
pub(crate) fn estimate(
    parameters: Vec<(String, f64)>,
    scales: &[f64],
    total: &Gram,
    free: &[usize],
    noise: &Noise,
) -> Estimate {
    let normal = |i: usize, j: usize| total.matrix[(free[i], free[j])] * scales[free[i]] * scales[free[j]];
    let held = (0..parameters.len()).filter(|i| !free.contains(i));
    let n = free.len();
    Estimate::of(Evidence {
        parameters: free.iter().map(|i| parameters[*i].clone()).collect(),
        scales: free.iter().map(|i| scales[*i]).collect(),
        sizes: free.iter().map(|i| scales[*i]).collect(),
        map: DMatrix::identity(n, n),
        normal: DMatrix::from_fn(n, n, normal),
        noise,
        unknowns: n,
        fitted: parameters.iter().filter(|(name, _)| !name.starts_with(ZERO)).count(),
        at_least: vec![0.0; n],
        held: held.map(|i| parameters[i].0.clone()).collect(),
    })
}
