//! Bouc-Wen candidates with n = 1 side by side.

use super::{Kernel, Lanes, Row};

/// `y = k₀ u + g`, `ġ = α u̇ − β |u̇| g − γ u̇ |g|` (n = 1); parameters k₀, α, β, γ, as [`hyst_core::BoucWen`]: each sample
/// is exact for an input that is linear between samples.
///
/// Candidates with |γ| > β are no model: their output is not a number.
#[derive(Clone, Copy, Debug, Default)]
pub struct BoucWenKernel;

/// Last input and g.
#[derive(Clone, Copy, Debug)]
pub struct BoucWenLanes {
    input: f64,
    g: Lanes,
}

impl Kernel for BoucWenKernel {
    type Coefficients = [Lanes; 4];
    type State = BoucWenLanes;

    fn parameters(&self) -> usize {
        4
    }

    #[inline(always)]
    fn coefficients(&self, p: &[Lanes]) -> [Lanes; 4] {
        let mut k0 = p[0];
        for ((k0, beta), gamma) in k0.0.iter_mut().zip(p[2].0).zip(p[3].0) {
            if gamma.abs() > beta {
                *k0 = f64::NAN;
            }
        }
        [k0, p[1], p[2], p[3]]
    }

    #[inline(always)]
    fn state(&self) -> BoucWenLanes {
        BoucWenLanes { input: 0.0, g: Lanes::ZERO }
    }

    #[inline(always)]
    fn step(&self, [k0, alpha, beta, gamma]: &[Lanes; 4], s: &mut BoucWenLanes, row: &Row) -> Lanes {
        let way = row.input - s.input;
        s.input = row.input;
        if way != 0.0 {
            let sign = if way < 0.0 { -1.0 } else { 1.0 };
            let sigma = way.abs();
            for l in 0..super::LANES {
                s.g.0[l] = sign * travel(alpha.0[l], beta.0[l], gamma.0[l], sign * s.g.0[l], sigma);
            }
        }
        *k0 * row.input + s.g
    }
}

/// g in the direction of travel after the distance `sigma`: `dq/dσ = α − β q − γ |q|`, piecewise an exponential approach.
#[inline(always)]
fn travel(alpha: f64, beta: f64, gamma: f64, q: f64, sigma: f64) -> f64 {
    let same = (q >= 0.0) == (alpha >= 0.0);
    let (here, beyond) = if q >= 0.0 { (beta + gamma, beta - gamma) } else { (beta - gamma, beta + gamma) };
    if same || q == 0.0 {
        // Away from zero, on the side on which α pulls.
        let rate = if alpha >= 0.0 { beta + gamma } else { beta - gamma };
        return approach(alpha, rate, q, sigma);
    }
    // Towards zero: q(σ) = q∞ + (q − q∞) e^(−rate σ) reaches it at σ₀.
    let to_zero = if here * sigma > 1e-12 { libm::log1p(-here * q / alpha) / here } else { -q / alpha };
    if sigma < to_zero { approach(alpha, here, q, sigma) } else { approach(alpha, beyond, 0.0, sigma - to_zero) }
}

/// q after σ with `dq/dσ = α − rate q`.
#[inline(always)]
fn approach(alpha: f64, rate: f64, q: f64, sigma: f64) -> f64 {
    // (1 − e^(−x)) / rate without cancellation, also where the rate vanishes.
    let x = rate * sigma;
    let share = -libm::expm1(-x);
    let length = if x.abs() > 1e-12 { share / rate } else { sigma };
    q + (alpha - rate * q) * length
}
