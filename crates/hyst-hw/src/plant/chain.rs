//! The chain from drive to displacement, on a time grid finer than the samples.

use std::f64::consts::TAU;

use super::asymmetry::Curve;
use super::config::{Disturbance, PlantConfig};
use super::creep::Creep;
use super::hysteresis::Hysteresis;
use super::input::InputPath;
use super::saturation::{Rails, Stops};
use super::structure::Structure;
use super::surroundings::Surroundings;

/// Minimum number of fine steps in a sample period.
const MIN_STEPS: f64 = 8.0;
/// Maximum of fine step times fastest rate of the chain (`ω` of a mode, `1/τ` of a lag or creep element).
const MAX_STEP_RATE: f64 = 0.05;

/// State of the chain.
///
/// Drive → limits of the amplifier → delay → its slew limit → lag → hysteresis → asymmetry → × temperature → + creep →
/// + load → modes → stops.
#[derive(Debug, Clone)]
pub(crate) struct Chain {
    /// Number of fine steps in a sample period.
    steps: u32,
    rails: Option<Rails>,
    input: InputPath,
    hysteresis: Hysteresis,
    asymmetry: Option<Curve>,
    creep: Option<Creep>,
    structure: Structure,
    stops: Option<Stops>,
    /// Displacement before creep, and with creep and load, at the end of the last fine step.
    before_creep: f64,
    loaded: f64,
}

impl Chain {
    /// Returns the chain in the virgin state, for samples at `rate_hz`.
    ///
    /// [`rest_at`](Self::rest_at) sets the load at rest.
    pub(crate) fn new(config: &PlantConfig, hysteresis: Hysteresis, rate_hz: f64) -> Self {
        Self::with_steps(config, hysteresis, rate_hz, fine_steps(config, rate_hz))
    }

    fn with_steps(config: &PlantConfig, hysteresis: Hysteresis, rate_hz: f64, steps: u32) -> Self {
        let step_s = 1.0 / (rate_hz * f64::from(steps));
        let mut hysteresis = hysteresis;
        hysteresis.set_step(step_s);
        Self {
            steps,
            rails: config.saturation.as_ref().map(Rails::new),
            input: InputPath::new(
                config.actuator.rest_v,
                config.delay.as_ref().map_or(0.0, |delay| delay.seconds * rate_hz),
                slew_limit(config).map(|v_per_s| v_per_s * step_s),
                config.lag.as_ref().map(|lag| step_s / lag.seconds),
            ),
            hysteresis,
            asymmetry: config.asymmetry.as_ref().map(|asymmetry| Curve::new(asymmetry, &config.actuator)),
            creep: config.creep.as_ref().map(|creep| Creep::new(creep, step_s)),
            structure: Structure::new(&config.modes, step_s),
            stops: config.saturation.as_ref().map(Stops::new),
            before_creep: 0.0,
            loaded: 0.0,
        }
    }

    /// Computes one sample period, from lab time `from_s` to `to_s`; returns the displacement at its end (µm).
    ///
    /// The drive changes linearly to `drive_v`.
    pub(crate) fn advance(&mut self, drive_v: f64, around: &Surroundings, from_s: f64, to_s: f64) -> f64 {
        // The temperature changes slowly, so it is interpolated linearly within a sample period.
        let (factor_begin, factor_end) = (around.factor(from_s), around.factor(to_s));
        self.input.push(self.rails.as_ref().map_or(drive_v, |rails| rails.at(drive_v)));
        let mut from = 0.0;
        let mut position = 0.0;
        for j in 1..=self.steps {
            let to = f64::from(j) / f64::from(self.steps);
            let volts = self.input.advance(from, to);
            let now_s = from_s + to * (to_s - from_s);
            let scale = (factor_begin + to * (factor_end - factor_begin)) * around.gain(now_s);
            let straight = self.hysteresis.move_to(volts);
            let before_creep = self.asymmetry.as_ref().map_or(straight, |curve| curve.at(straight)) * scale;
            let crept = self.creep.as_mut().map_or(0.0, |creep| creep.advance(self.before_creep, before_creep));
            let loaded = before_creep + crept + around.deflection(now_s);
            position = self.structure.advance(self.loaded, loaded);
            (self.before_creep, self.loaded) = (before_creep, loaded);
            from = to;
        }
        self.stops.as_ref().map_or(position, |stops| stops.at(position))
    }

    /// Returns to the virgin state, in equilibrium with the load at lab time `t`.
    ///
    /// The displacement is counted from the virgin rest without load.
    pub(crate) fn rest_at(&mut self, around: &Surroundings, t: f64) {
        self.input.reset();
        self.hysteresis.reset();
        if let Some(creep) = &mut self.creep {
            creep.reset();
        }
        self.before_creep = 0.0;
        self.loaded = around.deflection(t);
        self.structure.rest_at(self.loaded);
    }
}

/// Returns the smallest slew limit of the amplifier (V/s), if any.
fn slew_limit(config: &PlantConfig) -> Option<f64> {
    let limits = config.disturbances.iter().filter_map(|d| match d {
        Disturbance::SlewLimit { v_per_s } => Some(*v_per_s),
        _ => None,
    });
    limits.min_by(f64::total_cmp)
}

/// Returns the number of fine steps in a sample period that resolves the fastest motion.
fn fine_steps(config: &PlantConfig, rate_hz: f64) -> u32 {
    let lag = config.lag.iter().map(|lag| 1.0 / lag.seconds);
    let creep = config.creep.iter().map(|creep| 1.0 / creep.tau_min_s);
    let modes = config.modes.iter().map(|mode| TAU * mode.hz);
    let fastest = lag.chain(creep).chain(modes).fold(0.0, f64::max);
    // For valid descriptions this is below 3e6 at 1 Hz.
    (fastest / (rate_hz * MAX_STEP_RATE)).ceil().max(MIN_STEPS) as u32
}

#[cfg(test)]
mod tests {
    use super::super::config::tests::clean;
    use super::super::config::{Lag, Mode};
    use super::*;

    #[test]
    fn the_fine_grid_resolves_the_fastest_motion() {
        let mut config = clean();
        assert_eq!(fine_steps(&config, 1000.0), 8);
        config.modes = vec![Mode { hz: 350.0, damping: 0.01, gain: 0.1 }];
        assert_eq!(fine_steps(&config, 1000.0), 44);
        assert_eq!(fine_steps(&config, 500.0), 88);
        config.lag = Some(Lag { seconds: 1e-4 });
        assert_eq!(fine_steps(&config, 1000.0), 200);
    }

    #[test]
    fn a_chain_without_effects_equals_the_hysteresis() {
        let mut config = clean();
        config.actuator.loop_share = 0.12;
        let mut alone = Hysteresis::new(config.seed, &config.actuator, None).unwrap();
        let mut chain = Chain::new(&config, alone.clone(), 1000.0);
        for v in [0.0, 30.0, 90.0, 20.0, 60.0, 0.0, 100.0] {
            assert_eq!(chain.advance(v, &Surroundings::default(), 0.0, 0.001), alone.move_to(v));
        }
    }

    #[test]
    fn a_finer_grid_gives_the_same_motion() {
        for seed in 0..4 {
            let config = PlantConfig::random_with(seed, &["delay", "lag", "creep", "resonance"]).unwrap();
            let hysteresis = Hysteresis::new(config.seed, &config.actuator, None).unwrap();
            let steps = fine_steps(&config, 1000.0);
            let mut chain = Chain::new(&config, hysteresis.clone(), 1000.0);
            let mut finer = Chain::with_steps(&config, hysteresis, 1000.0, 5 * steps);
            let span = config.actuator.gain_um_per_v * config.actuator.max_v;
            for k in 0..600 {
                let v = config.actuator.max_v * (0.5 - 0.5 * (0.05 * f64::from(k)).cos());
                let difference = chain.advance(v, &Surroundings::default(), 0.0, 0.0)
                    - finer.advance(v, &Surroundings::default(), 0.0, 0.0);
                // A tenth of the noise of such a plant.
                assert!(difference.abs() < 3e-5 * span, "{seed} {k}: {difference}");
            }
        }
    }

    #[test]
    fn the_ring_down_in_samples_has_the_declared_frequency_and_damping() {
        let mut config = clean();
        config.modes = vec![Mode { hz: 100.0, damping: 0.02, gain: 1.0 }];
        let hysteresis = Hysteresis::new(1, &config.actuator, None).unwrap();
        let mut chain = Chain::new(&config, hysteresis, 1000.0);
        let y: Vec<f64> = (0..200).map(|_| chain.advance(50.0, &Surroundings::default(), 0.0, 0.0) - 5.0).collect();
        // Free motion satisfies y[n+2] = a y[n+1] - b y[n] exactly; a and b follow by least squares.
        let (mut s11, mut s12, mut s22, mut r1, mut r2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for w in y[1..].windows(3) {
            s11 += w[1] * w[1];
            s12 += w[1] * w[0];
            s22 += w[0] * w[0];
            r1 += w[2] * w[1];
            r2 += w[2] * w[0];
        }
        let det = s11 * s22 - s12 * s12;
        let (a, b) = ((r1 * s22 - r2 * s12) / det, -(r2 * s11 - r1 * s12) / det);
        // Poles e^(-(ζω ± iω√(1-ζ²)) h).
        let decay = -0.5 * b.ln() / 0.001;
        let damped = (a / (2.0 * b.sqrt())).acos() / 0.001;
        let natural = decay.hypot(damped);
        assert!((natural / TAU / 100.0 - 1.0).abs() < 1e-4, "{}", natural / TAU);
        assert!((decay / natural / 0.02 - 1.0).abs() < 1e-3, "{}", decay / natural);
    }
}
