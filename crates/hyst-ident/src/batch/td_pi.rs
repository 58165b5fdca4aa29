//! TD-PI candidates, processed together.

use super::{Kernel, Lanes, Row};

/// Kernel of the TD-PI model with N thresholds in addition to r = 0.
/// Its parameters are α, ε, τ, η, a₀, a₁, b₀, b₁, as [`hyst_core::TdPi`].
#[derive(Clone, Copy, Debug)]
pub struct TdPiKernel<const N: usize> {
    /// T₀ \[°C\].
    pub reference_degc: f64,
}

/// Thresholds and weights at T₀ of the play operators, envelopes and η of eight parameter sets.
#[derive(Clone, Copy, Debug)]
pub struct TdPiCoefficients<const N: usize> {
    r: [Lanes; N],
    w: [Lanes; N],
    epsilon: Lanes,
    eta: Lanes,
    left: [Lanes; 2],
    right: [Lanes; 2],
}

/// States of the play operators, of the one with r = 0, and the factor of the last temperature.
#[derive(Clone, Copy, Debug)]
pub struct TdPiLanes<const N: usize> {
    plays: [Lanes; N],
    middle: Lanes,
    degc: f64,
    factor: Lanes,
}

impl<const N: usize> Kernel for TdPiKernel<N> {
    type Coefficients = TdPiCoefficients<N>;
    type State = TdPiLanes<N>;

    fn parameters(&self) -> usize {
        8
    }

    #[inline(always)]
    fn coefficients(&self, p: &[Lanes]) -> TdPiCoefficients<N> {
        let (mut r, mut w) = ([Lanes::ZERO; N], [Lanes::ZERO; N]);
        for i in 0..N {
            r[i] = p[0] * (i as f64 + 1.0);
            w[i] = p[1] * (-p[2] * r[i]).map(libm::exp);
        }
        TdPiCoefficients { r, w, epsilon: p[1], eta: p[3], left: [p[4], p[5]], right: [p[6], p[7]] }
    }

    #[inline(always)]
    fn state(&self) -> TdPiLanes<N> {
        TdPiLanes { plays: [Lanes::ZERO; N], middle: Lanes::ZERO, degc: f64::NAN, factor: Lanes::ZERO }
    }

    #[inline(always)]
    fn step(&self, c: &TdPiCoefficients<N>, s: &mut TdPiLanes<N>, row: &Row) -> Lanes {
        let u = Lanes::all(row.input);
        let (left, right) = (c.left[0] * u + c.left[1], c.right[0] * u + c.right[1]);
        s.middle = s.middle.at_most(right).at_least(left);
        // Two sums, to shorten the chain of dependent additions.
        let mut y = [c.epsilon * s.middle, Lanes::ZERO];
        for i in 0..N {
            s.plays[i] = s.plays[i].at_most(right + c.r[i]).at_least(left - c.r[i]);
            y[i % 2] = s.plays[i].times_plus(c.w[i], y[i % 2]);
        }
        if row.temperature != s.degc {
            s.degc = row.temperature;
            s.factor = (c.eta * (row.temperature - self.reference_degc)).map(libm::exp);
        }
        s.factor * (y[0] + y[1])
    }
}
