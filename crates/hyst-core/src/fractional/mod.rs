//! Fractional derivatives with bounded memory, and the two linear fractional models of a piezo actuator.
//!
//! A fractional derivative depends on the whole history: the Grünwald-Letnikov sum of eq. 12 gets one more term per
//! sample. [`ShortMemory`] truncates the sum, as the paper does. [`Exponentials`] approximates the whole sum to a
//! stated error with a fixed number of states. [`Lfdm`] and [`Ifm`] accept either.
//!
//! Equation numbers are those of Zhu, To, Li, Zhu and Bian (Mechanical Systems and Signal Processing 110, 2018).

mod exponentials;
mod ifm;
mod lfdm;
mod memory;
mod weights;

pub use exponentials::{Exponentials, ExponentialsState};
pub use ifm::{Ifm, IfmInverse, IfmInverseState, IfmParams, IfmState};
pub use lfdm::{Lfdm, LfdmParams, LfdmState};
pub use memory::{Memory, ShortMemory, ShortMemoryState};
pub use weights::{GlOrder, GlWeights};

#[cfg(test)]
mod testing {
    //! Signals and measures for the tests of both models.

    use super::GlOrder;
    use crate::{Complex, Env, Real, Stage};
    use core::f64::consts::PI;
    use proptest::prelude::{Just, Strategy, prop_oneof};
    use std::vec::Vec;

    /// Generates both orders of accuracy.
    pub(super) fn order() -> impl Strategy<Value = GlOrder> {
        prop_oneof![Just(GlOrder::First), Just(GlOrder::Second)]
    }

    /// Returns the test signal of the paper: five sines, starting at 0.
    pub(super) fn five_sines(t: f64) -> f64 {
        let wave = |hz: f64, phase: f64| libm::sin(2.0 * PI * hz * t + phase) - libm::sin(phase);
        wave(5.0, 0.0) + wave(10.0, 1.0) + wave(15.0, 2.0) + wave(20.0, 3.0) + wave(30.0, 4.0)
    }

    pub(super) fn run<T: Real, S: Stage<T>>(stage: &S, u: &[f64]) -> Vec<f64> {
        let (mut s, e) = (stage.state(), Env::default());
        u.iter()
            .enumerate()
            .map(|(k, u)| {
                let u = T::from_f64(*u);
                if k == 0 { stage.reset(&mut s, &e, u) } else { stage.step(&mut s, &e, u) }.to_f64()
            })
            .collect()
    }

    /// Returns gain and phase of a simulated sine, from the last quarter of `periods` (a multiple of 4) after a start
    /// from rest.
    pub(super) fn measured(stage: &impl Stage<f64>, hz: f64, h: f64, periods: u32) -> Complex {
        let n = libm::round(f64::from(periods) / (hz * h)) as usize;
        let phase = |k: usize| 2.0 * PI * hz * h * k as f64;
        let u: Vec<f64> = (0..n).map(|k| libm::sin(phase(k))).collect();
        let x = run(stage, &u);
        let (mut re, mut im) = (0.0, 0.0);
        for (k, x) in x.iter().enumerate().skip(n - n / 4) {
            re += x * libm::sin(phase(k));
            im += x * libm::cos(phase(k));
        }
        let scale = 2.0 / (n / 4) as f64;
        Complex { re: re * scale, im: im * scale }
    }

    /// Returns a reference with steps, reversals and several frequencies.
    pub(super) fn reference(levels: &[f64], hertz: &[f64]) -> Vec<f64> {
        (0..1500)
            .map(|k| {
                let step = levels.get(k / 100 % levels.len()).copied().unwrap_or(0.0);
                let ramp = (k % 70) as f64 / 70.0;
                hertz.iter().fold(step + ramp, |sum, f| sum + libm::sin(2.0 * PI * f * k as f64))
            })
            .collect()
    }

    pub(super) fn span(x: &[f64]) -> f64 {
        let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        high - low
    }

    /// Returns the largest absolute difference.
    pub(super) fn max_difference(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).fold(0.0, |worst: f64, (a, b)| worst.at_least((a - b).abs()))
    }
}
