//! The full memory of a fractional derivative with a fixed number of states.

use super::memory::{derivative, differences, sealed};
use super::weights::{RECURSION, checked, decay};
use super::{GlOrder, GlWeights, Memory};
use crate::error::within;
use crate::ring::Ring;
use crate::{Complex, Error, Real};
use core::f64::consts::PI;

/// Number of exact weights. Beyond them the factor 3^(−k) of the second-order form is below 1e-9.
const HEAD: usize = 20;

/// Horizon of the default constructor \[samples\]: 17 minutes at 10 kHz.
const HORIZON: f64 = 1e7;

/// Full Grünwald-Letnikov memory as 20 exact weights and a sum of `J` exponentials (a diffusive representation).
///
/// For k ≥ 1 the weights are a positive mixture of decaying exponentials: with x = e^(−s)
///
/// ```text
/// −ωₖ = (sin πμ / π) ∫₀^∞ e^(−ks) (e^s − 1)^μ φ(s) ds,
/// ```
///
/// φ = 1 for the first order, `((3 − e^s)/2)^μ` truncated at s = ln 3 for the second (to within 3^(−k)). The
/// trapezoidal rule in ln s converges exponentially in its step. Two nodes with the same four moments (a Gauss rule)
/// replace the infinitely many slow nodes down to s = 0. The tail is scaled to the exact sum of its weights, so a
/// constant has the derivative zero.
///
/// Each node is a low-pass `q += (1 − x)(g − q)` with compensated summation. Without the compensation, a node with a
/// time constant of 10⁶ samples would not move in `f32`, and a model would drift by 6e-4 of its span. With it, `f32` is
/// within 2e-7.
///
/// `J` must be at least 8. The weights are accurate to 4e-7 over 1e7 samples for J = 40, to 9e-6 for 32, to 3e-4 for 24
/// ([`error`](Self::error)). Beyond the horizon the weights decay too fast, and the derivative of a constant still goes
/// to zero.
///
/// Errors relative to the full memory over 1e5 samples at 10 kHz, for five sines from 5 to 30 Hz about an offset, with
/// the published parameters: 1e-9 of the span of the LFDM for J = 40, 2.5e-8 for 32 and 1e-6 for 24, and a third of
/// that for the IFM.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponentials<T, const J: usize> {
    first: T,
    /// −ω₁ … −ω₂₀.
    head: [T; HEAD],
    /// 1 − x of each node, fastest first.
    rates: [T; J],
    /// Sum of the weights of each node.
    shares: [T; J],
    mu: f64,
    order: GlOrder,
    horizon: f64,
}

/// History of [`Exponentials`]: the last 20 samples and the low-passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExponentialsState<T, const J: usize> {
    ring: Ring<T, HEAD>,
    low_passes: [T; J],
    /// Rounding error of each low-pass.
    rounding: [T; J],
}

/// Nodes of the trapezoidal rule, sᵢ = top · e^(−i step).
struct Grid {
    top: f64,
    step: f64,
}

impl Grid {
    /// Returns the most accurate grid with `fast` nodes. Step, upper end and lower end each cause the relative error
    /// e^(−l), with l as large as the number of nodes allows.
    fn new(mu: f64, order: GlOrder, horizon: f64, fast: f64) -> Self {
        let mut best = Self { top: 1.0, step: 1.0 };
        let (mut low, mut high) = (1.0, 36.0);
        for _ in 0..40 {
            let l = 0.5 * (low + high);
            // Aliasing of the rule for a power law: 2√(2π) w^(μ+½) e^(−πw/2), w = 2π/step.
            let (mut w, mut y) = (10.0, 20.0);
            for _ in 0..8 {
                w = 2.0 / PI * (l + 1.6 + (mu + 0.5) * libm::log(w));
                // Upper end, at the first weight of the tail: y^(1+μ) e^(−y), y = (HEAD + 1) s.
                y = l + (1.0 + mu) * libm::log(y);
            }
            let limit = if order == GlOrder::Second { 1.08 } else { f64::INFINITY };
            let top = (y / (HEAD as f64 + 1.0)).at_most(limit);
            // Lower end, at the horizon: the two Gauss nodes for all slower ones have an error of about
            // 0.003 (horizon · s)^(4+μ).
            let bottom = libm::exp((5.8 - l) / (4.0 + mu)) / horizon;
            let span = libm::log(top / bottom);
            best = Self { top, step: span / (fast - 0.5) };
            if span * w > 2.0 * PI * (fast - 0.5) { high = l } else { low = l }
        }
        best
    }
}

/// Returns two nodes that replace the infinitely many nodes from `s` downwards, for the measure s^μ: their s, and their
/// shares of the sum.
fn slow_nodes(mu: f64, s: f64, step: f64) -> [(f64, f64); 2] {
    // Moments of order 1, 2, 3 divided by that of order 0: geometric series.
    let moment = |j: f64| libm::expm1(-step * mu) / libm::expm1(-step * (mu + j));
    let (mean, second, third) = (moment(1.0), moment(2.0), moment(3.0));
    let variance = second - mean * mean;
    if variance.is_nan() || variance <= 0.0 {
        return [(0.0, 0.0), (0.0, 1.0)];
    }
    let half = 0.5 * (third - 3.0 * mean * second + 2.0 * mean * mean * mean) / variance;
    let up = half + libm::sqrt(half * half + variance);
    let share = variance / (up * up + variance);
    [(s * (mean + up), share), (s * (mean - variance / up).at_least(0.0), 1.0 - share)]
}

impl<T: Real, const J: usize> Exponentials<T, J> {
    /// Creates the memory for the derivative of order `mu`, 0 ≤ μ ≤ 1, with weights that are accurate up to `horizon`
    /// \[samples\].
    ///
    /// # Errors
    /// If μ is outside that range, the horizon is not between 100 and 1e12, or `J` is below 8.
    pub fn with_horizon(mu: f64, order: GlOrder, horizon: f64) -> Result<Self, Error> {
        checked("memory.mu", mu)?;
        within("memory.horizon", horizon, (100.0..=1e12).contains(&horizon), "from 100 to 1e12 samples")?;
        if J < 8 {
            return Err(Error::Capacity { name: "memory exponentials", needed: 8, holds: J });
        }
        let mut all = GlWeights::new(mu, order);
        let mut total = all.next().unwrap_or_default();
        let mut memory = Self {
            first: T::from_f64(total),
            head: [T::ZERO; HEAD],
            rates: [T::ZERO; J],
            shares: [T::ZERO; J],
            mu,
            order,
            horizon,
        };
        for (slot, w) in memory.head.iter_mut().zip(all) {
            *slot = T::from_f64(-w);
            total += w;
        }
        let fast = J - 2;
        let grid = Grid::new(mu, order, horizon, fast as f64);
        let grid_node = |i: usize| grid.top * libm::exp(-grid.step * i as f64);
        let below = grid_node(fast);
        let slow = slow_nodes(mu, below, grid.step);
        // Σ of step · s^μ over the nodes that the two slow nodes replace.
        let rest = grid.step * libm::pow(below, mu) / -libm::expm1(-grid.step * mu);
        let amplitude = libm::sin(PI * mu) / PI;
        let node = |i: usize| {
            if i < fast {
                (grid_node(i), amplitude * grid.step * libm::pow(grid_node(i), mu))
            } else {
                let (s, share) = slow.get(i - fast).copied().unwrap_or_default();
                // The limit for μ → 0, where the whole memory is infinitely slow.
                (s, share * if mu > 0.0 { amplitude * rest } else { 1.0 })
            }
        };
        let mut shares = [0.0; J];
        let mut sum = 0.0;
        for (i, (rate, share)) in memory.rates.iter_mut().zip(&mut shares).enumerate() {
            let (s, measure) = node(i);
            *rate = T::from_f64(-libm::expm1(-s));
            *share = measure * smooth(mu, order, s);
            sum += *share;
        }
        let scale = if sum > 0.0 { total / sum } else { 0.0 };
        for (slot, share) in memory.shares.iter_mut().zip(shares) {
            *slot = T::from_f64(share * scale);
        }
        Ok(memory)
    }

    /// Returns the largest relative error of a weight over the horizon, including the rounding of the coefficients. The
    /// error of the derivative of any signal is at most about as large. Computes about 10⁴ exponentials.
    pub fn error(&self) -> f64 {
        let mut worst: f64 = 0.0;
        let mut check = |k: f64, expected: f64| {
            let mut sum = 0.0;
            for (rate, share) in self.rates.iter().zip(&self.shares) {
                let rate = rate.to_f64();
                sum += share.to_f64() * rate * libm::exp(libm::log1p(-rate) * (k - 1.0 - HEAD as f64));
            }
            let error = (sum / -expected - 1.0).abs();
            worst = worst.at_least(error);
        };
        let mut last = 0.0;
        for (k, w) in GlWeights::new(self.mu, self.order).take(RECURSION + 1).enumerate() {
            if k > HEAD && w != 0.0 {
                check(k as f64, w);
            }
            last = w;
        }
        let mut k = RECURSION as f64;
        // The error oscillates over ln k with one period per node. 1e12 is reached after 482 steps.
        for _ in 0..500 {
            k = (k * 1.05).at_most(self.horizon);
            if last == 0.0 || k <= RECURSION as f64 {
                break;
            }
            check(k, last * decay(self.mu, self.order, k));
            if k >= self.horizon {
                break;
            }
        }
        worst
    }
}

/// Computes the factor of s^μ in the sum of the weights of a node:
/// `e^(−(HEAD+1)s) ((e^s − 1)/s)^μ φ(s) s/(1 − e^(−s))`, which is 1 at `s = 0`.
fn smooth(mu: f64, order: GlOrder, s: f64) -> f64 {
    if s <= 0.0 {
        return 1.0;
    }
    let rise = libm::expm1(s);
    let shape = match order {
        GlOrder::First => 1.0,
        GlOrder::Second => libm::pow((1.0 - 0.5 * rise).at_least(0.0), mu),
    };
    libm::exp(-(HEAD as f64 + 1.0) * s) * libm::pow(rise / s, mu) * shape * s / -libm::expm1(-s)
}

impl<T, const J: usize> sealed::Sealed for Exponentials<T, J> {}

impl<T: Real, const J: usize> Memory<T> for Exponentials<T, J> {
    type State = ExponentialsState<T, J>;

    /// Creates the memory with weights that are accurate up to 1e7 samples.
    fn new(mu: f64, order: GlOrder) -> Result<Self, Error> {
        Self::with_horizon(mu, order, HORIZON)
    }

    fn state(&self) -> Self::State {
        ExponentialsState { ring: Ring::filled(T::ZERO), low_passes: [T::ZERO; J], rounding: [T::ZERO; J] }
    }

    fn first(&self) -> T {
        self.first
    }

    #[inline]
    fn advance(&self, s: &mut Self::State, g: T) -> T {
        let old = s.ring.push(g);
        let mut held = differences(&s.ring, &self.head, g);
        let nodes = s.low_passes.iter_mut().zip(&mut s.rounding).zip(self.rates.iter().zip(&self.shares));
        for ((q, rounding), (rate, share)) in nodes {
            let rise = *rate * (old - *q) + *rounding;
            let next = *q + rise;
            *rounding = rise - (next - *q);
            *q = next;
            held += *share * (g - next);
        }
        held
    }

    fn response(&self, z1: Complex) -> Complex {
        let rise = Complex::from(1.0) - z1;
        let (mut held, mut power) = (Complex::default(), Complex::from(1.0));
        for w in &self.head {
            held = held + (Complex::from(1.0) - power) * w.to_f64();
            power = power * z1;
        }
        for (rate, share) in self.rates.iter().zip(&self.shares) {
            let (rate, share) = (rate.to_f64(), share.to_f64());
            if rate > 0.0 {
                // 1 − (1 − rate) z⁻¹ without cancellation.
                let low_pass = Complex::from(rate) / (rise + z1 * rate);
                held = held + (Complex::from(1.0) - power * low_pass) * share;
            } else {
                held = held + share;
            }
        }
        derivative(self.first.to_f64(), held, z1)
    }
}

#[cfg(test)]
mod tests;
