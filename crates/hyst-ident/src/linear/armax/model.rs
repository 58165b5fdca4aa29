//! The ARMAX model: equation, simulation, prediction and response.

use hyst_core::Complex;
use nalgebra::DMatrix;

use super::innovations::Polynomials;
use crate::Samples;
use crate::linear::LinearError;

/// An ARMAX model `A(q) y = B(q) u + d + C(q) e` with
///
/// ```text
/// A = 1 + a₁ q⁻¹ + … + aₙ q⁻ⁿ    B = q⁻ᵏ (b₀ + … + bₙ q⁻ⁿ)    C = 1 + c₁ q⁻¹ + … + cₙ q⁻ⁿ
/// ```
///
/// e is white noise; the roots of C are inside the unit circle. In `y = B/A u + C/A e` the first term is the structure
/// and the second the disturbance.
#[derive(Clone, Debug, PartialEq)]
pub struct Armax {
    /// Sample period \[s\].
    pub period: f64,
    /// Delay k of the input \[rows\].
    pub delay: usize,
    /// a₁ … aₙ
    pub a: Vec<f64>,
    /// b₀ … bₙ \[y/u\]
    pub b: Vec<f64>,
    /// c₁ … cₙ
    pub c: Vec<f64>,
    /// d \[y\]; the output at rest contains `d / A(1)` in addition to the response to the input.
    pub offset: f64,
    /// Standard deviation of e, the one-step prediction error \[y\].
    pub noise: f64,
    /// Covariance of a₁ … aₙ, for the standard errors of the modes.
    pub(super) covariance: DMatrix<f64>,
    /// Number of fitted rows.
    pub(super) rows: usize,
}

impl Armax {
    /// Returns the order n.
    pub fn order(&self) -> usize {
        self.a.len()
    }

    /// Returns the number of fitted rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the response `B/A` at a frequency \[Hz\].
    pub fn response(&self, hz: f64) -> Complex {
        let angle = std::f64::consts::TAU * hz * self.period;
        let at = |c: &[f64], from: usize| {
            c.iter().zip(from..).fold(Complex::default(), |sum, (c, i)| sum + Complex::polar(*c, -angle * i as f64))
        };
        at(&self.b, self.delay) / (Complex::from(1.0) + at(&self.a, 1))
    }

    /// Simulates the output from the input only. Every segment starts settled at its first input.
    pub fn simulate(&self, samples: &Samples) -> Result<Vec<f64>, LinearError> {
        self.check(samples)?;
        let mut y = vec![0.0; samples.len()];
        for s in &samples.segments {
            let (u, y) = (&samples.input[s.clone()], &mut y[s.clone()]);
            let settled = (self.b.iter().sum::<f64>() * u[0] + self.offset) / (1.0 + self.a.iter().sum::<f64>());
            for t in 0..u.len() {
                let moved: f64 = self.b.iter().zip(self.delay..).map(|(b, i)| b * u[t.saturating_sub(i)]).sum();
                let past = |i: usize| if i > t { settled } else { y[t - i] };
                y[t] = moved + self.offset - self.a.iter().zip(1..).map(|(a, i)| a * past(i)).sum::<f64>();
            }
        }
        Ok(y)
    }

    /// Returns the one-step prediction errors, measured minus predicted; 0 in the first rows of each segment, which are
    /// the history of the recursion.
    ///
    /// # Errors
    /// If the sample period differs from that of the model, or the recursion diverges.
    pub fn prediction_errors(&self, samples: &Samples) -> Result<Vec<f64>, LinearError> {
        self.check(samples)?;
        let model = Polynomials { a: &self.a, b: &self.b, c: &self.c, offset: self.offset, delay: self.delay };
        let mut errors = vec![0.0; samples.len()];
        for s in &samples.segments {
            let found = model.innovations(&samples.input[s.clone()], &samples.output[s.clone()]);
            let found = found.ok_or(LinearError::Unfit { order: self.order() })?;
            errors[s.end - found.e.len()..s.end].copy_from_slice(&found.e);
        }
        Ok(errors)
    }

    fn check(&self, samples: &Samples) -> Result<(), LinearError> {
        let same = (samples.period / self.period - 1.0).abs() < 1e-6;
        crate::linear::error::require(
            "sample period",
            samples.period,
            same,
            format!("that of the model, {} s", self.period),
        )
    }
}
