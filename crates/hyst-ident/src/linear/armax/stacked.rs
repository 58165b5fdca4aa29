//! Least squares whose rows come a few at a time: the triangle of a QR factorisation, kept up to date.
//!
//! Shifted copies of an oversampled signal are nearly the same column. Normal equations would square that condition number;
//! orthogonal transformations do not, and a triangle is all that has to be kept of any number of rows.

use nalgebra::{DMatrix, DVector};

/// Rows that are taken in at once, as multiples of the columns.
const ROWS: usize = 12;

/// The triangle R of all rows seen so far; the last column is the target.
pub(super) struct Stacked {
    width: usize,
    panel: DMatrix<f64>,
    filled: usize,
}

impl Stacked {
    /// For so many unknowns.
    pub(super) fn new(unknowns: usize) -> Self {
        let width = unknowns + 1;
        Self { width, panel: DMatrix::zeros((1 + ROWS) * width, width), filled: width }
    }

    /// One row: `fill` writes the regressors and then the target.
    pub(super) fn row(&mut self, value: impl Fn(usize) -> f64) {
        if self.filled == self.panel.nrows() {
            self.fold();
        }
        (0..self.width).for_each(|c| self.panel[(self.filled, c)] = value(c));
        self.filled += 1;
    }

    fn fold(&mut self) {
        let rows = self.panel.nrows();
        let triangle = std::mem::replace(&mut self.panel, DMatrix::zeros(0, 0)).qr().unpack_r();
        self.panel = DMatrix::zeros(rows, self.width);
        self.panel.rows_mut(0, self.width).copy_from(&triangle);
        self.filled = self.width;
    }

    /// What the rows say about the other unknowns once the first `n` have their best values, as rows of `to`.
    pub(super) fn without_first(mut self, n: usize, to: &mut Self) {
        self.fold();
        (n..self.width).for_each(|t| to.row(|p| self.panel[(t, n + p)]));
    }

    /// The triangle of all rows.
    pub(super) fn triangle(mut self) -> Triangle {
        self.fold();
        let n = self.width - 1;
        let r: DMatrix<f64> = self.panel.view((0, 0), (n, n)).into();
        // Columns of unit length: volts, micrometres and the constant stand side by side.
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
    /// Sum of squares that no solution takes away.
    pub(super) rest: f64,
    scale: DVector<f64>,
}

/// Directions whose singular value is below this share of the largest are not determined by the record.
const RANK: f64 = 1e-11;

impl Triangle {
    /// The solution of `min |R z − target|² + λ |z|²` over the scaled unknowns; `None` if it is not finite.
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
        let z = svd.solve(&right, RANK * largest).ok()?.component_div(&self.scale);
        z.iter().all(|z| z.is_finite()).then_some(z)
    }

    /// `(RᵀR)⁻¹`, undetermined directions left out.
    pub(super) fn inverse_gram(&self) -> Option<DMatrix<f64>> {
        let svd = self.r.clone().svd(false, true);
        let largest = svd.singular_values.max();
        let mut v = svd.v_t?;
        for (i, s) in svd.singular_values.iter().enumerate() {
            let weight = if *s > RANK * largest { 1.0 / s } else { 0.0 };
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
        // A column twice: the smallest solution shares between the two.
        let mut twice = Stacked::new(2);
        (0..50).for_each(|k| twice.row(|c| [x(k), x(k), x(k)][c]));
        let z = twice.triangle().solve(0.0).unwrap();
        assert!((z[0] - 0.5).abs() < 1e-9 && (z[1] - 0.5).abs() < 1e-9, "{z}");
    }
}
