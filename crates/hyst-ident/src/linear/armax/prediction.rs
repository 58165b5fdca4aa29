//! Prediction errors and their derivatives, for signals of mean 0 and standard deviation 1.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::innovations::{Innovations, Polynomials};
use super::model::Armax;
use super::stacked::{Stacked, Triangle};
use crate::Samples;
use crate::linear::LinearError;
use crate::linear::roots::{reflected, stable};

/// Scaled input and output, and the rows in use.
#[derive(Clone)]
pub(super) struct Signals {
    pub(super) u: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) rows: Vec<Range<usize>>,
    period: f64,
    /// Mean and standard deviation of input and output.
    input: (f64, f64),
    output: (f64, f64),
}

/// The unknowns, in the order a₁ … aₙ, b₀ … bₙ, c₁ … cₙ, d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) n: usize,
    pub(super) delay: usize,
}

impl Shape {
    pub(super) fn unknowns(self) -> usize {
        3 * self.n + 2
    }

    /// Returns the same unknowns with the roots of C reflected into the unit circle.
    pub(super) fn with_stable_c(self, mut theta: DVector<f64>) -> DVector<f64> {
        let c = reflected(self.polynomials(&theta).c);
        theta.rows_mut(2 * self.n + 1, self.n).copy_from_slice(&c);
        theta
    }

    pub(super) fn polynomials(self, theta: &DVector<f64>) -> Polynomials<'_> {
        let (n, theta) = (self.n, theta.as_slice());
        Polynomials {
            a: &theta[..n],
            b: &theta[n..2 * n + 1],
            c: &theta[2 * n + 1..3 * n + 1],
            offset: theta[3 * n + 1],
            delay: self.delay,
        }
    }
}

impl Signals {
    pub(super) fn new(samples: &Samples) -> Result<Self, LinearError> {
        let scaled = |x: &[f64], column| {
            let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
            let deviation = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt();
            if deviation.is_nan() || deviation <= 1e-12 * mean.abs() {
                return Err(LinearError::Constant { column });
            }
            Ok((x.iter().map(|x| (x - mean) / deviation).collect(), (mean, deviation)))
        };
        let (u, input) = scaled(&samples.input, "input")?;
        let (y, output) = scaled(&samples.output, "output")?;
        Ok(Self { u, y, rows: samples.segments.clone(), period: samples.period, input, output })
    }

    /// Returns the same signals with other rows in use.
    pub(super) fn only(&self, rows: Vec<Range<usize>>) -> Self {
        Self { rows, ..self.clone() }
    }

    /// Returns input and output of one stretch.
    pub(super) fn of(&self, rows: &Range<usize>) -> (&[f64], &[f64]) {
        (&self.u[rows.clone()], &self.y[rows.clone()])
    }

    /// Returns the number of prediction errors.
    pub(super) fn count(&self, shape: Shape) -> usize {
        self.rows.iter().map(|r| r.len().saturating_sub(shape.n + shape.delay)).sum()
    }

    /// Returns the prediction errors of each stretch; `None` if they diverge.
    fn innovations(&self, shape: Shape, theta: &DVector<f64>) -> Option<Vec<Innovations>> {
        let polynomials = shape.polynomials(theta);
        let of = |rows| {
            let (u, y) = self.of(rows);
            polynomials.innovations(u, y)
        };
        self.rows.iter().map(of).collect()
    }

    /// Returns the sum of squared prediction errors; infinite if C is not stable.
    pub(super) fn cost(&self, shape: Shape, theta: &DVector<f64>) -> f64 {
        if !stable(shape.polynomials(theta).c) {
            return f64::INFINITY;
        }
        let sum = self.innovations(shape, theta).map(|all| all.iter().map(Innovations::cost).sum::<f64>());
        sum.filter(|sum| sum.is_finite()).unwrap_or(f64::INFINITY)
    }

    /// Returns the triangle of the linearised errors. Its solution is the Gauss-Newton step. `None` if the errors
    /// diverge.
    ///
    /// Each derivative is a regressor filtered by 1/C: `C ∂e/∂aᵢ = y(t − i)`, `C ∂e/∂bᵢ = −u(t − k − i)`, `C ∂e/∂cᵢ =
    /// −e(t − i)`, `C ∂e/∂d = −1`. The errors before the record are unknowns of one stretch only and are eliminated
    /// there.
    pub(super) fn linearised(&self, shape: Shape, theta: &DVector<f64>) -> Option<Triangle> {
        let (n, unknowns) = (shape.n, shape.unknowns());
        let mut stacked = Stacked::new(unknowns);
        for (rows, found) in self.rows.iter().zip(self.innovations(shape, theta)?) {
            let columns = self.derivatives(shape, theta, rows, &found);
            let memory_rows = found.memory.nrows();
            let mut local = Stacked::new(n + unknowns);
            for (t, e) in found.e.iter().enumerate().take(memory_rows) {
                local.row(|p| match p {
                    p if p < n => -found.memory[(t, p)],
                    p if p < n + unknowns => columns[t * unknowns + p - n],
                    _ => *e,
                });
            }
            for (i, e) in found.before.iter().enumerate() {
                local.row(|p| match p {
                    p if p < n => -f64::from(u8::from(p == i)),
                    p if p < n + unknowns => 0.0,
                    _ => *e,
                });
            }
            local.eliminate_first(n, &mut stacked);
            for (t, e) in found.e.iter().enumerate().skip(memory_rows) {
                stacked.row(|p| if p == unknowns { *e } else { columns[t * unknowns + p] });
            }
        }
        Some(stacked.triangle())
    }

    /// Returns the negative derivatives of the errors of one stretch, row by row, so that the solution is the step.
    fn derivatives(&self, shape: Shape, theta: &DVector<f64>, rows: &Range<usize>, found: &Innovations) -> Vec<f64> {
        let (n, delay, width) = (shape.n, shape.delay, shape.unknowns());
        let model = shape.polynomials(theta);
        let (u, y) = self.of(rows);
        let from = model.reach();
        let mut all = vec![0.0; found.e.len() * width];
        for t in 0..found.e.len() {
            let (past, now) = all.split_at_mut(t * width);
            let now = &mut now[..width];
            for (p, g) in now.iter_mut().enumerate() {
                *g = match p {
                    p if p < n => -y[from + t - 1 - p],
                    p if p <= 2 * n => u[from + t - delay - (p - n)],
                    p if p <= 3 * n => {
                        let back = p - 2 * n;
                        if t >= back { found.e[t - back] } else { found.before[back - t - 1] }
                    }
                    _ => 1.0,
                };
            }
            // Applies 1/C to all columns at once.
            for (c, row) in model.c.iter().zip(past.rchunks_exact(width)) {
                now.iter_mut().zip(row).for_each(|(g, before)| *g -= c * before);
            }
        }
        all
    }

    /// Returns the model in the units of the record.
    pub(super) fn model(&self, shape: Shape, theta: &DVector<f64>, noise: f64, covariance: &DMatrix<f64>) -> Armax {
        let ratio = self.output.1 / self.input.1;
        let scaled = shape.polynomials(theta);
        let b: Vec<f64> = scaled.b.iter().map(|b| b * ratio).collect();
        let at_rest = self.output.0 * (1.0 + scaled.a.iter().sum::<f64>()) - self.input.0 * b.iter().sum::<f64>();
        Armax {
            period: self.period,
            delay: shape.delay,
            a: scaled.a.to_vec(),
            c: scaled.c.to_vec(),
            offset: scaled.offset * self.output.1 + at_rest,
            noise: noise * self.output.1,
            covariance: covariance.view((0, 0), (shape.n, shape.n)).into(),
            rows: self.count(shape),
            b,
        }
    }
}
