//! Gains of a PID from a model: how fast a loop around the actuator may be.

use std::f64::consts::{FRAC_PI_6, TAU};

use hyst_core::PidParams;

use crate::model::Model;

/// A loop, and why it is no faster.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopGains {
    /// The gains, with the limits of the drive.
    pub pid: PidParams,
    /// Where the loop's gain falls below one \[Hz\]: about its bandwidth.
    pub crossover_hz: f64,
    /// Frequency of the mode that keeps it slow \[Hz\]; `None` where dead time does.
    pub mode_hz: Option<f64>,
}

/// Sample periods from a measurement to the middle of what it leads to: one to compute, half of the one that the drive is held.
const PERIODS: f64 = 1.5;

/// Gains of `C(s) = kᵢ (1 + T s) / s` around an actuator of a mean gain g, lag T, dead time and modes, at a sample period \[s\].
///
/// The zero takes the lag out; what is left is an integrator `ω/s` with `ω = kᵢ g`. A phase margin of 60° allows `ω = π / (6 τ)`, τ being dead time
/// and one and a half sample periods; a gain margin of two at a mode of f and ζ that carries the share s of the output allows `ω = 2π f ζ / s` (its peak
/// is `s/(2ζ)`). The lower one is taken. Local slopes of a hysteresis loop are within a third of its mean gain, which is within both margins.
///
/// # Errors
/// If the model cannot be run.
pub fn loop_gains(model: &Model, period: f64, (low, high): (f64, f64)) -> Result<LoopGains, hyst_core::Error> {
    let (gain, _) = model.straight_line()?;
    let lag = model.effects.lag.as_ref().map_or(0.0, |l| l.seconds);
    let dead = model.effects.delay.as_ref().map_or(0.0, |d| d.seconds) + PERIODS * period;
    let mode = model
        .effects
        .resonances
        .iter()
        .map(|mode| (TAU * mode.hz * mode.damping / mode.gain.abs().max(f64::MIN_POSITIVE), mode.hz))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let by_time = FRAC_PI_6 / dead;
    let (omega, mode_hz) = match mode {
        Some((most, hz)) if most < by_time => (most, Some(hz)),
        _ => (by_time, None),
    };
    let integral = omega / gain;
    let pid = PidParams {
        proportional: integral * lag,
        integral,
        derivative: 0.0,
        derivative_hz: 0.1 / period,
        proportional_weight: 1.0,
        derivative_weight: 0.0,
        anti_windup_seconds: 1.0 / omega,
        low,
        high,
    };
    Ok(LoopGains { pid, crossover_hz: omega / TAU, mode_hz })
}
