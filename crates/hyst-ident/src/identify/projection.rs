//! Variable projection: the best linear parameters for given values of the others.

use std::ops::Range;
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
    /// Rows without a gap that count and have one file, at most [`PIECE`] each, with that file.
    pieces: Vec<(Range<usize>, usize)>,
    /// Rooms for trials, so that a trial makes none, each with the thread that it was last used by: what another one has written
    /// lies in another core's cache.
    spare: Mutex<Vec<(Option<usize>, Room)>>,
}

/// Rows whose products are summed up at once: so many of each column stay in the processor's cache.
const PIECE: usize = 256;

/// What a trial writes into.
struct Room {
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
        let mut pieces: Vec<(Range<usize>, usize)> = Vec::new();
        for (k, g) in rows.iter().zip(&group) {
            match pieces.last_mut() {
                Some((piece, own)) if piece.end == *k && own == g && piece.len() < PIECE => piece.end += 1,
                _ => pieces.push((*k..*k + 1, *g)),
            }
        }
        Self { family, samples, linear, bounds, rows, lengths, group, groups, pieces, spare: Mutex::new(Vec::new()) }
    }

    /// Does something in a room for trials, this thread's own.
    fn within<T>(&self, f: impl FnOnce(&mut Room) -> T) -> T {
        let thread = rayon::current_thread_index();
        let own = self.spare.lock().ok().and_then(|mut spare| {
            let place = spare.iter().position(|(last, _)| *last == thread)?;
            Some(spare.swap_remove(place).1)
        });
        let mut room = own.unwrap_or_else(|| Room {
            columns: DMatrix::zeros(self.samples.len(), self.linear.len()),
            gram: Gram::zeros(self.linear.len() + self.groups + 1),
        });
        let result = f(&mut room);
        if let Ok(mut spare) = self.spare.lock() {
            spare.push((thread, room));
        }
        result
    }

    /// Normal equations of the columns, the zeros and the output over the rows that count.
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

    /// The columns at `values` over all rows; `None` if there is no model.
    pub(super) fn columns(&self, values: &[f64]) -> Option<DMatrix<f64>> {
        let mut columns = DMatrix::zeros(self.samples.len(), self.linear.len());
        self.family.columns(values, &mut columns).ok()?;
        Some(columns)
    }

    /// The model at `values`; `None` if there is none or it is not finite.
    pub(crate) fn at(&self, values: &[f64]) -> Option<Projected> {
        self.within(|room| {
            let z = self.solved(values, room)?;
            let m = self.linear.len();
            let mut residual = Vec::with_capacity(self.rows.len());
            self.left(&room.columns, &z, |piece| residual.extend_from_slice(piece));
            let residual = DVector::from_vec(residual);
            let projected =
                Projected { linear: z.as_slice()[..m].to_vec(), zeros: z.as_slice()[m..].to_vec(), residual };
            projected.squares().is_finite().then_some(projected)
        })
    }

    /// Output over the rows that count with these linear parameters, without the zeros; `None` if there is no model.
    pub(super) fn output(&self, values: &[f64], linear: &[f64]) -> Option<Vec<f64>> {
        self.within(|room| {
            self.family.columns(values, &mut room.columns).ok()?;
            let row = |k: &usize| linear.iter().enumerate().map(|(j, l)| l * room.columns[(*k, j)]).sum();
            Some(self.rows.iter().map(row).collect())
        })
    }

    /// Columns and normal equations at `values`, and the best linear parameters and zeros for them.
    fn solved(&self, values: &[f64], room: &mut Room) -> Option<DVector<f64>> {
        self.family.columns(values, &mut room.columns).ok()?;
        self.gram_into(&room.columns, &mut room.gram);
        solve(&room.gram, None, &self.bounds)
    }

    /// Measured minus predicted in the rows that count, piece after piece.
    fn left(&self, columns: &DMatrix<f64>, z: &DVector<f64>, mut f: impl FnMut(&[f64])) {
        let (m, mut room) = (columns.ncols(), [0.0; PIECE]);
        for (piece, group) in &self.pieces {
            let left = &mut room[..piece.len()];
            left.iter_mut().zip(&self.samples.output[piece.clone()]).for_each(|(r, y)| *r = y - z[m + group]);
            for j in 0..m {
                let (weight, column) = (z[j], &column(columns, j)[piece.clone()]);
                left.iter_mut().zip(column).for_each(|(r, x)| *r -= weight * x);
            }
            f(left);
        }
    }

    /// Σ (measured − predicted)² at `values`, infinite if there is no model.
    pub(super) fn squares(&self, values: &[f64]) -> f64 {
        self.within(|room| {
            let z = self.solved(values, room)?;
            let mut sum = 0.0;
            self.left(&room.columns, &z, |piece| sum += dot(piece, piece));
            Some(sum)
        })
        .filter(|squares: &f64| squares.is_finite())
        .unwrap_or(f64::INFINITY)
    }
}

/// A column's rows.
fn column(columns: &DMatrix<f64>, j: usize) -> &[f64] {
    &columns.as_slice()[j * columns.nrows()..][..columns.nrows()]
}

/// Σ aᵢ bᵢ in four sums side by side, which the compiler makes one instruction of; the same on every processor.
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

/// Root mean square of what is left \[y\], as the cost of a search over the variables.
pub(crate) struct Left<'a> {
    pub(crate) projection: &'a Projection<'a>,
    pub(crate) dimensions: usize,
}

impl Cost for Left<'_> {
    /// No trial is given up: the linear parameters make up for the others so well over the first rows that an eighth of a record
    /// rules out no more than a tenth of the trials of most families, and would be run twice for the rest.
    fn costs(&self, points: &[f64], _hopeless: &[f64], costs: &mut [f64]) {
        let rows = self.projection.rows.len().max(1) as f64;
        for (cost, values) in costs.iter_mut().zip(points.chunks_exact(self.dimensions)) {
            *cost = (self.projection.squares(values) / rows).sqrt();
        }
    }
}

/// The box of a family's variables, `None` if it has none.
pub(crate) fn space(family: &dyn Family) -> Option<Result<Space, crate::optimize::SpaceError>> {
    let variables = family.variables();
    if variables.is_empty() { None } else { Some(Space::new(variables)) }
}
