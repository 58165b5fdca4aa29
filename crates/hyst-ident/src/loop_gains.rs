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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Base, Effects, Ends};
    use crate::record::OutputUnit;
    use hyst_core::{DelayParams, LagParams, PiParams, ResonanceParams};

    const PERIOD: f64 = 1e-3;

    /// A straight actuator of 0.2 µm/V with these effects.
    fn model(effects: Effects) -> Model {
        let base = Base::Pi(PiParams { gain: 0.2, thresholds: vec![1.0], weights: vec![0.0] });
        let ends = Ends {
            input_column: "voltage_v".into(),
            input: (0.0, 100.0),
            output: OutputUnit::Micrometre,
            output_range: None,
            rate_hz: 1.0 / PERIOD,
        };
        Model::from_parameters(base, effects, &ends).unwrap()
    }

    /// Gain of the open loop, and its phase \[rad\], at a frequency, from parts that the gains were not computed with: sample and hold included.
    fn open_loop(effects: &Effects, pid: &PidParams, hz: f64) -> (f64, f64) {
        let w = TAU * hz;
        let controller =
            (pid.integral.hypot(pid.proportional * w) / w, (pid.proportional * w).atan2(pid.integral) - TAU / 4.0);
        let lag = effects.lag.as_ref().map_or(0.0, |l| l.seconds);
        let dead = effects.delay.as_ref().map_or(0.0, |d| d.seconds) + 1.5 * PERIOD;
        let (mut gain, mut phase) =
            (0.2 * controller.0 / (1.0 + (w * lag).powi(2)).sqrt(), controller.1 - (w * lag).atan() - w * dead);
        for mode in &effects.resonances {
            // 1 − s + s ω₀² / (ω₀² − ω² + 2 i ζ ω₀ ω), s being its share.
            let (r, z, s) = (hz / mode.hz, mode.damping, mode.gain);
            let (re, im) = (1.0 - r * r, 2.0 * z * r);
            let norm = re * re + im * im;
            let (re, im) = (1.0 - s + s * re / norm, -s * im / norm);
            gain *= re.hypot(im);
            phase += im.atan2(re);
        }
        (gain, phase)
    }

    fn margins(effects: Effects) -> (LoopGains, f64) {
        let gains = loop_gains(&model(effects.clone()), PERIOD, (0.0, 100.0)).unwrap();
        let (mut at_crossover, mut last) = (f64::NAN, f64::INFINITY);
        for k in 1..40_000 {
            let (gain, phase) = open_loop(&effects, &gains.pid, 0.01 * f64::from(k));
            if gain < 1.0 && last >= 1.0 && at_crossover.is_nan() {
                at_crossover = (phase + TAU / 2.0).to_degrees();
            }
            last = gain;
        }
        (gains, at_crossover)
    }

    #[test]
    fn dead_time_leaves_a_phase_margin_of_sixty_degrees() {
        let lag = Some(LagParams { seconds: 0.004 });
        for seconds in [0.0, 0.002, 0.01] {
            let delay = (seconds > 0.0).then_some(DelayParams { seconds });
            let (gains, margin) = margins(Effects { lag, delay, ..Effects::default() });
            assert!((margin - 60.0).abs() < 0.5, "{margin}° at {gains:?}");
            assert_eq!(gains.mode_hz, None);
        }
    }

    #[test]
    fn a_sharp_mode_leaves_a_gain_margin_of_two() {
        let mode = ResonanceParams { hz: 180.0, damping: 0.01, gain: 0.3 };
        let effects = Effects { resonances: vec![mode], ..Effects::default() };
        let (gains, _) = margins(effects.clone());
        assert_eq!(gains.mode_hz, Some(180.0));
        let (peak, _) = open_loop(&effects, &gains.pid, 180.0);
        assert!((0.4..0.6).contains(&peak), "{peak}");
    }
}
