//! Sequential least squares: updates the triangle of a QR factorisation with a few rows at a time.
//!
//! Shifted copies of an oversampled signal are nearly equal columns. Normal equations square the condition number;
//! orthogonal transformations do not. Only the triangle has to be stored for any number of rows.

use nalgebra::{DMatrix, DVector};

/// Rows per update, as a multiple of the columns.
const PANEL_ROWS: usize = 12;

/// The triangle R of all rows so far; the last column is the target.
pub(super) struct Stacked {
    width: usize,
    panel: DMatrix<f64>,
    filled: usize,
}

impl Stacked {
    /// Creates a triangle for this number of unknowns.
    pub(super) fn new(unknowns: usize) -> Self {
        let width = unknowns + 1;
        Self { width, panel: DMatrix::zeros((1 + PANEL_ROWS) * width, width), filled: width }
    }

    /// Adds a row: `value` returns the regressors, then the target.
    pub(super) fn row(&mut self, value: impl Fn(usize) -> f64) {
        if self.filled == self.panel.nrows() {
            self.reduce();
        }
        (0..self.width).for_each(|c| self.panel[(self.filled, c)] = value(c));
        self.filled += 1;
    }

    fn reduce(&mut self) {
        let rows = self.panel.nrows();
        let triangle = std::mem::replace(&mut self.panel, DMatrix::zeros(0, 0)).qr().unpack_r();
        self.panel = DMatrix::zeros(rows, self.width);
        self.panel.rows_mut(0, self.width).copy_from(&triangle);
        self.filled = self.width;
    }

    /// Eliminates the first `n` unknowns and adds the remaining equations as rows of `to`.
    pub(super) fn eliminate_first(mut self, n: usize, to: &mut Self) {
        self.reduce();
        (n..self.width).for_each(|t| to.row(|p| self.panel[(t, n + p)]));
    }

    /// Returns the triangle of all rows.
    pub(super) fn triangle(mut self) -> Triangle {
        self.reduce();
        let n = self.width - 1;
        let r: DMatrix<f64> = self.panel.view((0, 0), (n, n)).into();
        // Scaled to columns of unit length, because volts, micrometres and the constant differ in size.
        let scale = DVector::from_fn(n, |c, _| match r.column(c).norm() {
            0.0 => 1.0,
            norm => norm,
        });
        let r = DMatrix::from_fn(n, n, |i, j| r[(i, j)] / scale[j]);
        let target = DVector::from_fn(n, |i, _| self.panel[(i, n)]);
        Triangle { r, target, rest: self.panel[(n, n)].powi(2), scale }
    }
}

/// `min |R z − target|² + rest`, columns scaled to unit length.
pub(super) struct Triangle {
    r: DMatrix<f64>,
    target: DVector<f64>,
    /// Minimum sum of squares.
    pub(super) rest: f64,
    scale: DVector<f64>,
}

/// Minimum singular value of a direction that the record determines, as a share of the largest.
const RANK_TOLERANCE: f64 = 1e-11;

impl Triangle {
    /// Returns the solution of `min |R z − target|² + λ |z|²` for the scaled unknowns; `None` if it is not finite.
    pub(super) fn solve(&self, lambda: f64) -> Option<DVector<f64>> {
        let n = self.r.ncols();
        let mut both = DMatrix::zeros(2 * n, n);
        both.rows_mut(0, n).copy_from(&self.r);
        both.rows_mut(n, n).fill_diagonal(lambda.sqrt());
        let mut right = DVector::zeros(2 * n);
        right.rows_mut(0, n).copy_from(&self.target);
        let svd = if lambda > 0.0 { both.svd(true, true) } else { self.r.clone().svd(true, true) };
        let right = if lambda > 0.0 { right } else { self.target.clone() };
        let largest = svd.singular_values.max();
        let z = svd.solve(&right, RANK_TOLERANCE * largest).ok()?.component_div(&self.scale);
        z.iter().all(|z| z.is_finite()).then_some(z)
    }

    /// Returns `(RᵀR)⁻¹` without undetermined directions.
    pub(super) fn inverse_gram(&self) -> Option<DMatrix<f64>> {
        let svd = self.r.clone().svd(false, true);
        let largest = svd.singular_values.max();
        let mut v = svd.v_t?;
        for (i, s) in svd.singular_values.iter().enumerate() {
            let weight = if *s > RANK_TOLERANCE * largest { 1.0 / s } else { 0.0 };
            v.row_mut(i).scale_mut(weight);
        }
        let inverse = v.tr_mul(&v);
        let n = inverse.ncols();
        Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / (self.scale[i] * self.scale[j])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_in_any_number_give_the_least_squares_solution() {
        let x = |k: usize| 1e3 * (0.1 * k as f64).sin();
        let y = |k: usize| 3.0 * x(k) - 2.0 + if k.is_multiple_of(2) { 0.1 } else { -0.1 };
        let mut stacked = Stacked::new(2);
        for k in 0..630 {
            stacked.row(|c| [x(k), 1.0, y(k)][c]);
        }
        let triangle = stacked.triangle();
        let z = triangle.solve(0.0).unwrap();
        assert!((z[0] - 3.0).abs() < 1e-5 && (z[1] + 2.0).abs() < 1e-3, "{z}");
        assert!((triangle.rest - 6.3).abs() < 1e-4, "{}", triangle.rest);
        let covariance = triangle.inverse_gram().unwrap();
        assert!((covariance[(1, 1)] * 630.0 - 1.0).abs() < 1e-3, "{covariance}");
        // With two equal columns, the solution of minimum norm is split equally.
        let mut twice = Stacked::new(2);
        (0..50).for_each(|k| twice.row(|c| [x(k), x(k), x(k)][c]));
        let z = twice.triangle().solve(0.0).unwrap();
        assert!((z[0] - 0.5).abs() < 1e-9 && (z[1] - 0.5).abs() < 1e-9, "{z}");
    }
}
