//! Relays that take time to turn: rate-dependent hysteresis.
//!
//! Each relay is a wall that an overdrive pushes against a viscous drag (Bertotti's dynamic Preisach bed): above its upper
//! threshold its state φ rises, below its lower one it falls, in between it stays,
//!
//! ```text
//! φ' = (u − α) / J  for u > α,    φ' = (u − β) / J  for u < β,    0 ≤ φ ≤ 1.
//! ```
//!
//! J \[V·s\] is the overdrive over time that turns the relay, different for each. Loops widen with about the root of the rate
//! and the output at the peaks falls. Nothing here is a function of a branch's rate or swing.

use super::config::Viscosity;
use super::rng::{Draws, Purpose};

/// A bed of viscous relays; thresholds are in `relays.rs`.
#[derive(Debug, Clone)]
pub(crate) struct ViscousBed {
    /// Upper thresholds, ascending; the position is the relay's number.
    alpha: Vec<f64>,
    /// Lower thresholds, ascending, with the relay's number.
    beta: Vec<(f64, u32)>,
    /// The lower threshold of each relay.
    lower: Vec<f64>,
    /// Fine step over J of each relay \[1/V\].
    per_volt: Vec<f64>,
    impulse: Vec<f64>,
    now: Walls,
    virgin: Walls,
}

#[derive(Debug, Clone)]
struct Walls {
    phi: Vec<f64>,
    /// Relays that may be moving, and whether a relay is among them.
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
    /// A virgin bed of relays `(alpha, beta)`, ascending in alpha, at input `rest`: those centred below `rest` are up.
    pub(crate) fn new(seed: u64, thresholds: &[(f64, f64)], rest: f64, viscosity: &Viscosity) -> Self {
        let mut draws = Draws::new(seed, Purpose::Viscosity);
        let alpha: Vec<f64> = thresholds.iter().map(|t| t.0).collect();
        let mut beta: Vec<(f64, u32)> = (0_u32..).zip(thresholds).map(|(i, t)| (t.1, i)).collect();
        beta.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // A fifth of the drag is every relay's, the rest is spread as lifetimes are.
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

    /// One step in which the input moves in a straight line to `u`; the walls feel its middle.
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
        // The marks that the input left behind in the other direction only follow.
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
            // One that no threshold drives, or that has arrived, is listed again at the next crossing.
            let goes_on = (over > 0.0 && moved < 1.0) || (over < 0.0 && moved > 0.0);
            listed[i] = goes_on;
            goes_on
        });
    }

    /// Sum of all φ: how many relays are up, in parts.
    pub(crate) fn count(&self) -> f64 {
        self.now.sum
    }

    /// Back to the virgin state.
    pub(crate) fn reset(&mut self) {
        self.now.clone_from(&self.virgin);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAG: Viscosity = Viscosity { volt_seconds: 1e-3 };

    #[test]
    fn one_relay_turns_when_the_overdrive_has_done_its_work() {
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
        // Between the thresholds it stays, below the lower one it falls.
        (0..1000).for_each(|_| bed.move_to(7.0));
        let held = bed.count();
        assert!(held > 0.5);
        (0..((2.0 * j / step) as u32)).for_each(|_| bed.move_to(3.0));
        assert_eq!(bed.count(), 0.0);
        bed.reset();
        assert_eq!(bed.count(), 0.0);
    }

    #[test]
    fn the_walk_over_moving_walls_agrees_with_asking_every_wall() {
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
