//! Modes of the structure: poles and zeros as frequencies and damping ratios.

use nalgebra::{Complex, DVector};

use super::model::Armax;
use crate::linear::LinearError;
use crate::linear::roots::{roots, value_and_slope};

/// A pair of conjugate poles, `s² + 2ζω s + ω²`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency ω/2π \[Hz\].
    pub hz: f64,
    /// Its standard error \[Hz\].
    pub hz_std_error: f64,
    /// Damping ratio ζ; negative for an unstable pole.
    pub damping: f64,
    /// Its standard error.
    pub damping_std_error: f64,
    /// Peak of the mode in the response, `|r / (e^(jω_d h) − z)|` with its residue r \[y/u\]. If it is far below the
    /// response, the mode is hardly excited or a zero cancels it.
    pub peak: f64,
}

/// A zero of the response in continuous time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zero {
    /// Distance from the origin divided by 2π \[Hz\].
    pub hz: f64,
    /// Damping ratio, −1 to 1; negative in the right half plane, ±1 for a real zero.
    pub damping: f64,
}

impl Armax {
    /// Returns the modes, from the lowest frequency up: roots z of A as `s = ln(z) / h`. The standard errors follow
    /// from the covariance of the coefficients by the delta method; they are valid if the prediction errors are white.
    ///
    /// Real poles are not structural modes and are left out.
    ///
    /// # Errors
    /// If the roots cannot be computed.
    pub fn modes(&self) -> Result<Vec<Mode>, LinearError> {
        let poles = roots(&self.a).ok_or(LinearError::Unfit { order: self.order() })?;
        let mut modes: Vec<Mode> = poles.into_iter().filter(|z| z.im > 0.0).map(|z| self.mode(z)).collect();
        modes.sort_by(|a, b| a.hz.total_cmp(&b.hz));
        Ok(modes)
    }

    fn mode(&self, z: Complex<f64>) -> Mode {
        let n = self.order();
        let s = z.ln() / self.period;
        let (size, damping) = (s.norm(), -s.re / s.norm());
        let (_, slope) = value_and_slope(&self.a, z);
        // ∂z/∂aᵢ = −zⁿ⁻ⁱ / A'(z), and from it the derivatives of s, |s| and ζ.
        let by_s = |i: usize| -z.powi((n - 1 - i) as i32) / slope / z / self.period;
        let by_size = DVector::from_fn(n, |i, _| (s.conj() * by_s(i)).re / size);
        let by_damping = DVector::from_fn(n, |i, _| (-by_s(i).re - damping * by_size[i]) / size);
        let std_error = |g: &DVector<f64>| g.dot(&(&self.covariance * g)).max(0.0).sqrt();
        let numerator =
            self.b.iter().fold(Complex::new(0.0, 0.0), |sum, b| sum * z + *b) * z.powi(-(self.delay as i32));
        let top = Complex::from_polar(1.0, z.arg());
        Mode {
            hz: size / std::f64::consts::TAU,
            hz_std_error: std_error(&by_size) / std::f64::consts::TAU,
            damping,
            damping_std_error: std_error(&by_damping),
            peak: (numerator / slope / (top - z)).norm(),
        }
    }

    /// Returns the zeros, from the lowest frequency up: roots of B, each conjugate pair once. Sampling adds zeros near
    /// half of the sample rate.
    ///
    /// # Errors
    /// If the roots cannot be computed.
    pub fn zeros(&self) -> Result<Vec<Zero>, LinearError> {
        let largest = self.b.iter().fold(0.0_f64, |most, b| most.max(b.abs()));
        // Leading coefficients of 0 are a delay; division by them gives infinite roots.
        let Some(first) = self.b.iter().position(|b| b.abs() > 1e-9 * largest) else { return Ok(Vec::new()) };
        let p: Vec<f64> = self.b[first + 1..].iter().map(|b| b / self.b[first]).collect();
        let found = roots(&p).ok_or(LinearError::Unfit { order: self.order() })?;
        let mut zeros: Vec<Zero> = found
            .into_iter()
            .filter(|z| z.im >= 0.0 && z.norm() > 1e-9)
            .map(|z| {
                let s = z.ln() / self.period;
                Zero { hz: s.norm() / std::f64::consts::TAU, damping: -s.re / s.norm().max(f64::MIN_POSITIVE) }
            })
            .collect();
        zeros.sort_by(|a, b| a.hz.total_cmp(&b.hz));
        Ok(zeros)
    }
}
