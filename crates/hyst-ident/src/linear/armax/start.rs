//! Starts of the search for an ARMAX model.

use std::ops::Range;

use nalgebra::DVector;

use super::prediction::{Shape, Signals};
use super::stacked::Stacked;
use crate::linear::roots::reflected;

/// Passes of the reduction; it converges in three or four.
const PASSES: usize = 8;

/// A long ARX model `A y = q⁻ᵏ B u + d + e`: a linear fit that is accurate enough for a start, with any structure and
/// any disturbance.
pub(super) struct LongArx {
    order: usize,
    delay: usize,
    /// a₁ … , b₀ … , d
    theta: DVector<f64>,
}

/// Returns a regressor of the equation error: `y(t) = Σ −aᵢ y(t − i) + Σ bᵢ u(t − k − i) + d`.
fn regressor(u: &[f64], y: &[f64], t: usize, p: usize, order: usize, delay: usize) -> f64 {
    match p {
        p if p < order => -y[t - 1 - p],
        p if p <= 2 * order => u[t - delay - (p - order)],
        _ => 1.0,
    }
}

impl LongArx {
    /// Fits a model of three times the order, at least 20, as far as the rows allow.
    pub(super) fn fit(signals: &Signals, shape: Shape) -> Option<Self> {
        let longest = signals.rows.iter().map(ExactSizeIterator::len).max()?;
        let order = (3 * shape.n).max(20).min((longest / 12).max(shape.n));
        let delay = shape.delay;
        let mut stacked = Stacked::new(2 * order + 2);
        for rows in &signals.rows {
            let (u, y) = signals.of(rows);
            for t in order + delay..rows.len() {
                stacked.row(|p| if p == 2 * order + 2 { y[t] } else { regressor(u, y, t, p, order, delay) });
            }
        }
        Some(Self { order, delay, theta: stacked.triangle().solve(0.0)? })
    }

    fn parts(&self) -> (&[f64], &[f64], f64) {
        let theta = self.theta.as_slice();
        (&theta[..self.order], &theta[self.order..2 * self.order + 1], theta[2 * self.order + 1])
    }

    /// Returns the prediction errors in one stretch; 0 in the rows without history.
    fn errors(&self, signals: &Signals, rows: &Range<usize>) -> Vec<f64> {
        let (u, y) = signals.of(rows);
        let predicted = |t: usize| {
            self.theta.iter().enumerate().map(|(p, x)| x * regressor(u, y, t, p, self.order, self.delay)).sum::<f64>()
        };
        (0..rows.len()).map(|t| if t < self.order + self.delay { 0.0 } else { y[t] - predicted(t) }).collect()
    }

    /// Returns the start with its prediction errors in place of e.
    pub(super) fn extended(&self, signals: &Signals, shape: Shape) -> Option<DVector<f64>> {
        let (n, delay) = (shape.n, shape.delay);
        let mut stacked = Stacked::new(shape.unknowns());
        for rows in &signals.rows {
            let (u, y) = signals.of(rows);
            let e = self.errors(signals, rows);
            for t in self.order + delay + n..rows.len() {
                stacked.row(|p| match p {
                    p if p <= 2 * n => regressor(u, y, t, p, n, delay),
                    p if p <= 3 * n => e[t - (p - 2 * n)],
                    p if p == 3 * n + 1 => 1.0,
                    _ => y[t],
                });
            }
        }
        Some(shape.with_stable_c(stacked.triangle().solve(0.0)?))
    }

    /// Returns the start with the simulated output of this model and C = A.
    ///
    /// The equation error is the simulation error times A, which is almost 0 at the modes. Each pass divides input and
    /// output by A of the previous pass, so the last pass minimises the simulation error.
    pub(super) fn reduced(&self, signals: &Signals, shape: Shape) -> Option<DVector<f64>> {
        let (n, delay) = (shape.n, shape.delay);
        let simulated: Vec<Vec<f64>> = signals.rows.iter().map(|rows| self.simulated(signals, rows)).collect();
        let mut a = vec![0.0; n];
        let mut theta = None;
        for pass in 0..PASSES {
            let mut stacked = Stacked::new(2 * n + 2);
            for (rows, x) in signals.rows.iter().zip(&simulated) {
                let (u, y) = signals.of(rows);
                // The last passes use the record itself, because the long model is not exact.
                let x = if pass < PASSES / 2 { x } else { y };
                let (u, x) = (filtered(u, &a), filtered(x, &a));
                for t in n + delay..rows.len() {
                    stacked.row(|p| if p == 2 * n + 2 { x[t] } else { regressor(&u, &x, t, p, n, delay) });
                }
            }
            let solved = stacked.triangle().solve(0.0)?;
            a = reflected(&solved.as_slice()[..n]);
            theta = Some(solved);
        }
        let solved = theta?;
        let mut theta = DVector::zeros(shape.unknowns());
        theta.rows_mut(0, n).copy_from_slice(&a);
        theta.rows_mut(n, n + 1).copy_from(&solved.rows(n, n + 1));
        theta.rows_mut(2 * n + 1, n).copy_from_slice(&a);
        // The constant of the passes belongs to the filtered signals.
        theta[3 * n + 1] = solved[2 * n + 1] * (1.0 + a.iter().sum::<f64>());
        Some(theta)
    }

    /// Simulates the output from the input only in one stretch, with the start of the record.
    fn simulated(&self, signals: &Signals, rows: &Range<usize>) -> Vec<f64> {
        let (a, b, d) = self.parts();
        let a = reflected(a);
        let (u, y) = signals.of(rows);
        let mut x: Vec<f64> = Vec::with_capacity(rows.len());
        for t in 0..rows.len() {
            if t < self.order + self.delay {
                x.push(y[t]);
                continue;
            }
            let moved: f64 = b.iter().zip(self.delay..).map(|(b, i)| b * u[t - i]).sum();
            let past: f64 = a.iter().zip(x.iter().rev()).map(|(a, x)| a * x).sum();
            x.push(moved + d - past);
        }
        x
    }
}

/// Returns `x / A`, from rest.
fn filtered(x: &[f64], a: &[f64]) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::with_capacity(x.len());
    for x in x {
        let past: f64 = a.iter().zip(out.iter().rev()).map(|(a, g)| a * g).sum();
        out.push(x - past);
    }
    out
}
