//! The gain of a new column: by how much it would lower Σ residual².

use hyst_core::Error;
use nalgebra::{DMatrix, DVector};

use super::bounds::bounds_of;
use super::{Fitted, Problem};
use crate::lsq::{Gram, held};

/// Projects columns onto the complement of a fit's columns.
pub(crate) struct Projector<'a> {
    problem: &'a Problem<'a>,
    blocks: Vec<DMatrix<f64>>,
    factor: Option<nalgebra::Cholesky<f64, nalgebra::Dyn>>,
}

impl<'a> Projector<'a> {
    fn new(problem: &'a Problem<'a>, blocks: Vec<DMatrix<f64>>) -> Self {
        let n = blocks.first().map_or(0, |x| x.ncols() - 1);
        let mut h = Gram::of_all(&blocks, n + 1).matrix.view((0, 0), (n, n)).into_owned();
        for i in 0..n {
            // A column of zeros contributes nothing.
            h[(i, i)] = if h[(i, i)] > 0.0 { h[(i, i)] * (1.0 + 1e-9) } else { 1.0 };
        }
        Self { problem, blocks, factor: h.cholesky() }
    }

    /// Returns Σ squares of the part of a column that the fit cannot imitate.
    pub(crate) fn unexplained(&self, column: &[f64]) -> f64 {
        let Some(factor) = &self.factor else { return 0.0 };
        let mut cross = DVector::zeros(factor.l_dirty().ncols());
        let mut own = 0.0;
        for (rows, x) in self.problem.used.iter().zip(&self.blocks) {
            let part = DVector::from_iterator(x.nrows(), rows.iter().map(|k| column[*k]));
            own += part.norm_squared();
            cross += x.columns(0, cross.len()).tr_mul(&part);
        }
        let left = own - cross.dot(&factor.solve(&cross));
        if left <= 1e-9 * own { 0.0 } else { left }
    }

    /// Returns the normal equations of the projected columns over the rows that count, the last column being the
    /// target; `None` if the fit is singular.
    pub(super) fn projected(&self, columns: &DMatrix<f64>) -> Option<Gram> {
        let factor = self.factor.as_ref()?;
        let mut cross = DMatrix::zeros(factor.l_dirty().ncols(), columns.ncols());
        let mut first = 0;
        for x in &self.blocks {
            let (own, x) = (columns.rows(first, x.nrows()), x.columns(0, cross.nrows()));
            match own.ncols() {
                1 => cross.column_mut(0).gemv_tr(1.0, &x, &own.column(0), 1.0),
                // Transposing the few columns costs less than transposing the many.
                _ => cross += (own.transpose() * x).transpose(),
            }
            first += x.nrows();
        }
        let all = Gram::of(columns);
        Some(Gram { matrix: all.matrix - cross.transpose() * factor.solve(&cross), ..all })
    }

    /// Returns the joint gain of some columns in Σ residual², with all unknowns refitted.
    pub(crate) fn joint_gain(&self, columns: &[Vec<f64>], residual: &[f64]) -> f64 {
        let at_used_rows = |column: &[f64]| self.problem.at_used_rows(|k| column[k]);
        let all: Vec<Vec<f64>> = columns.iter().map(|c| at_used_rows(c)).chain([at_used_rows(residual)]).collect();
        let rows = all[0].len();
        let Some(Gram { mut matrix, .. }) = self.projected(&DMatrix::from_fn(rows, all.len(), |k, i| all[i][k])) else {
            return 0.0;
        };
        let n = columns.len();
        let with: DVector<f64> = matrix.view((0, n), (n, 1)).column(0).into_owned();
        for i in 0..n {
            // Regularisation: a column that the fit imitates gains nothing, and equal columns share the gain.
            let own = all[i].iter().map(|x| x * x).sum::<f64>();
            matrix[(i, i)] += 1e-9 * own.max(f64::MIN_POSITIVE);
        }
        let factor = matrix.view((0, 0), (n, n)).into_owned().cholesky();
        factor.map_or(0.0, |factor| with.dot(&factor.solve(&with)))
    }

    /// Returns the gain of a column in Σ residual², with all unknowns refitted, and its best factor.
    pub(crate) fn gain(&self, column: &[f64], residual: &[f64]) -> (f64, f64) {
        let left = self.unexplained(column);
        let with: f64 = self.problem.used.iter().flatten().map(|k| column[*k] * residual[*k]).sum();
        if left > 0.0 { (with * with / left, with / left) } else { (0.0, 0.0) }
    }
}

impl Problem<'_> {
    /// Returns a projector that removes the part of a column that a fit can imitate, nonlinear parameters included.
    pub(crate) fn projector(&self, fit: &Fitted) -> Result<Projector<'_>, Error> {
        let Some(at) = self.assemble(&fit.hypothesis, None)? else { return Ok(Projector::new(self, Vec::new())) };
        let jacobian = self.jacobian(&fit.hypothesis, &at.solution)?;
        let beside = |(x, j): (&DMatrix<f64>, DMatrix<f64>)| {
            let (linear, slopes) = (x.ncols() - 1, j.ncols());
            let mut all = x.clone().insert_columns(linear, slopes, 0.0);
            all.columns_mut(linear, slopes).copy_from(&j);
            all
        };
        let blocks = at.linear.blocks.iter().zip(self.in_blocks(&jacobian)).map(beside);
        let mut blocks: Vec<DMatrix<f64>> = blocks.collect();
        // An unknown at a bound cannot move to first order, so it imitates nothing.
        let mut held = held(at.solution.iter(), &self.bounds(&fit.hypothesis));
        fit.hypothesis.clone().visit_nonlinear(&mut |p| {
            let limit = bounds_of(&p, self.samples);
            held.push(*p.value <= limit.lower || *p.value >= limit.upper);
        });
        for x in &mut blocks {
            (0..held.len()).filter(|i| held[*i]).for_each(|i| x.column_mut(i).fill(0.0));
        }
        Ok(Projector::new(self, blocks))
    }
}
