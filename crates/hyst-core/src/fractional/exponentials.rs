//! All of the memory of a fractional derivative, in a fixed number of states.

use super::memory::{derivative, differences, sealed};
use super::weights::{RECURSION, checked, decay};
use super::{GlOrder, GlWeights, Memory};
use crate::error::within;
use crate::ring::Ring;
use crate::{Complex, Error, Real};
use core::f64::consts::PI;

/// Weights that are kept as they are: from there on the factor 3^(−k) of the second-order form is below 1e-9.
const HEAD: usize = 20;

/// Samples that the default constructor's weights are right for: 17 minutes at 10 kHz.
const HORIZON: f64 = 1e7;

/// Full Grünwald-Letnikov memory as 20 exact weights and a sum of `J` exponentials (a diffusive representation).
///
/// For k ≥ 1 the weights are a positive mixture of decaying exponentials: with x = e^(−s)
///
/// ```text
/// −ωₖ = (sin πμ / π) ∫₀^∞ e^(−ks) (e^s − 1)^μ φ(s) ds,
/// ```
///
/// φ = 1 for the first order, `((3 − e^s)/2)^μ` cut at s = ln 3 for the second (to within 3^(−k)). The trapezoidal
/// rule in ln s converges exponentially in its step. Its infinitely many slow nodes, down to s = 0, are replaced by
/// two that have the same four moments (a Gauss rule), and the tail is scaled to the exact sum of its weights, so a
/// constant has the derivative zero.
///
/// Each node is a low-pass `q += (1 − x)(g − q)`, with the part of the sum that rounding loses carried along: in
/// `f32` a node a million samples slow would stand still otherwise, and a model drift by 6e-4 of its span; with it
/// `f32` is within 2e-7.
///
/// `J` from 8; 40 are right to 4e-7 over 1e7 samples, 32 to 9e-6, 24 to 3e-4 ([`error`](Self::error)). Beyond the
/// horizon the weights fade faster than they should, and the derivative of a constant still goes to zero.
///
/// Against full memory over 1e5 samples at 10 kHz, for five sines from 5 to 30 Hz about an offset: with the printed
/// parameters 1e-9 of the LFDM's span for J = 40, 2.5e-8 for 32 and 1e-6 for 24, and a third of that of the IFM's.
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
    /// What rounding took from each low-pass.
    lost: [T; J],
}

/// Trapezoidal nodes sᵢ = top · e^(−i step).
struct Ladder {
    top: f64,
    step: f64,
}

impl Ladder {
    /// The most exact ladder of `rungs` nodes: step, upper and lower end each leave the relative error e^(−l), l as
    /// large as the number of nodes allows.
    fn new(mu: f64, order: GlOrder, horizon: f64, rungs: f64) -> Self {
        let mut best = Self { top: 1.0, step: 1.0 };
        let (mut low, mut high) = (1.0, 36.0);
        for _ in 0..40 {
            let l = 0.5 * (low + high);
            // Aliasing of the rule for a power law: 2√(2π) w^(μ+½) e^(−πw/2), w = 2π/step.
            let (mut w, mut y) = (10.0, 20.0);
            for _ in 0..8 {
                w = 2.0 / PI * (l + 1.6 + (mu + 0.5) * libm::log(w));
                // Fast end, at the first weight of the tail: y^(1+μ) e^(−y), y = (HEAD + 1) s.
                y = l + (1.0 + mu) * libm::log(y);
            }
            let limit = if order == GlOrder::Second { 1.08 } else { f64::INFINITY };
            let top = (y / (HEAD as f64 + 1.0)).at_most(limit);
            // Slow end, at the horizon: two Gauss nodes for all that is slower leave about 0.003 (horizon · s)^(4+μ).
            let bottom = libm::exp((5.8 - l) / (4.0 + mu)) / horizon;
            let span = libm::log(top / bottom);
            best = Self { top, step: span / (rungs - 0.5) };
            if span * w > 2.0 * PI * (rungs - 0.5) { high = l } else { low = l }
        }
        best
    }
}

/// Two nodes for the infinitely many rungs from `s` on downwards: places, and shares of their sum, of the measure
/// s^μ.
fn slow_nodes(mu: f64, s: f64, step: f64) -> [(f64, f64); 2] {
    // Moments of order 1, 2, 3 over that of order 0: geometric series.
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
    /// For the derivative of order `mu`, 0 ≤ μ ≤ 1, with weights that are right up to `horizon` \[samples\].
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
        let rungs = J - 2;
        let ladder = Ladder::new(mu, order, horizon, rungs as f64);
        let rung = |i: usize| ladder.top * libm::exp(-ladder.step * i as f64);
        let below = rung(rungs);
        let slow = slow_nodes(mu, below, ladder.step);
        // Σ of step · s^μ over the rungs that the slow nodes stand for.
        let rest = ladder.step * libm::pow(below, mu) / -libm::expm1(-ladder.step * mu);
        let amplitude = libm::sin(PI * mu) / PI;
        let node = |i: usize| {
            if i < rungs {
                (rung(i), amplitude * ladder.step * libm::pow(rung(i), mu))
            } else {
                let (s, share) = slow.get(i - rungs).copied().unwrap_or_default();
                // The limit for μ → 0, where all of the memory is infinitely slow.
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

    /// Largest relative error of a weight over the horizon, rounding of the coefficients included. An error of the
    /// weights is at most an error of about that size of the derivative of any signal. Takes some ten thousand
    /// exponentials.
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
        // The error swings with ln k, once per node; 1e12 is 482 steps away.
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

/// The factor beside s^μ in the sum of a node's weights: `e^(−(HEAD+1)s) ((e^s − 1)/s)^μ φ(s) s/(1 − e^(−s))`, 1 at s
/// = 0.
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

    /// Right up to 1e7 samples.
    fn new(mu: f64, order: GlOrder) -> Result<Self, Error> {
        Self::with_horizon(mu, order, HORIZON)
    }

    fn state(&self) -> Self::State {
        ExponentialsState { ring: Ring::filled(T::ZERO), low_passes: [T::ZERO; J], lost: [T::ZERO; J] }
    }

    fn first(&self) -> T {
        self.first
    }

    #[inline]
    fn advance(&self, s: &mut Self::State, g: T) -> T {
        let old = s.ring.push(g);
        let mut held = differences(&s.ring, &self.head, g);
        let nodes = s.low_passes.iter_mut().zip(&mut s.lost).zip(self.rates.iter().zip(&self.shares));
        for ((q, lost), (rate, share)) in nodes {
            let rise = *rate * (old - *q) + *lost;
            let next = *q + rise;
            *lost = rise - (next - *q);
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
                // 1 − (1 − rate) z⁻¹ without the difference of two numbers near 1.
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
mod tests {
    use super::*;
    use std::vec::Vec;

    const ORDERS: [f64; 8] = [0.01, 0.1, 0.176, 0.466, 0.6596, 0.9, 0.9742, 0.999];
    const BOTH: [GlOrder; 2] = [GlOrder::First, GlOrder::Second];

    /// Derivative times p^μ of `g(1), g(2) …`, from rest at 0.
    fn derivative_of<T: Real, W: Memory<T>>(memory: &W, g: impl Iterator<Item = f64>) -> Vec<f64> {
        let (mut s, mut last, mut held) = (memory.state(), T::ZERO, T::ZERO);
        g.map(|g| {
            let g = T::from_f64(g);
            let d = memory.first() * (g - last) + held;
            (last, held) = (g, memory.advance(&mut s, g));
            d.to_f64()
        })
        .collect()
    }

    #[test]
    fn forty_nodes_are_right_to_4e_7_over_1e7_samples() {
        for order in BOTH {
            for mu in ORDERS {
                let error = |e: Result<f64, Error>| e.unwrap();
                let at =
                    |horizon: f64| error(Exponentials::<f64, 40>::with_horizon(mu, order, horizon).map(|e| e.error()));
                assert!(at(1e7) < 4e-7 && at(1e5) < 1e-8, "{mu} {order:?}");
                assert!(error(Exponentials::<f64, 32>::new(mu, order).map(|e| e.error())) < 9e-6, "{mu} {order:?}");
                assert!(error(Exponentials::<f64, 24>::new(mu, order).map(|e| e.error())) < 3e-4, "{mu} {order:?}");
                // Coefficients rounded to f32 are no worse.
                assert!(error(Exponentials::<f32, 40>::new(mu, order).map(|e| e.error())) < 5e-7, "{mu} {order:?}");
            }
        }
    }

    /// The response to an impulse is the weights: the stated error against the recursion of Eq. 13.
    #[test]
    fn the_stated_error_is_the_error() {
        for order in BOTH {
            for mu in ORDERS {
                let memory = Exponentials::<f64, 24>::with_horizon(mu, order, 1e5).unwrap();
                let impulse = (0..=100_000).map(|k| if k == 0 { 1.0 } else { 0.0 });
                let mut worst: f64 = 0.0;
                let weights = derivative_of(&memory, impulse);
                for (k, (w, exact)) in weights.iter().zip(GlWeights::new(mu, order)).enumerate() {
                    if k <= HEAD {
                        assert!((w - exact).abs() < 1e-14);
                    } else {
                        worst = worst.max((w / exact - 1.0).abs());
                    }
                }
                assert!((worst / memory.error() - 1.0).abs() < 0.03, "{mu} {order:?} {worst} {}", memory.error());
            }
        }
    }

    /// D^μ t^ν = Γ(ν + 1)/Γ(ν + 1 − μ) t^(ν−μ).
    #[test]
    fn the_derivative_of_a_power_is_the_closed_form() {
        let (h, n) = (1e-3, 20_000);
        for (order, close) in [(GlOrder::First, 2e-4), (GlOrder::Second, 3e-7)] {
            for mu in [0.176, 0.6596, 0.9742] {
                for nu in [1.0, 2.0, 2.5] {
                    let memory = Exponentials::<f64, 40>::new(mu, order).unwrap();
                    let t = |k: i32| h * f64::from(k);
                    let d = derivative_of(&memory, (1..=n).map(|k| libm::pow(t(k), nu)));
                    let exact = libm::tgamma(nu + 1.0) / libm::tgamma(nu + 1.0 - mu) * libm::pow(t(n), nu - mu);
                    let error = d[n as usize - 1] * libm::pow(h, -mu) / exact - 1.0;
                    assert!(error.abs() < close, "{order:?} {mu} {nu}: {error}");
                }
            }
        }
    }

    /// After a step the derivative is the sum of the weights so far, Π (1 − μ/i): it goes to zero as n^(−μ).
    #[test]
    fn a_constant_has_no_derivative_in_the_end() {
        let n = 1_000_000;
        for mu in [0.176, 0.6596, 0.9742] {
            let memory = Exponentials::<f64, 40>::new(mu, GlOrder::First).unwrap();
            let d = derivative_of(&memory, (0..=n).map(|_| 1.0));
            let exact = (1..=n).fold(1.0, |sum, i| sum * (1.0 - mu / f64::from(i)));
            assert!((d[n as usize] / exact - 1.0).abs() < 1e-6, "{mu}");
            // Far beyond a short horizon nothing is left, in f32 too.
            let short = Exponentials::<f32, 16>::with_horizon(mu, GlOrder::Second, 1e3).unwrap();
            let d = derivative_of(&short, (0..=n).map(|_| 1.0));
            assert!(d[n as usize].abs() < 0.01 * exact, "{mu} {} {exact}", d[n as usize]);
        }
    }

    #[test]
    fn orders_zero_and_one_are_the_signal_and_its_difference() {
        let g = || (1..300).map(|k| libm::sin(0.3 * f64::from(k)));
        for order in BOTH {
            let d = derivative_of(&Exponentials::<f64, 16>::new(0.0, order).unwrap(), g());
            assert!(g().zip(&d).all(|(g, d)| (g - d).abs() < 1e-14));
        }
        let d = derivative_of(&Exponentials::<f64, 16>::new(1.0, GlOrder::First).unwrap(), g());
        let mut last = 0.0;
        for (g, d) in g().zip(d) {
            assert!((d - (g - last)).abs() < 1e-13);
            last = g;
        }
    }

    #[test]
    fn response_is_the_generating_function_within_the_stated_error() {
        for order in BOTH {
            for mu in ORDERS {
                let memory = Exponentials::<f64, 40>::new(mu, order).unwrap();
                for theta in [3.1, 1.0, 0.1, 1e-2, 1e-4, 1e-6] {
                    let z1 = Complex::polar(1.0, -theta);
                    let exact = order.response(mu, z1);
                    assert!((memory.response(z1) - exact).abs() < 4e-7 * exact.abs(), "{mu} {order:?} {theta}");
                }
                assert!(memory.response(Complex::from(1.0)).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn unusable_arguments_are_refused() {
        assert!(Exponentials::<f64, 7>::new(0.5, GlOrder::First).is_err());
        assert!(Exponentials::<f64, 8>::new(0.5, GlOrder::First).is_ok());
        for mu in [-0.1, 1.1, f64::NAN] {
            assert!(Exponentials::<f64, 16>::new(mu, GlOrder::First).is_err());
        }
        for horizon in [0.0, 99.0, 1e13, f64::INFINITY, f64::NAN] {
            assert!(Exponentials::<f64, 16>::with_horizon(0.5, GlOrder::First, horizon).is_err());
        }
    }
}
