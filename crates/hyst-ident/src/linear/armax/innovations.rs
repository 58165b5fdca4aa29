//! Computes the one-step prediction errors e, and the errors before the record on which they depend.
//!
//! `C e = A y − B u − d` needs e of the n rows before. With a lightly damped structure and sensor noise, the roots of C
//! are as close to the unit circle as those of A. With e = 0 before the record, the error has a transient that rings
//! for seconds and is a thousand times larger than e. These e enter linearly, so they are estimated by least squares,
//! with themselves as further residuals of the same variance.

use nalgebra::DMatrix;

use super::stacked::Stacked;

/// The polynomials of a model.
#[derive(Clone, Copy)]
pub(super) struct Polynomials<'a> {
    pub(super) a: &'a [f64],
    pub(super) b: &'a [f64],
    pub(super) c: &'a [f64],
    pub(super) offset: f64,
    pub(super) delay: usize,
}

/// The errors of one stretch.
pub(super) struct Innovations {
    /// e of the n rows before the first, the latest first.
    pub(super) before: Vec<f64>,
    /// e from the first row with a complete history.
    pub(super) e: Vec<f64>,
    /// Contribution of each of `before` to e, until it has decayed.
    pub(super) memory: DMatrix<f64>,
}

impl Innovations {
    /// Returns the sum of squares, with those before.
    pub(super) fn cost(&self) -> f64 {
        self.before.iter().chain(&self.e).map(|e| e * e).sum()
    }
}

impl Polynomials<'_> {
    /// Returns the number of rows at the start of a stretch that are only history.
    pub(super) fn reach(&self) -> usize {
        self.a.len() + self.delay
    }

    /// Returns the errors of a stretch; `None` if the recursion diverges.
    pub(super) fn innovations(&self, u: &[f64], y: &[f64]) -> Option<Innovations> {
        let from = self.reach().min(y.len());
        let n = self.a.len();
        let mut e: Vec<f64> = Vec::with_capacity(y.len() - from);
        for t in from..y.len() {
            let ar: f64 = self.a.iter().zip(1..).map(|(a, i)| a * y[t - i]).sum();
            let x: f64 = self.b.iter().zip(self.delay..).map(|(b, i)| b * u[t - i]).sum();
            let ma: f64 = self.c.iter().zip(e.iter().rev()).map(|(c, e)| c * e).sum();
            e.push(y[t] + ar - x - self.offset - ma);
        }
        if !e.last().is_none_or(|e| e.is_finite()) {
            return None;
        }
        let memory = memory(self.c, e.len());
        let mut stacked = Stacked::new(n);
        for (t, e) in e.iter().enumerate().take(memory.nrows()) {
            stacked.row(|p| if p == n { -e } else { memory[(t, p)] });
        }
        (0..n).for_each(|i| stacked.row(|p| f64::from(u8::from(p == i))));
        let before = stacked.triangle().solve(0.0)?;
        for (t, e) in e.iter_mut().enumerate().take(memory.nrows()) {
            *e += memory.row(t).iter().zip(before.iter()).map(|(m, b)| m * b).sum::<f64>();
        }
        e.iter().all(|e| e.is_finite()).then(|| Innovations { before: before.as_slice().to_vec(), e, memory })
    }
}

/// Returns the contribution of a unit e, 1 … n rows before the first, to every e: the solution of `C h = 0`, until it
/// falls below 10⁻⁶ of its maximum.
fn memory(c: &[f64], rows: usize) -> DMatrix<f64> {
    let n = c.len();
    // Row by row; column j contains the 1 in the row j + 1 before the first.
    let mut history = vec![0.0; (n + rows) * n];
    (0..n).for_each(|j| history[(n - 1 - j) * n + j] = 1.0);
    let (mut most, mut kept) = (0.0_f64, 0);
    for t in n..n + rows {
        let (past, now) = history.split_at_mut(t * n);
        let now = &mut now[..n];
        for (c, row) in c.iter().zip(past.rchunks_exact(n)) {
            now.iter_mut().zip(row).for_each(|(h, before)| *h -= c * before);
        }
        let size = now.iter().fold(0.0_f64, |most, h| most.max(h.abs()));
        most = most.max(size);
        // Ringing passes through 0: it has decayed when it stays small.
        if size > 1e-6 * most {
            kept = t - n + 1;
        } else if t - n > 2 * kept + 50 {
            break;
        }
    }
    DMatrix::from_row_slice(kept, n, &history[n * n..(n + kept) * n])
}
