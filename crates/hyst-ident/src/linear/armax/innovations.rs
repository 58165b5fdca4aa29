//! The errors e of a prediction one row ahead, and those from before the record that they hang on.
//!
//! `C e = A y − B u − d` needs e of the n rows before. A lightly damped structure with noise of the sensor has roots of C as near
//! the unit circle as those of A: taking these e for zero leaves a transient that rings for seconds, a thousand times as large
//! as e itself. They enter linearly, so they are estimated: least squares, with themselves as further errors of the same size.

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
    /// e from the row on from which the recursions have their history.
    pub(super) e: Vec<f64>,
    /// What each of `before` adds to e, as far as it can be seen.
    pub(super) memory: DMatrix<f64>,
}

impl Innovations {
    /// Sum of squares, of those before too.
    pub(super) fn cost(&self) -> f64 {
        self.before.iter().chain(&self.e).map(|e| e * e).sum()
    }
}

impl Polynomials<'_> {
    /// Rows at the start of a stretch that are history only.
    pub(super) fn reach(&self) -> usize {
        self.a.len() + self.delay
    }

    /// The errors of a stretch; `None` where the recursion diverges.
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

/// What one unit of e, 1 … n rows before the first, adds to every e: `C h = 0` from that start, as many rows as it takes to
/// fall below 10⁻⁶ of its greatest.
fn memory(c: &[f64], rows: usize) -> DMatrix<f64> {
    let n = c.len();
    // Row by row; column j has its one j + 1 rows before the first.
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
        // A ringing passes through zero: it is over when it stays there.
        if size > 1e-6 * most {
            kept = t - n + 1;
        } else if t - n > 2 * kept + 50 {
            break;
        }
    }
    DMatrix::from_row_slice(kept, n, &history[n * n..(n + kept) * n])
}
