//! Prandtl-Ishlinskii candidates, processed together.

use super::{Kernel, Lanes, Row};

/// Kernel of `y = p₀ u + Σ wᵢ playᵢ(u)` with N play operators, as [`hyst_core::Pi`].
///
/// Parameters: p₀, r₁ … r_N, w₁ … w_N. It computes stop operators, `y = (p₀ + Σ wᵢ) u − Σ wᵢ stopᵢ(u)`, which saves one
/// operation for each.
#[derive(Clone, Copy, Debug, Default)]
pub struct PiKernel<const N: usize>;

/// Slope of the virgin curve at infinity, thresholds and weights of eight parameter sets.
#[derive(Clone, Copy, Debug)]
pub struct PiCoefficients<const N: usize> {
    slope: Lanes,
    high: [Lanes; N],
    low: [Lanes; N],
    w: [Lanes; N],
}

/// States of the stop operators, and the last input.
#[derive(Clone, Copy, Debug)]
pub struct PiLanes<const N: usize> {
    stops: [Lanes; N],
    input: f64,
}

impl<const N: usize> Kernel for PiKernel<N> {
    type Coefficients = PiCoefficients<N>;
    type State = PiLanes<N>;

    fn parameters(&self) -> usize {
        1 + 2 * N
    }

    #[inline(always)]
    fn coefficients(&self, p: &[Lanes]) -> PiCoefficients<N> {
        let (mut slope, mut high, mut low, mut w) = (p[0], [Lanes::ZERO; N], [Lanes::ZERO; N], [Lanes::ZERO; N]);
        for i in 0..N {
            (high[i], low[i], w[i]) = (p[1 + i], -p[1 + i], -p[1 + N + i]);
            slope += p[1 + N + i];
        }
        PiCoefficients { slope, high, low, w }
    }

    #[inline(always)]
    fn state(&self) -> PiLanes<N> {
        PiLanes { stops: [Lanes::ZERO; N], input: 0.0 }
    }

    #[inline(always)]
    fn step(&self, c: &PiCoefficients<N>, s: &mut PiLanes<N>, row: &Row) -> Lanes {
        let way = Lanes::all(row.input - s.input);
        s.input = row.input;
        // Two sums, to shorten the chain of dependent additions.
        let (mut even, mut odd) = (c.slope * row.input, Lanes::ZERO);
        let mut stops = s.stops.chunks_exact_mut(2);
        for (i, pair) in stops.by_ref().enumerate() {
            even = slide(&mut pair[0], way, c, 2 * i, even);
            odd = slide(&mut pair[1], way, c, 2 * i + 1, odd);
        }
        if let [last] = stops.into_remainder() {
            even = slide(last, way, c, N - 1, even);
        }
        even + odd
    }
}

/// Updates stop operator `i` and adds its contribution to a sum.
#[inline(always)]
fn slide<const N: usize>(stop: &mut Lanes, way: Lanes, c: &PiCoefficients<N>, i: usize, sum: Lanes) -> Lanes {
    *stop = (*stop + way).at_most(c.high[i]).at_least(c.low[i]);
    stop.times_plus(c.w[i], sum)
}
