//! The best imitation of a mark by another effect, linearised around one choice of its parameters.

use nalgebra::{DMatrix, DVector};

/// One choice of an effect's parameters: what it adds to the output there, and how that changes with each parameter.
pub(super) struct Node {
    /// What is added.
    pub(super) offset: DVector<f64>,
    /// Derivatives, each with the farthest step that it is good for.
    pub(super) columns: Vec<(DVector<f64>, f64)>,
}

impl Node {
    /// An effect that is linear in its parameters.
    pub(super) fn linear(columns: Vec<DVector<f64>>) -> Self {
        let rows = columns.first().map_or(0, |column| column.len());
        Self { offset: DVector::zeros(rows), columns: columns.into_iter().map(|c| (c, f64::INFINITY)).collect() }
    }

    /// Root mean square of what the best imitation around this node misses of the mark.
    pub(super) fn misses(&self, mark: &DVector<f64>) -> f64 {
        let wanted = mark - &self.offset;
        let n = self.columns.len();
        // Columns of unit length: their units have nothing in common.
        let size: Vec<f64> = self.columns.iter().map(|(c, _)| c.norm().max(1e-100)).collect();
        let gram = DMatrix::from_fn(n, n, |i, j| self.columns[i].0.dot(&self.columns[j].0) / (size[i] * size[j]));
        let right = DVector::from_fn(n, |i, _| self.columns[i].0.dot(&wanted) / size[i]);
        let step = gram.svd(true, true).solve(&right, 1e-9).unwrap_or_else(|_| DVector::zeros(n));
        let mut left = wanted;
        for ((column, farthest), (z, size)) in self.columns.iter().zip(step.iter().zip(size)) {
            left.axpy(-(z / size).clamp(-farthest, *farthest), column, 1.0);
        }
        left.norm() / (left.len().max(1) as f64).sqrt()
    }
}
