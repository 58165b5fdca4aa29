//! Variable projection: the best linear parameters for given values of the others.

use std::ops::Range;
use std::sync::Mutex;

use nalgebra::{DMatrix, DVector};

use super::{Family, Linear};
use crate::Samples;
use crate::lsq::{Bounds, Gram, solve};
use crate::optimize::{Cost, Space};

/// A family over a record: solves the linear parameters and the sensor's zeros, and returns the residual.
pub(crate) struct Projection<'a> {
    family: &'a dyn Family,
    samples: &'a Samples,
    linear: Vec<Linear>,
    /// Bounds of the linear parameters and the zeros.
    pub(super) bounds: Vec<Bounds>,
    /// Rows that count.
    pub(crate) rows: Vec<usize>,
    /// Number of rows that count in each segment.
    pub(super) lengths: Vec<usize>,
    /// File of each row that counts; 0 for all with a shared zero.
    pub(super) group: Vec<usize>,
    /// Number of sensor zeros.
    pub(super) groups: usize,
    /// Contiguous rows that count, of one file, at most [`MAX_PIECE_ROWS`] each, with that file.
    pieces: Vec<(Range<usize>, usize)>,
    /// Buffers for trials, so that a trial allocates none. Each is stored with the thread that used it last, because
    /// its data is in the cache of that core.
    spare: Mutex<Vec<(Option<usize>, Buffers)>>,
}

/// Maximum number of rows whose products are summed at once, so that they stay in the cache.
const MAX_PIECE_ROWS: usize = 256;

/// Buffers of a trial.
struct Buffers {
    columns: DMatrix<f64>,
    gram: Gram,
}

/// The model at some values.
#[derive(Clone, Debug)]
pub(crate) struct Projected {
    /// Linear parameters of the family.
    pub(crate) linear: Vec<f64>,
    /// Sensor zeros: one, or one for each file \[y\].
    pub(crate) zeros: Vec<f64>,
    /// Measured minus predicted output over the rows that count \[y\].
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
        let mut pieces: Vec<(Range<usize>, usize)> = Vec::new();
        for (k, g) in rows.iter().zip(&group) {
            match pieces.last_mut() {
                Some((piece, own)) if piece.end == *k && own == g && piece.len() < MAX_PIECE_ROWS => piece.end += 1,
                _ => pieces.push((*k..*k + 1, *g)),
            }
        }
        Self { family, samples, linear, bounds, rows, lengths, group, groups, pieces, spare: Mutex::new(Vec::new()) }
    }

    /// Runs `f` with a buffer of this thread.
    fn within<T>(&self, f: impl FnOnce(&mut Buffers) -> T) -> T {
        let thread = rayon::current_thread_index();
        let own = self.spare.lock().ok().and_then(|mut spare| {
            let place = spare.iter().position(|(last, _)| *last == thread)?;
            Some(spare.swap_remove(place).1)
        });
        let mut buffers = own.unwrap_or_else(|| Buffers {
            columns: DMatrix::zeros(self.samples.len(), self.linear.len()),
            gram: Gram::zeros(self.linear.len() + self.groups + 1),
        });
        let result = f(&mut buffers);
        if let Ok(mut spare) = self.spare.lock() {
            spare.push((thread, buffers));
        }
        result
    }

    /// Returns the normal equations of the columns, the zeros and the output over the rows that count.
    pub(super) fn gram(&self, columns: &DMatrix<f64>) -> Gram {
        let mut gram = Gram::zeros(columns.ncols() + self.groups + 1);
        self.gram_into(columns, &mut gram);
        gram
    }

    fn gram_into(&self, columns: &DMatrix<f64>, gram: &mut Gram) {
        let m = columns.ncols();
        let n = m + self.groups;
        gram.matrix.fill(0.0);
        gram.rows = 0;
        let column = |j: usize, piece: &Range<usize>| {
            let all = if j < m { column(columns, j) } else { &self.samples.output[..] };
            &all[piece.clone()]
        };
        for (piece, group) in &self.pieces {
            for j in 0..=m {
                let b = column(j, piece);
                let to = if j < m { j } else { n };
                for i in 0..(j + 1).min(m) {
                    gram.matrix[(i, to)] += dot(column(i, piece), b);
                }
                let sum: f64 = b.iter().sum();
                if j < m {
                    gram.matrix[(j, m + group)] += sum;
                } else {
                    gram.matrix[(m + group, n)] += sum;
                    gram.matrix[(n, n)] += dot(b, b);
                }
            }
            gram.matrix[(m + group, m + group)] += piece.len() as f64;
            gram.rows += piece.len();
        }
        gram.matrix.fill_lower_triangle_with_upper_triangle();
    }

    /// Returns the columns at `values` over all rows; `None` if there is no model.
    pub(super) fn columns(&self, values: &[f64]) -> Option<DMatrix<f64>> {
        let mut columns = DMatrix::zeros(self.samples.len(), self.linear.len());
        self.family.columns(values, &mut columns).ok()?;
        Some(columns)
    }

    /// Returns the model at `values`; `None` if there is none or it is not finite.
    pub(crate) fn at(&self, values: &[f64]) -> Option<Projected> {
        self.within(|buffers| {
            let z = self.solved(values, buffers)?;
            let m = self.linear.len();
            let mut residual = Vec::with_capacity(self.rows.len());
            self.left(&buffers.columns, &z, |piece| residual.extend_from_slice(piece));
            let residual = DVector::from_vec(residual);
            let projected =
                Projected { linear: z.as_slice()[..m].to_vec(), zeros: z.as_slice()[m..].to_vec(), residual };
            projected.squares().is_finite().then_some(projected)
        })
    }

    /// Returns the output over the rows that count with these linear parameters and no zeros; `None` if there is no
    /// model.
    pub(super) fn output(&self, values: &[f64], linear: &[f64]) -> Option<Vec<f64>> {
        self.within(|buffers| {
            self.family.columns(values, &mut buffers.columns).ok()?;
            let row = |k: &usize| linear.iter().enumerate().map(|(j, l)| l * buffers.columns[(*k, j)]).sum();
            Some(self.rows.iter().map(row).collect())
        })
    }

    /// Computes columns and normal equations at `values`, and returns the best linear parameters and zeros.
    fn solved(&self, values: &[f64], buffers: &mut Buffers) -> Option<DVector<f64>> {
        self.family.columns(values, &mut buffers.columns).ok()?;
        self.gram_into(&buffers.columns, &mut buffers.gram);
        solve(&buffers.gram, None, &self.bounds)
    }

    /// Passes measured minus predicted output to `f`, piece by piece.
    fn left(&self, columns: &DMatrix<f64>, z: &DVector<f64>, mut f: impl FnMut(&[f64])) {
        let (m, mut buffers) = (columns.ncols(), [0.0; MAX_PIECE_ROWS]);
        for (piece, group) in &self.pieces {
            let left = &mut buffers[..piece.len()];
            left.iter_mut().zip(&self.samples.output[piece.clone()]).for_each(|(r, y)| *r = y - z[m + group]);
            for j in 0..m {
                let (weight, column) = (z[j], &column(columns, j)[piece.clone()]);
                left.iter_mut().zip(column).for_each(|(r, x)| *r -= weight * x);
            }
            f(left);
        }
    }

    /// Returns Σ (measured − predicted)² at `values`; infinite if there is no model.
    pub(super) fn squares(&self, values: &[f64]) -> f64 {
        self.within(|buffers| {
            let z = self.solved(values, buffers)?;
            let mut sum = 0.0;
            self.left(&buffers.columns, &z, |piece| sum += dot(piece, piece));
            Some(sum)
        })
        .filter(|squares: &f64| squares.is_finite())
        .unwrap_or(f64::INFINITY)
    }
}

/// Returns the rows of a column.
fn column(columns: &DMatrix<f64>, j: usize) -> &[f64] {
    &columns.as_slice()[j * columns.nrows()..][..columns.nrows()]
}

/// Returns Σ aᵢ bᵢ in four partial sums, which the compiler vectorises; identical on every processor.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// RMS of the residual \[y\], as the cost of a search over the variables.
pub(crate) struct ResidualRms<'a> {
    pub(crate) projection: &'a Projection<'a>,
    pub(crate) dimensions: usize,
}

impl Cost for ResidualRms<'_> {
    /// No trial is stopped early. With the linear parameters, an eighth of a record rules out at most a tenth of the
    /// trials of most families, and the others would be run twice.
    fn costs(&self, points: &[f64], _hopeless: &[f64], costs: &mut [f64]) {
        let rows = self.projection.rows.len().max(1) as f64;
        for (cost, values) in costs.iter_mut().zip(points.chunks_exact(self.dimensions)) {
            *cost = (self.projection.squares(values) / rows).sqrt();
        }
    }
}

/// Returns the box of a family's variables; `None` if it has none.
pub(crate) fn space(family: &dyn Family) -> Option<Result<Space, crate::optimize::SpaceError>> {
    let variables = family.variables();
    if variables.is_empty() { None } else { Some(Space::new(variables)) }
}
