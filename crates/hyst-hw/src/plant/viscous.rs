//! Viscous relays: rate-dependent hysteresis.
//!
//! Each relay is a domain wall that moves against a viscous drag (dynamic Preisach model of Bertotti). Its state φ
//! increases above the upper threshold α, decreases below the lower threshold β, and is constant in between:
//!
//! ```text
//! φ' = (u − α) / J  for u > α,    φ' = (u − β) / J  for u < β,    0 ≤ φ ≤ 1.
//! ```
//!
//! J \[V·s\], different for each relay, is the time integral of the overdrive that switches it. The loop widens
//! approximately with the root of the rate, and the output at the peaks decreases.

use super::config::Viscosity;
use super::rng::{Draws, Purpose};

/// A bed of viscous relays; `relays.rs` draws the thresholds.
#[derive(Debug, Clone)]
pub(crate) struct ViscousBed {
    /// Upper thresholds, ascending; the index is the relay's number.
    alpha: Vec<f64>,
    /// Lower thresholds, ascending, with the relay's number.
    beta: Vec<(f64, u32)>,
    /// The lower threshold of each relay.
    lower: Vec<f64>,
    /// Fine step divided by J, for each relay \[1/V\].
    per_volt: Vec<f64>,
    impulse: Vec<f64>,
    now: Walls,
    virgin: Walls,
}

#[derive(Debug, Clone)]
struct Walls {
    phi: Vec<f64>,
    /// Relays that may be in motion, and whether each relay is in this list.
    moving: Vec<u32>,
    listed: Vec<bool>,
    /// Sum of all φ.
    sum: f64,
    u: f64,
    /// `alpha[..reached]` are below the input.
    reached: usize,
    /// `beta[..passed]` are at or below the input.
    passed: usize,
}

impl ViscousBed {
    /// Returns a virgin bed of relays `(alpha, beta)`, ascending in alpha, at the input `rest`.
    ///
    /// Relays centred below `rest` are up.
    pub(crate) fn new(seed: u64, thresholds: &[(f64, f64)], rest: f64, viscosity: &Viscosity) -> Self {
        let mut draws = Draws::new(seed, Purpose::Viscosity);
        let alpha: Vec<f64> = thresholds.iter().map(|t| t.0).collect();
        let mut beta: Vec<(f64, u32)> = (0_u32..).zip(thresholds).map(|(i, t)| (t.1, i)).collect();
        beta.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // 20 % of the mean drag is the same for all; the rest has an exponential distribution.
        let impulse = thresholds.iter().map(|_| viscosity.volt_seconds * (0.2 + 0.8 * draws.exponential())).collect();
        let phi: Vec<f64> = thresholds.iter().map(|t| if t.0 + t.1 < 2.0 * rest { 1.0 } else { 0.0 }).collect();
        let virgin = Walls {
            sum: phi.iter().sum(),
            moving: Vec::new(),
            listed: vec![false; phi.len()],
            phi,
            u: rest,
            reached: alpha.partition_point(|a| *a < rest),
            passed: beta.partition_point(|b| b.0 <= rest),
        };
        Self {
            lower: thresholds.iter().map(|t| t.1).collect(),
            per_volt: vec![0.0; thresholds.len()],
            alpha,
            beta,
            impulse,
            now: virgin.clone(),
            virgin,
        }
    }

    /// Sets the step of [`move_to`](Self::move_to) (s).
    pub(crate) fn set_step(&mut self, step_s: f64) {
        self.per_volt = self.impulse.iter().map(|j| step_s / j).collect();
    }

    /// Computes one step to the input `u`. The input at mid-step acts on the relays.
    pub(crate) fn move_to(&mut self, u: f64) {
        let Self { alpha, beta, lower, per_volt, now, .. } = self;
        let middle = 0.5 * (now.u + u);
        now.u = u;
        let list = |moving: &mut Vec<u32>, listed: &mut [bool], i: u32| {
            if !std::mem::replace(&mut listed[i as usize], true) {
                moving.push(i);
            }
        };
        while now.reached < alpha.len() && alpha[now.reached] < middle {
            list(&mut now.moving, &mut now.listed, now.reached as u32);
            now.reached += 1;
        }
        while now.passed > 0 && beta[now.passed - 1].0 > middle {
            now.passed -= 1;
            list(&mut now.moving, &mut now.listed, beta[now.passed].1);
        }
        // Update the indices for the other direction.
        while now.reached > 0 && alpha[now.reached - 1] >= middle {
            now.reached -= 1;
        }
        while now.passed < beta.len() && beta[now.passed].0 <= middle {
            now.passed += 1;
        }
        let Walls { phi, moving, listed, sum, .. } = now;
        moving.retain(|i| {
            let i = *i as usize;
            let over = if middle > alpha[i] { middle - alpha[i] } else { (middle - lower[i]).min(0.0) };
            let moved = (phi[i] + over * per_volt[i]).clamp(0.0, 1.0);
            *sum += moved - phi[i];
            phi[i] = moved;
            // A relay without overdrive, or at its end state, leaves the list until the next crossing.
            let moves = (over > 0.0 && moved < 1.0) || (over < 0.0 && moved > 0.0);
            listed[i] = moves;
            moves
        });
    }

    /// Returns the sum of all φ.
    pub(crate) fn count(&self) -> f64 {
        self.now.sum
    }

    /// Returns to the virgin state.
    pub(crate) fn reset(&mut self) {
        self.now.clone_from(&self.virgin);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAG: Viscosity = Viscosity { volt_seconds: 1e-3 };

    #[test]
    fn a_relay_switches_with_the_time_integral_of_its_overdrive() {
        let mut bed = ViscousBed::new(3, &[(10.0, 4.0)], 0.0, &DRAG);
        let step = 1e-7;
        bed.set_step(step);
        let j = bed.impulse[0];
        // A ramp of 1000 V/s through 10 V: φ = r t² / (2 J), until 1.
        let rate = 1000.0;
        for k in 1..=150_000 {
            let u = rate * step * f64::from(k);
            bed.move_to(u);
            let t = ((u - 10.0) / rate).max(0.0);
            let expected = (0.5 * rate * t * t / j).min(1.0);
            assert!((bed.count() - expected).abs() < 1e-4, "{u}: {} {expected}", bed.count());
        }
        // It is constant between the thresholds and decreases below the lower one.
        (0..1000).for_each(|_| bed.move_to(7.0));
        let held = bed.count();
        assert!(held > 0.5);
        (0..((2.0 * j / step) as u32)).for_each(|_| bed.move_to(3.0));
        assert_eq!(bed.count(), 0.0);
        bed.reset();
        assert_eq!(bed.count(), 0.0);
    }

    #[test]
    fn the_bed_agrees_with_a_sum_over_all_relays() {
        let mut draws = Draws::new(5, Purpose::Relays);
        let mut thresholds: Vec<(f64, f64)> = (0..400)
            .map(|_| {
                let (centre, half) = (draws.between(-10.0, 110.0), 10.0 * draws.exponential());
                (centre + half, centre - half)
            })
            .collect();
        thresholds.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut bed = ViscousBed::new(1, &thresholds, 0.0, &DRAG);
        let step = 2e-5;
        bed.set_step(step);
        let mut phi: Vec<f64> = thresholds.iter().map(|t| f64::from(u8::from(t.0 + t.1 < 0.0))).collect();
        let (mut last, mut u) = (0.0, 0.0);
        for k in 0..4000 {
            if k % 40 == 0 {
                last = u;
                u = draws.between(0.0, 100.0);
            }
            let to = last + (u - last) * f64::from(k % 40 + 1) / 40.0;
            let from = last + (u - last) * f64::from(k % 40) / 40.0;
            bed.move_to(to);
            for (i, (phi, t)) in phi.iter_mut().zip(&thresholds).enumerate() {
                let middle = 0.5 * (from + to);
                let over = (middle - t.0).max(0.0) + (middle - t.1).min(0.0);
                *phi = (*phi + over * step / bed.impulse[i]).clamp(0.0, 1.0);
            }
            let expected: f64 = phi.iter().sum();
            assert!((bed.count() - expected).abs() < 1e-6, "{k}: {} {expected}", bed.count());
        }
    }
}
