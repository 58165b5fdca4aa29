//! The hysteresis: a bed of many elements and a reversible linear part.

use super::config::{Actuator, Bed, Viscosity};
use super::error::ConfigError;
use super::plays::{PlayBed, draw_plays};
use super::relays::{RelayBed, draw_clumps, draw_thresholds};
use super::rng::{Draws, Purpose};
use super::viscous::ViscousBed;
use super::viscous_plays::ViscousPlays;

/// Beds of elements, rate-independent or viscous.
#[derive(Debug, Clone)]
enum Elements {
    Relays(RelayBed),
    ViscousRelays(ViscousBed),
    Plays(PlayBed),
    ViscousPlays(ViscousPlays),
}

impl Elements {
    /// Returns the bed of `seed` in the virgin state.
    fn new(seed: u64, actuator: &Actuator, viscosity: Option<&Viscosity>) -> Self {
        let &Actuator { min_v, max_v, rest_v, relays: elements, .. } = actuator;
        match actuator.bed {
            Bed::Relays | Bed::Clumps => {
                let law = if actuator.bed == Bed::Clumps { draw_clumps } else { draw_thresholds };
                let thresholds = law(&mut Draws::new(seed, Purpose::Relays), elements, min_v, max_v);
                match viscosity {
                    None => Self::Relays(RelayBed::new(&thresholds, rest_v)),
                    Some(viscosity) => Self::ViscousRelays(ViscousBed::new(seed, &thresholds, rest_v, viscosity)),
                }
            }
            Bed::Plays => {
                let plays = draw_plays(&mut Draws::new(seed, Purpose::Plays), elements, max_v - min_v);
                match viscosity {
                    None => Self::Plays(PlayBed::new(&plays, rest_v)),
                    Some(viscosity) => Self::ViscousPlays(ViscousPlays::new(seed, &plays, rest_v, viscosity)),
                }
            }
        }
    }

    /// Moves the input monotonically to `v` in one step and returns the output of the bed.
    ///
    /// The output is the number of relays that are up, or the weighted sum of all play operators.
    fn move_to(&mut self, v: f64) -> f64 {
        match self {
            Self::Relays(bed) => {
                bed.move_to(v);
                bed.count() as f64
            }
            Self::ViscousRelays(bed) => {
                bed.move_to(v);
                bed.count()
            }
            Self::Plays(bed) => bed.move_to(v),
            Self::ViscousPlays(bed) => bed.move_to(v),
        }
    }

    fn set_step(&mut self, step_s: f64) {
        match self {
            Self::Relays(_) | Self::Plays(_) => {}
            Self::ViscousRelays(bed) => bed.set_step(step_s),
            Self::ViscousPlays(bed) => bed.set_step(step_s),
        }
    }

    fn reset(&mut self) {
        match self {
            Self::Relays(bed) => bed.reset(),
            Self::ViscousRelays(bed) => bed.reset(),
            Self::Plays(bed) => bed.reset(),
            Self::ViscousPlays(bed) => bed.reset(),
        }
    }
}

/// Bed and linear part, scaled to span and opening of the loop at low rates.
#[derive(Debug, Clone)]
pub(crate) struct Hysteresis {
    /// `None` without hysteresis.
    bed: Option<Elements>,
    rest_v: f64,
    linear_um_per_v: f64,
    /// Displacement per unit of the bed's output.
    um_per_unit: f64,
    /// Output of the bed in the virgin state, where the displacement is 0.
    virgin: f64,
}

impl Hysteresis {
    /// Draws the bed and scales it.
    ///
    /// The major loop has the span `gain · (max - min)` and the largest opening `loop_share` times this span.
    pub(crate) fn new(seed: u64, actuator: &Actuator, viscosity: Option<&Viscosity>) -> Result<Self, ConfigError> {
        let &Actuator { min_v, max_v, rest_v, gain_um_per_v: gain, loop_share, .. } = actuator;
        if loop_share == 0.0 {
            return Ok(Self { bed: None, rest_v, linear_um_per_v: gain, um_per_unit: 0.0, virgin: 0.0 });
        }
        let mut bed = Elements::new(seed, actuator, None);
        let virgin = bed.move_to(rest_v);
        let (swing, opening) = major_loop(&mut bed, min_v, max_v);
        // Share of the span in the bed that gives the requested opening.
        let share = loop_share * swing / opening;
        if !(share > 0.0 && share <= 1.0) {
            let advice =
                format!("the loop of this seed opens by at most {:.3}: give less, or another seed", opening / swing);
            return Err(ConfigError::value("actuator.loop_share", loop_share, advice));
        }
        if viscosity.is_some() {
            bed = Elements::new(seed, actuator, viscosity);
        } else {
            bed.reset();
        }
        Ok(Self {
            bed: Some(bed),
            rest_v,
            linear_um_per_v: gain * (1.0 - share),
            um_per_unit: gain * (max_v - min_v) * share / swing,
            virgin,
        })
    }

    /// Sets the duration of a move (s); it has no effect on rate-independent elements.
    pub(crate) fn set_step(&mut self, step_s: f64) {
        if let Some(bed) = &mut self.bed {
            bed.set_step(step_s);
        }
    }

    /// Moves the input monotonically to `v` (V) in one step; returns the displacement from rest (µm).
    pub(crate) fn move_to(&mut self, v: f64) -> f64 {
        let output = self.bed.as_mut().map_or(0.0, |bed| bed.move_to(v));
        self.linear_um_per_v * (v - self.rest_v) + self.um_per_unit * (output - self.virgin)
    }

    pub(crate) fn reset(&mut self) {
        if let Some(bed) = &mut self.bed {
            bed.reset();
        }
    }
}

/// Returns span and largest opening of the loop between `min` and `max`, in units of the bed's output.
fn major_loop(bed: &mut Elements, min: f64, max: f64) -> (f64, f64) {
    const STEPS: u32 = 400;
    let mut visit = |k: u32| bed.move_to(min + (max - min) * f64::from(k) / f64::from(STEPS));
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

    const BEDS: [Bed; 2] = [Bed::Relays, Bed::Plays];

    fn actuator(bed: Bed) -> Actuator {
        Actuator { loop_share: 0.12, bed, relays: 12_000, ..clean().actuator }
    }

    fn element(seed: u64, bed: Bed) -> Hysteresis {
        Hysteresis::new(seed, &actuator(bed), None).unwrap()
    }

    fn play(h: &mut Hysteresis, inputs: &[f64]) -> f64 {
        inputs.iter().map(|v| h.move_to(*v)).last().unwrap()
    }

    fn opening(rising: &[f64], falling: &[f64]) -> f64 {
        rising.iter().zip(falling.iter().rev()).map(|(r, f)| f - r).fold(0.0, f64::max)
    }

    #[test]
    fn return_point_memory_and_wiping_out() {
        // The output of relays is a count, so it is exact.
        for (bed, rounding) in [(Bed::Relays, 0.0), (Bed::Plays, 1e-12)] {
            let mut h = element(9, bed);
            let outer = play(&mut h, &[80.0, 20.0]);
            let inner = play(&mut h, &[60.0, 35.0]);
            // A minor loop closes at its start.
            assert!((play(&mut h, &[50.0, 35.0]) - inner).abs() <= rounding);
            // An input beyond the outer extremes wipes out the inner ones.
            assert!((play(&mut h, &[60.0, 20.0]) - outer).abs() <= rounding);
            let mut plain = element(9, bed);
            play(&mut plain, &[90.0, 10.0]);
            play(&mut h, &[90.0, 10.0]);
            assert!((h.move_to(47.0) - plain.move_to(47.0)).abs() <= rounding);
        }
    }

    #[test]
    fn the_output_does_not_depend_on_the_steps_of_a_monotone_move() {
        for bed in BEDS {
            let mut coarse = element(2, bed);
            let mut fine = coarse.clone();
            let path: Vec<f64> = (0..=700).map(|k| 0.1 * f64::from(k)).collect();
            assert_eq!(coarse.move_to(70.0), play(&mut fine, &path));
        }
    }

    #[test]
    fn a_reset_bed_equals_a_new_one() {
        let drag = Viscosity { volt_seconds: 1e-3 };
        for (bed, viscosity) in BEDS.into_iter().flat_map(|bed| [(bed, None), (bed, Some(&drag))]) {
            let mut new = Hysteresis::new(4, &actuator(bed), viscosity).unwrap();
            new.set_step(1e-3);
            let mut used = new.clone();
            play(&mut used, &[100.0, 3.0, 77.0, 12.0]);
            used.reset();
            assert_eq!(new.move_to(0.0), 0.0);
            assert_eq!(used.move_to(0.0), 0.0);
            for v in [0.0, 40.0, 15.0, 95.0] {
                assert_eq!(used.move_to(v), new.move_to(v));
            }
        }
    }

    #[test]
    fn span_and_opening_are_as_declared_for_many_seeds() {
        for (seed, bed) in (0..40).flat_map(|seed| BEDS.map(|bed| (seed, bed))) {
            let mut h = element(seed, bed);
            assert!(h.linear_um_per_v > 0.0);
            let top = play(&mut h, &[100.0]);
            let bottom = play(&mut h, &[0.0]);
            assert!((top - bottom - 10.0).abs() < 1e-9);
            let rising: Vec<f64> = (0..=100).map(|k| h.move_to(f64::from(k))).collect();
            let falling: Vec<f64> = (0..=100).rev().map(|k| h.move_to(f64::from(k))).collect();
            let opening = opening(&rising, &falling);
            assert!((opening / 10.0 - 0.12).abs() < 0.002, "{bed:?}, seed {seed}: {opening}");
            // Both branches increase with the input.
            assert!(rising.is_sorted() && falling.is_sorted_by(|a, b| a >= b));
        }
    }

    #[test]
    fn loops_of_play_operators_are_symmetric_and_those_of_relays_are_not() {
        let skew = |bed| {
            let mut h = element(6, bed);
            play(&mut h, &[100.0, 0.0]);
            let rising: Vec<f64> = (0..=100).map(|k| h.move_to(f64::from(k))).collect();
            let falling: Vec<f64> = (0..=100).rev().map(|k| h.move_to(f64::from(k))).collect();
            let sums = rising.iter().zip(&falling).map(|(r, f)| r + f - rising[0] - rising[100]);
            sums.fold(0.0, |most: f64, sum| most.max(sum.abs()))
        };
        assert!(skew(Bed::Plays) < 1e-9, "{}", skew(Bed::Plays));
        assert!(skew(Bed::Relays) > 0.02, "{}", skew(Bed::Relays));
    }

    /// Returns opening and highest output of a loop from 0 to 100 V at a rate (V/s).
    ///
    /// The opening is a share of the span at low rates.
    fn loop_at(rate: f64, bed: Bed, viscosity: Option<&Viscosity>) -> (f64, f64) {
        let actuator = Actuator { relays: 2000, ..actuator(bed) };
        let mut h = Hysteresis::new(3, &actuator, viscosity).unwrap();
        let step_s = 1e-6_f64.max(1e-3 / rate);
        h.set_step(step_s);
        let steps = (100.0 / (rate * step_s)) as u32;
        let mut ramp = |from: f64, to: f64| -> Vec<f64> {
            (1..=steps).map(|k| h.move_to(from + (to - from) * f64::from(k) / f64::from(steps))).collect()
        };
        ramp(0.0, 100.0);
        ramp(100.0, 0.0);
        let (rising, falling) = (ramp(0.0, 100.0), ramp(100.0, 0.0));
        (opening(&rising, &falling) / 10.0, rising.iter().chain(&falling).copied().fold(0.0, f64::max))
    }

    #[test]
    fn viscous_loops_widen_with_rate_and_equal_the_rate_independent_ones_at_low_rates() {
        let drag = Viscosity { volt_seconds: 4e-4 };
        for bed in BEDS {
            let quick = loop_at(500.0, bed, None);
            let loops = [50.0, 2000.0, 8000.0, 32_000.0].map(|rate| loop_at(rate, bed, Some(&drag)));
            assert!(
                (loops[0].0 - quick.0).abs() < 0.004 && (loops[0].1 / quick.1 - 1.0).abs() < 0.003,
                "{quick:?} {loops:?}"
            );
            for pair in loops.windows(2) {
                assert!(pair[1].0 > pair[0].0 + 0.003 && pair[1].1 < pair[0].1, "{loops:?}");
            }
        }
    }
}
