//! Variable projection: the best linear parameters for given values of the others.

use std::sync::Mutex;

use nalgebra::{DMatrix, DVector};

use super::{Family, Linear};
use crate::Samples;
use crate::lsq::{Bounds, Gram, solve};
use crate::optimize::{Cost, Space};

/// A family over a record: what is left when its linear parameters, and one sensor zero or one for each file, are solved for.
pub(crate) struct Projection<'a> {
    family: &'a dyn Family,
    samples: &'a Samples,
    linear: Vec<Linear>,
    /// Of the linear parameters and the zeros.
    pub(super) bounds: Vec<Bounds>,
    /// Rows that count.
    pub(crate) rows: Vec<usize>,
    /// How many of them each segment has.
    pub(super) lengths: Vec<usize>,
    /// File of each of them; all 0 with a shared zero.
    pub(super) group: Vec<usize>,
    /// Sensor zeros.
    pub(super) groups: usize,
    /// Columns for trials, so that a trial allocates none.
    spare: Mutex<Vec<DMatrix<f64>>>,
}

/// The model at some values.
#[derive(Clone, Debug)]
pub(crate) struct Projected {
    /// Linear parameters of the family.
    pub(crate) linear: Vec<f64>,
    /// Sensor zeros: one, or one for each file \[y\].
    pub(crate) zeros: Vec<f64>,
    /// Measured minus predicted, over the rows that count \[y\].
    pub(crate) residual: DVector<f64>,
}

impl Projected {
    pub(crate) fn squares(&self) -> f64 {
        self.residual.norm_squared()
    }
}

impl<'a> Projection<'a> {
    pub(crate) fn new(family: &'a dyn Family, samples: &'a Samples, zero_per_record: bool) -> Self {
        let linear = family.linear();
        let mut bounds: Vec<Bounds> = linear.iter().map(|l| l.bounds).collect();
        let groups = if zero_per_record { samples.files().max(1) } else { 1 };
        bounds.extend(vec![Bounds::FREE; groups]);
        let (mut rows, mut group, mut lengths) = (Vec::new(), Vec::new(), Vec::new());
        for (segment, file) in samples.segments.iter().zip(&samples.file_of_segment) {
            let before = rows.len();
            for k in segment.clone().filter(|k| !samples.settling[*k]) {
                rows.push(k);
                group.push(if zero_per_record { *file } else { 0 });
            }
            lengths.push(rows.len() - before);
        }
        Self { family, samples, linear, bounds, rows, lengths, group, groups, spare: Mutex::new(Vec::new()) }
    }

    fn take(&self) -> DMatrix<f64> {
        let spare = self.spare.lock().ok().and_then(|mut s| s.pop());
        spare.unwrap_or_else(|| DMatrix::zeros(self.samples.len(), self.linear.len()))
    }

    fn give(&self, columns: DMatrix<f64>) {
        if let Ok(mut spare) = self.spare.lock() {
            spare.push(columns);
        }
    }

    /// Normal equations of the columns, the zeros and the output over the rows that count.
    pub(super) fn gram(&self, columns: &DMatrix<f64>) -> Gram {
        let (m, g) = (columns.ncols(), self.groups);
        let n = m + g;
        let mut gram = Gram::zeros(n + 1);
        let mut values = vec![0.0; n + 1];
        for (k, group) in self.rows.iter().zip(&self.group) {
            for (j, value) in values.iter_mut().enumerate().take(m) {
                *value = columns[(*k, j)];
            }
            values[m..n].fill(0.0);
            values[m + group] = 1.0;
            values[n] = self.samples.output[*k];
            for (j, b) in values.iter().enumerate() {
                for (i, a) in values.iter().enumerate().take(j + 1) {
                    gram.matrix[(i, j)] += a * b;
                }
            }
        }
        gram.matrix.fill_lower_triangle_with_upper_triangle();
        gram.rows = self.rows.len();
        gram
    }

    /// The columns at `values` over all rows; `None` if there is no model.
    pub(super) fn columns(&self, values: &[f64]) -> Option<DMatrix<f64>> {
        let mut columns = DMatrix::zeros(self.samples.len(), self.linear.len());
        self.family.columns(values, &mut columns).ok()?;
        Some(columns)
    }

    /// The model at `values`; `None` if there is none or it is not finite.
    pub(crate) fn at(&self, values: &[f64]) -> Option<Projected> {
        let mut columns = self.take();
        let projected = self.family.columns(values, &mut columns).ok().and_then(|()| self.project(&columns));
        self.give(columns);
        projected
    }

    fn project(&self, columns: &DMatrix<f64>) -> Option<Projected> {
        let m = columns.ncols();
        let z = solve(&self.gram(columns), None, &self.bounds)?;
        let residual = DVector::from_iterator(
            self.rows.len(),
            self.rows.iter().zip(&self.group).map(|(k, group)| {
                let mut predicted = z[m + group];
                for j in 0..m {
                    predicted += z[j] * columns[(*k, j)];
                }
                self.samples.output[*k] - predicted
            }),
        );
        let projected = Projected { linear: z.as_slice()[..m].to_vec(), zeros: z.as_slice()[m..].to_vec(), residual };
        projected.squares().is_finite().then_some(projected)
    }
}

/// Root mean square of what is left \[y\], as the cost of a search over the variables.
pub(crate) struct Left<'a> {
    pub(crate) projection: &'a Projection<'a>,
    pub(crate) dimensions: usize,
}

impl Cost for Left<'_> {
    fn costs(&self, points: &[f64], _hopeless: &[f64], costs: &mut [f64]) {
        for (cost, values) in costs.iter_mut().zip(points.chunks_exact(self.dimensions)) {
            let squares = self.projection.at(values).map_or(f64::INFINITY, |p| p.squares());
            *cost = (squares / self.projection.rows.len().max(1) as f64).sqrt();
        }
    }
}

/// The box of a family's variables, `None` if it has none.
pub(crate) fn space(family: &dyn Family) -> Option<Result<Space, crate::optimize::SpaceError>> {
    let variables = family.variables();
    if variables.is_empty() { None } else { Some(Space::new(variables)) }
}
