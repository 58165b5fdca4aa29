//! Bouc-Wen candidates with n = 1, processed together.

use super::{Kernel, Lanes, Row};

/// Kernel of `y = k₀ u + g`, `ġ = α u̇ − β |u̇| g − γ u̇ |g|` (n = 1), as [`hyst_core::BoucWen`].
///
/// Parameters: k₀, α, β, γ. Each sample is exact for an input that is linear between samples. Candidates with |γ| > β
/// are not valid: their output is NaN.
#[derive(Clone, Copy, Debug, Default)]
pub struct BoucWenKernel;

/// k₀, α, and the rates of approach β ± γ above and below zero with their reciprocals.
#[derive(Clone, Copy, Debug)]
pub struct BoucWenCoefficients {
    k0: Lanes,
    alpha: Lanes,
    above: Lanes,
    below: Lanes,
    one_over_above: Lanes,
    one_over_below: Lanes,
}

/// Last input and g.
#[derive(Clone, Copy, Debug)]
pub struct BoucWenLanes {
    input: f64,
    g: Lanes,
}

impl Kernel for BoucWenKernel {
    type Coefficients = BoucWenCoefficients;
    type State = BoucWenLanes;

    fn parameters(&self) -> usize {
        4
    }

    #[inline(always)]
    fn coefficients(&self, p: &[Lanes]) -> BoucWenCoefficients {
        let (mut k0, [alpha, beta, gamma]) = (p[0], [p[1], p[2], p[3]]);
        for ((k0, beta), gamma) in k0.0.iter_mut().zip(beta.0).zip(gamma.0) {
            if gamma.abs() > beta {
                *k0 = f64::NAN;
            }
        }
        let one = Lanes::all(1.0);
        let (above, below) = (beta + gamma, beta - gamma);
        BoucWenCoefficients { k0, alpha, above, below, one_over_above: one / above, one_over_below: one / below }
    }

    #[inline(always)]
    fn state(&self) -> BoucWenLanes {
        BoucWenLanes { input: 0.0, g: Lanes::ZERO }
    }

    #[inline(always)]
    fn step(&self, c: &BoucWenCoefficients, s: &mut BoucWenLanes, row: &Row) -> Lanes {
        let way = row.input - s.input;
        s.input = row.input;
        if way != 0.0 {
            let sign = if way < 0.0 { -1.0 } else { 1.0 };
            let sigma = way.abs();
            let q = s.g * sign;
            let mut to = c.approach(q, sigma);
            // The rate changes where q passes zero: once after each reversal.
            let (before, after) = (q * c.alpha, to * c.alpha);
            if before.0.iter().zip(after.0).any(|(before, after)| *before < 0.0 && after >= 0.0) {
                for l in 0..super::LANES {
                    if before.0[l] < 0.0 && after.0[l] >= 0.0 {
                        to.0[l] = c.through_zero(l, q.0[l], sigma);
                    }
                }
            }
            s.g = to * sign;
        }
        c.k0 * row.input + s.g
    }
}

impl BoucWenCoefficients {
    /// Returns q after a path σ with `dq/dσ = α − rate q`. The rate depends on the sign of q; at zero, on the sign of
    /// α.
    #[inline(always)]
    fn approach(&self, q: Lanes, sigma: f64) -> Lanes {
        let side = q.choose(q, |q, _| q == 0.0, self.alpha, q);
        let above = |a: Lanes, b: Lanes| side.choose(side, |side, _| side >= 0.0, a, b);
        let rate = above(self.above, self.below);
        // (1 − e^(−x)) / rate, also where the rate vanishes.
        let x = rate * sigma;
        let exact = x.fallen() * above(self.one_over_above, self.one_over_below);
        let length = x.choose(x, |x, _| x > 1e-12, exact, Lanes::all(sigma));
        (self.alpha - rate * q).times_plus(length, q)
    }

    /// Returns q of one candidate after a path on which it passes zero.
    #[inline(never)]
    fn through_zero(&self, lane: usize, q: f64, sigma: f64) -> f64 {
        let (alpha, above, below) = (self.alpha.0[lane], self.above.0[lane], self.below.0[lane]);
        let (here, beyond) = if q >= 0.0 { (above, below) } else { (below, above) };
        // q(σ) = q∞ + (q − q∞) e^(−rate σ) reaches zero at σ₀.
        let to_zero = if here * sigma > 1e-12 { libm::log1p(-here * q / alpha) / here } else { -q / alpha };
        let left = (sigma - to_zero).max(0.0);
        let x = beyond * left;
        alpha * if x > 1e-12 { -libm::expm1(-x) / beyond } else { left }
    }
}
