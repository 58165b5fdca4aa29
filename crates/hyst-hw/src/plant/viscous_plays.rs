//! Viscous play operators: rate-dependent hysteresis.
//!
//! A play operator with the overdrive `o = |u − p| − r > 0` follows at the rate
//!
//! ```text
//! |p'| = o² / J,
//! ```
//!
//! with a different J \[V·s\] for each. On a ramp it lags by the root of J times the rate, like viscous relays.

use super::config::Viscosity;
use super::plays::Play;
use super::rng::{Draws, Purpose};

/// Number of interleaved sums. The order is fixed, and the compiler can vectorise it.
const LANES: usize = 4;

/// A bed of viscous play operators with the output `Σ w p`.
#[derive(Debug, Clone)]
pub(crate) struct ViscousPlays {
    thresholds: Vec<f64>,
    weights: Vec<f64>,
    impulses: Vec<f64>,
    /// Step divided by J, for each play operator \[1/V\].
    per_volt: Vec<f64>,
    rest: f64,
    /// Positions, counted from rest \[V\].
    positions: Vec<f64>,
    input: f64,
}

impl ViscousPlays {
    /// Returns a virgin bed at the input `rest`.
    pub(crate) fn new(seed: u64, plays: &[Play], rest: f64, viscosity: &Viscosity) -> Self {
        let mut draws = Draws::new(seed, Purpose::Viscosity);
        // Play operators with weight 0 fill the last group.
        let padded = plays.len().next_multiple_of(LANES);
        let filled = |of: fn(&Play) -> f64| -> Vec<f64> {
            plays.iter().map(of).chain(std::iter::repeat(0.0)).take(padded).collect()
        };
        Self {
            thresholds: filled(|play| play.threshold),
            weights: filled(|play| play.weight),
            // 20 % of the mean drag is the same for all; the rest has an exponential distribution.
            impulses: (0..padded).map(|_| viscosity.volt_seconds * (0.2 + 0.8 * draws.exponential())).collect(),
            per_volt: vec![0.0; padded],
            rest,
            positions: vec![0.0; padded],
            input: 0.0,
        }
    }

    /// Sets the step of [`move_to`](Self::move_to) (s).
    pub(crate) fn set_step(&mut self, step_s: f64) {
        self.per_volt = self.impulses.iter().map(|j| step_s / j).collect();
    }

    /// Computes one step to the input `v` and returns `Σ w p`.
    ///
    /// The input at mid-step acts on the play operators.
    pub(crate) fn move_to(&mut self, v: f64) -> f64 {
        let u = v - self.rest;
        let middle = 0.5 * (self.input + u);
        self.input = u;
        let mut sums = [0.0; LANES];
        let groups = self.positions.chunks_exact_mut(LANES).zip(self.thresholds.chunks_exact(LANES));
        let rates = self.per_volt.chunks_exact(LANES).zip(self.weights.chunks_exact(LANES));
        for ((positions, thresholds), (rates, weights)) in groups.zip(rates) {
            for lane in 0..LANES {
                let apart = middle - positions[lane];
                let over = (apart.abs() - thresholds[lane]).max(0.0);
                // Exact for a constant input: o' = −o² / J has the solution o / (1 + o t / J).
                let decay = over * rates[lane];
                positions[lane] += (over * decay / (1.0 + decay)).copysign(apart);
                sums[lane] += weights[lane] * positions[lane];
            }
        }
        (sums[0] + sums[1]) + (sums[2] + sums[3])
    }

    /// Returns to the virgin state.
    pub(crate) fn reset(&mut self) {
        self.positions.fill(0.0);
        self.input = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAG: Viscosity = Viscosity { volt_seconds: 1e-3 };

    #[test]
    fn a_play_operator_follows_a_ramp_with_the_lag_of_its_drag() {
        let play = Play { threshold: 10.0, weight: 1.0 };
        let mut bed = ViscousPlays::new(3, &[play], 5.0, &DRAG);
        let (step, rate) = (1e-6, 1000.0);
        bed.set_step(step);
        let lag = (bed.impulses[0] * rate).sqrt();
        for k in 1..=100_000 {
            let u = rate * step * f64::from(k);
            let p = bed.move_to(5.0 + u);
            // o' = rate − o² / J from 0 on.
            let expected = (u - 10.0).max(0.0) - lag * ((u - 10.0).max(0.0) / lag).tanh();
            assert!((p - expected).abs() < 2e-3, "{u}: {p} {expected}");
        }
        // It does not move between its thresholds, and it converges for a constant input.
        let held = bed.move_to(97.0);
        assert_eq!(bed.move_to(95.0), held);
        let caught = (0..2_000_000).map(|_| bed.move_to(105.0)).last().unwrap();
        assert!((caught - 90.0).abs() < 0.01, "{caught}");
        bed.reset();
        assert_eq!(bed.move_to(5.0), 0.0);
    }
}
