//! What the normal equations of a convex fit say about its unknowns.

use nalgebra::DMatrix;
use serde::Serialize;

use super::uncertainty::{Estimate, Evidence, Noise, VAGUE};
use crate::lsq::{Bounds, Gram, held};
use crate::model::ZERO;

/// A column with less than this share of the mean square of all is touched by no row.
const UNTOUCHED: f64 = 1e-6;

/// What a table's elements are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TableOf {
    /// Cells of a Preisach triangle, and relays that never switch back.
    Cells,
    /// Nodes of a mirror function.
    Nodes,
}

/// How much of a table of many weights a record determines by itself. The fit gives the others the values of their neighbours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableEstimate {
    /// What its elements are.
    pub of: TableOf,
    /// How many there are.
    pub elements: usize,
    /// Those whose standard error is below half of the mean element.
    pub determined: usize,
    /// Those at a bound: they are held there, and have no error.
    pub held: usize,
    /// Those that no row touches.
    pub untouched: usize,
    /// Mean of all elements \[their unit\].
    pub mean: f64,
    /// Standard error of each, in the order of the model's file; `None` of one that is held or that no row touches.
    pub std_errors: Vec<Option<f64>>,
}

impl TableEstimate {
    /// Of the first unknowns of a fit, `elements`, whose bounds are `bounds`; the unknowns behind them are zeros of the sensor.
    /// `mean` is the mean element where the unknowns are not the elements themselves but what they are above one.
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
            determined: std_errors.iter().flatten().filter(|e| **e < VAGUE * mean).count(),
            held: std_errors.iter().filter(|e| e.is_none()).count() - untouched,
            untouched,
            mean,
            std_errors,
        }
    }

    /// Those that the record says something about, but too little to determine them.
    pub fn vague(&self) -> usize {
        self.elements - self.determined - self.held - self.untouched
    }
}

/// Which of the first `n` columns no row touches.
pub(crate) fn untouched(total: &Gram, n: usize) -> Vec<bool> {
    let level = (0..n).map(|i| total.matrix[(i, i)]).sum::<f64>() / n.max(1) as f64;
    (0..n).map(|i| total.matrix[(i, i)] <= UNTOUCHED * level).collect()
}

/// Unknowns that are not held at a bound. One that no row touches is not held: nothing has pushed it there.
pub(crate) fn free(values: &[f64], total: &Gram, bounds: &[Bounds]) -> Vec<usize> {
    let untouched = untouched(total, values.len());
    let held = held(values.iter(), bounds);
    (0..values.len()).filter(|i| untouched[*i] || !held[*i]).collect()
}

/// Standard errors of the `free` ones of `parameters`, the unknowns of `total`; the others are held. What the fit adds so that
/// weights which the record hardly tells apart do not alternate is left out: these errors are what the record alone says.
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
