//! Computes the best imitation of an effect's signature by another effect, linearised about one choice of its
//! parameters.

use nalgebra::{DMatrix, DVector};

/// One choice of an effect's parameters: its contribution to the output and the derivatives by each parameter.
pub(super) struct Node {
    /// Contribution to the output.
    pub(super) offset: DVector<f64>,
    /// Derivatives, each with the largest step for which it is valid.
    pub(super) columns: Vec<(DVector<f64>, f64)>,
}

impl Node {
    /// Returns the node of an effect that is linear in its parameters.
    pub(super) fn linear(columns: Vec<DVector<f64>>) -> Self {
        let rows = columns.first().map_or(0, |column| column.len());
        Self { offset: DVector::zeros(rows), columns: columns.into_iter().map(|c| (c, f64::INFINITY)).collect() }
    }

    /// Returns the RMS residual of the signature after its best imitation near this node.
    pub(super) fn residual_rms(&self, signature: &DVector<f64>) -> f64 {
        let target = signature - &self.offset;
        let n = self.columns.len();
        // Columns are scaled to unit length, because their units differ.
        let size: Vec<f64> = self.columns.iter().map(|(c, _)| c.norm().max(1e-100)).collect();
        let gram = DMatrix::from_fn(n, n, |i, j| self.columns[i].0.dot(&self.columns[j].0) / (size[i] * size[j]));
        let right = DVector::from_fn(n, |i, _| self.columns[i].0.dot(&target) / size[i]);
        let step = gram.svd(true, true).solve(&right, 1e-9).unwrap_or_else(|_| DVector::zeros(n));
        let mut residual = target;
        for ((column, largest), (z, size)) in self.columns.iter().zip(step.iter().zip(size)) {
            residual.axpy(-(z / size).clamp(-largest, *largest), column, 1.0);
        }
        residual.norm() / (residual.len().max(1) as f64).sqrt()
    }
}
