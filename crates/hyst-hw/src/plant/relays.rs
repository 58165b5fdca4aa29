//! Hysteresis as a bed of many independent relays with random thresholds.
//!
//! Nothing here is a play operator or a threshold grid: the models that are fitted to the plant
//! cannot be right by construction.

use super::config::{Actuator, Viscosity};
use super::error::ConfigError;
use super::rng::{Draws, Purpose};
use super::viscous::ViscousBed;

/// Relays that go up when the input reaches `alpha` and down when it reaches `beta < alpha`.
#[derive(Debug, Clone)]
pub(crate) struct RelayBed {
    /// Upper thresholds, ascending; the position here is the relay's number.
    alpha: Vec<f64>,
    /// Lower thresholds, ascending, with the relay's number.
    beta: Vec<(f64, u32)>,
    now: BedState,
    virgin: BedState,
}

#[derive(Debug, Clone)]
struct BedState {
    up: Vec<bool>,
    /// How many relays are up.
    count: usize,
    /// `alpha[..reached]` are at or below the input.
    reached: usize,
    /// `beta[..passed]` are below the input.
    passed: usize,
}

impl RelayBed {
    /// A virgin bed of relays `(alpha, beta)`, ascending in alpha, at input `rest`: those centred below `rest` are up.
    pub(crate) fn new(thresholds: &[(f64, f64)], rest: f64) -> Self {
        let alpha: Vec<f64> = thresholds.iter().map(|t| t.0).collect();
        let mut beta: Vec<(f64, u32)> = (0_u32..).zip(thresholds).map(|(i, t)| (t.1, i)).collect();
        beta.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let up: Vec<bool> = thresholds.iter().map(|t| t.0 + t.1 < 2.0 * rest).collect();
        let virgin = BedState {
            count: up.iter().filter(|up| **up).count(),
            up,
            reached: alpha.partition_point(|a| *a <= rest),
            passed: beta.partition_point(|b| b.0 < rest),
        };
        Self { alpha, beta, now: virgin.clone(), virgin }
    }

    /// Moves the input monotonically to `u`; visits only relays whose threshold lies on the way.
    pub(crate) fn move_to(&mut self, u: f64) {
        let now = &mut self.now;
        while now.reached < self.alpha.len() && self.alpha[now.reached] <= u {
            let up = &mut now.up[now.reached];
            now.count += usize::from(!*up);
            *up = true;
            now.reached += 1;
        }
        while now.passed > 0 && self.beta[now.passed - 1].0 >= u {
            now.passed -= 1;
            let up = &mut now.up[self.beta[now.passed].1 as usize];
            now.count -= usize::from(*up);
            *up = false;
        }
        // The marks that the input left behind in the other direction only follow.
        while now.reached > 0 && self.alpha[now.reached - 1] > u {
            now.reached -= 1;
        }
        while now.passed < self.beta.len() && self.beta[now.passed].0 < u {
            now.passed += 1;
        }
    }

    /// How many relays are up: all weights are equal, so the memory is exact and no rounding builds up.
    pub(crate) fn count(&self) -> usize {
        self.now.count
    }

    /// Back to the virgin state.
    pub(crate) fn reset(&mut self) {
        self.now.clone_from(&self.virgin);
    }
}

/// Draws `(alpha, beta)` pairs over `min..max`. The shape of the density comes from the stream too:
/// half-widths from a mixture of an exponential and a gamma law, centres from a uniform law that
/// reaches beyond the range plus a broad bump, and half-widths that grow or shrink along the range.
fn draw_thresholds(draws: &mut Draws, relays: usize, min: f64, max: f64) -> Vec<(f64, f64)> {
    let narrow_share = draws.between(0.25, 0.5);
    let narrow = draws.between(0.05, 0.09);
    let wide = draws.between(0.18, 0.26);
    let bump_share = draws.between(0.1, 0.25);
    let bump_centre = draws.between(0.4, 0.6);
    let bump_width = draws.between(0.2, 0.3);
    let tilt = draws.between(-0.15, 0.15);
    let span = max - min;
    (0..relays)
        .map(|_| {
            let centre = if draws.unit() < bump_share {
                bump_centre + bump_width * draws.normal()
            } else {
                draws.between(-0.1, 1.1)
            };
            let law = if draws.unit() < narrow_share {
                narrow * draws.exponential()
            } else {
                0.5 * wide * (draws.exponential() + draws.exponential())
            };
            let along = (2.0 * centre - 1.0).clamp(-1.0, 1.0);
            let half_width = (law * (1.0 + tilt * along)).max(1e-6);
            (min + span * (centre + half_width), min + span * (centre - half_width))
        })
        .collect()
}

/// Relays that turn at once, or take their time.
#[derive(Debug, Clone)]
enum Bed {
    Quick(RelayBed),
    Viscous(ViscousBed),
}

/// The hysteretic element: relays and a reversible linear part, scaled to the span and opening that it has when it is
/// driven slowly.
#[derive(Debug, Clone)]
pub(crate) struct Hysteresis {
    bed: Bed,
    rest_v: f64,
    linear_um_per_v: f64,
    um_per_relay: f64,
    /// Count of relays that are up in the virgin state: displacement is 0 there.
    virgin: f64,
}

impl Hysteresis {
    /// Draws the bed and scales it: the major loop spans `gain · (max - min)` and opens by
    /// `loop_share` of that at its widest.
    pub(crate) fn new(seed: u64, actuator: &Actuator, viscosity: Option<&Viscosity>) -> Result<Self, ConfigError> {
        let &Actuator { min_v, max_v, rest_v, gain_um_per_v: gain, loop_share, relays } = actuator;
        if loop_share == 0.0 {
            let bed = RelayBed::new(&[], rest_v);
            return Ok(Self { bed: Bed::Quick(bed), rest_v, linear_um_per_v: gain, um_per_relay: 0.0, virgin: 0.0 });
        }
        let mut draws = Draws::new(seed, Purpose::Relays);
        let mut thresholds = draw_thresholds(&mut draws, relays, min_v, max_v);
        thresholds.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut bed = RelayBed::new(&thresholds, rest_v);
        let (swing, opening) = major_loop(&mut bed, min_v, max_v);
        bed.reset();
        // Share of the span that the relays must carry for the asked opening.
        let share = loop_share * swing / opening;
        if !(share > 0.0 && share <= 1.0) {
            let advice =
                format!("the bed of this seed opens by {:.3} at most: give less, or another seed", opening / swing);
            return Err(ConfigError::value("actuator.loop_share", loop_share, advice));
        }
        Ok(Self {
            virgin: bed.count() as f64,
            bed: match viscosity {
                None => Bed::Quick(bed),
                Some(viscosity) => Bed::Viscous(ViscousBed::new(seed, &thresholds, rest_v, viscosity)),
            },
            rest_v,
            linear_um_per_v: gain * (1.0 - share),
            um_per_relay: gain * (max_v - min_v) * share / swing,
        })
    }

    /// Sets how long a move takes (s); quick relays do not care.
    pub(crate) fn set_step(&mut self, step_s: f64) {
        if let Bed::Viscous(bed) = &mut self.bed {
            bed.set_step(step_s);
        }
    }

    /// Moves the input monotonically to `v` (V), in one step; returns the displacement from the virgin rest (µm).
    pub(crate) fn move_to(&mut self, v: f64) -> f64 {
        let up = match &mut self.bed {
            Bed::Quick(bed) => {
                bed.move_to(v);
                bed.count() as f64
            }
            Bed::Viscous(bed) => {
                bed.move_to(v);
                bed.count()
            }
        };
        self.linear_um_per_v * (v - self.rest_v) + self.um_per_relay * (up - self.virgin)
    }

    pub(crate) fn reset(&mut self) {
        match &mut self.bed {
            Bed::Quick(bed) => bed.reset(),
            Bed::Viscous(bed) => bed.reset(),
        }
    }
}

/// Span and greatest opening of the loop between `min` and `max`, in relays.
fn major_loop(bed: &mut RelayBed, min: f64, max: f64) -> (f64, f64) {
    const STEPS: u32 = 400;
    let at = |k: u32| min + (max - min) * f64::from(k) / f64::from(STEPS);
    let mut visit = |k| {
        bed.move_to(at(k));
        bed.count() as f64
    };
    visit(STEPS);
    visit(0);
    let rising: Vec<f64> = (0..=STEPS).map(&mut visit).collect();
    let falling: Vec<f64> = (0..=STEPS).rev().map(&mut visit).collect();
    let opening = falling.iter().rev().zip(&rising).map(|(f, r)| f - r).fold(0.0, f64::max);
    (rising[STEPS as usize] - rising[0], opening)
}

#[cfg(test)]
mod tests {
    use super::super::config::tests::clean;
    use super::*;

    fn actuator() -> Actuator {
        Actuator { loop_share: 0.12, relays: 12_000, ..clean().actuator }
    }

    fn play(h: &mut Hysteresis, inputs: &[f64]) -> f64 {
        inputs.iter().map(|v| h.move_to(*v)).last().unwrap()
    }

    #[test]
    fn sorted_walk_agrees_with_asking_every_relay() {
        let mut draws = Draws::new(5, Purpose::Relays);
        let mut thresholds = draw_thresholds(&mut draws, 500, 0.0, 100.0);
        thresholds.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut bed = RelayBed::new(&thresholds, 0.0);
        let mut naive: Vec<bool> = thresholds.iter().map(|t| t.0 + t.1 < 0.0).collect();
        for _ in 0..2000 {
            let u = draws.between(-10.0, 110.0);
            bed.move_to(u);
            for (up, (alpha, beta)) in naive.iter_mut().zip(&thresholds) {
                *up = u >= *alpha || (*up && u > *beta);
            }
            assert_eq!(bed.count(), naive.iter().filter(|up| **up).count());
        }
    }

    #[test]
    fn return_point_memory_and_wiping_out() {
        let mut h = Hysteresis::new(9, &actuator(), None).unwrap();
        let outer = play(&mut h, &[80.0, 20.0]);
        let inner = play(&mut h, &[60.0, 35.0]);
        // A minor loop closes exactly where it began.
        assert_eq!(play(&mut h, &[50.0, 35.0]), inner);
        // The input that passes the outer extremes leaves no trace of what was inside.
        assert_eq!(play(&mut h, &[60.0, 20.0]), outer);
        let mut plain = Hysteresis::new(9, &actuator(), None).unwrap();
        play(&mut plain, &[90.0, 10.0]);
        play(&mut h, &[90.0, 10.0]);
        assert_eq!(h.move_to(47.0), plain.move_to(47.0));
    }

    #[test]
    fn output_does_not_depend_on_the_steps_of_a_monotone_move() {
        let mut coarse = Hysteresis::new(2, &actuator(), None).unwrap();
        let mut fine = coarse.clone();
        let path: Vec<f64> = (0..=700).map(|k| 0.1 * f64::from(k)).collect();
        assert_eq!(coarse.move_to(70.0), play(&mut fine, &path));
    }

    #[test]
    fn reset_is_as_good_as_new() {
        let fresh = Hysteresis::new(4, &actuator(), None).unwrap();
        let mut used = fresh.clone();
        play(&mut used, &[100.0, 3.0, 77.0, 12.0]);
        used.reset();
        let mut new = fresh;
        assert_eq!(new.move_to(0.0), 0.0);
        for v in [0.0, 40.0, 15.0, 95.0] {
            assert_eq!(used.move_to(v), new.move_to(v));
        }
    }

    #[test]
    fn span_and_opening_are_the_declared_ones_for_many_seeds() {
        for seed in 0..40 {
            let mut h = Hysteresis::new(seed, &actuator(), None).unwrap();
            assert!(h.linear_um_per_v > 0.0);
            let top = play(&mut h, &[100.0]);
            let bottom = play(&mut h, &[0.0]);
            assert!((top - bottom - 10.0).abs() < 1e-9);
            let rising: Vec<f64> = (0..=100).map(|k| h.move_to(f64::from(k))).collect();
            let falling: Vec<f64> = (0..=100).rev().map(|k| h.move_to(f64::from(k))).collect();
            let opening = falling.iter().rev().zip(&rising).map(|(f, r)| f - r).fold(0.0, f64::max);
            assert!((opening / 10.0 - 0.12).abs() < 0.002, "seed {seed}: {opening}");
            // Both branches rise with the input.
            assert!(rising.is_sorted() && falling.is_sorted_by(|a, b| a >= b));
        }
    }

    /// Opening of a 0 to 100 V loop at a rate (V/s), over its span when slow, and the highest output.
    fn loop_at(rate: f64, viscosity: Option<&Viscosity>) -> (f64, f64) {
        let mut h = Hysteresis::new(3, &actuator(), viscosity).unwrap();
        let step_s = 1e-6;
        h.set_step(step_s);
        let steps = (100.0 / (rate * step_s)) as u32;
        let mut ramp = |from: f64, to: f64| -> Vec<f64> {
            (1..=steps).map(|k| h.move_to(from + (to - from) * f64::from(k) / f64::from(steps))).collect()
        };
        ramp(0.0, 100.0);
        ramp(100.0, 0.0);
        let (rising, falling) = (ramp(0.0, 100.0), ramp(100.0, 0.0));
        let opening = rising.iter().zip(falling.iter().rev()).map(|(r, f)| f - r).fold(0.0, f64::max);
        (opening / 10.0, rising.iter().chain(&falling).copied().fold(0.0, f64::max))
    }

    #[test]
    fn viscous_loops_widen_with_the_rate_and_are_the_quick_ones_when_slow() {
        let drag = Viscosity { volt_seconds: 4e-4 };
        let quick = loop_at(500.0, None);
        let loops = [50.0, 2000.0, 8000.0, 32_000.0].map(|rate| loop_at(rate, Some(&drag)));
        assert!(
            (loops[0].0 - quick.0).abs() < 0.004 && (loops[0].1 / quick.1 - 1.0).abs() < 0.003,
            "{quick:?} {loops:?}"
        );
        for pair in loops.windows(2) {
            assert!(pair[1].0 > pair[0].0 + 0.004 && pair[1].1 < pair[0].1, "{loops:?}");
        }
    }
}
