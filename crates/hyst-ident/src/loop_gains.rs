//! PID gains from a model, and the bandwidth of the loop.

use std::f64::consts::{FRAC_PI_6, TAU};

use hyst_core::PidParams;

use crate::model::Model;

/// PID gains, and the limit of the loop's speed.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopGains {
    /// The gains, with the limits of the drive.
    pub pid: PidParams,
    /// Crossover frequency of the open loop \[Hz\]: about the bandwidth.
    pub crossover_hz: f64,
    /// Frequency of the mode that limits the loop \[Hz\]; `None` if the dead time limits it.
    pub mode_hz: Option<f64>,
}

/// Dead time of the loop in sample periods: one to compute, half of one to hold the drive.
const DEAD_TIME_PERIODS: f64 = 1.5;

/// Computes the gains of `C(s) = kᵢ (1 + T s) / s` for an actuator with mean gain g and lag T.
/// A dead time and modes limit kᵢ.
///
/// The zero cancels the lag, so the open loop is an integrator `ω/s` with `ω = kᵢ g`. A phase margin of 60° allows `ω =
/// π / (6 τ)`, with τ the dead time plus one and a half sample periods. A gain margin of two at a mode with frequency f
/// and damping ratio ζ that carries the share s of the output allows `ω = 2π f ζ / s` (its peak is `s/(2ζ)`). The
/// smaller ω is used. Local slopes of a hysteresis loop differ from its mean gain by at most a third, which is within
/// both margins. `period` is the sample period \[s\]; the last argument is the range of the drive.
///
/// # Errors
/// If the model cannot be built.
pub fn loop_gains(model: &Model, period: f64, (low, high): (f64, f64)) -> Result<LoopGains, hyst_core::Error> {
    let (gain, _) = model.straight_line()?;
    let lag = model.effects.lag.as_ref().map_or(0.0, |l| l.seconds);
    let dead = model.effects.delay.as_ref().map_or(0.0, |d| d.seconds) + DEAD_TIME_PERIODS * period;
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

    /// A linear actuator with 0.2 µm/V and these effects.
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

    /// Returns gain and phase \[rad\] of the open loop at a frequency, computed independently, sampling and hold
    /// included.
    fn open_loop(effects: &Effects, pid: &PidParams, hz: f64) -> (f64, f64) {
        let w = TAU * hz;
        let controller =
            (pid.integral.hypot(pid.proportional * w) / w, (pid.proportional * w).atan2(pid.integral) - TAU / 4.0);
        let lag = effects.lag.as_ref().map_or(0.0, |l| l.seconds);
        let dead = effects.delay.as_ref().map_or(0.0, |d| d.seconds) + 1.5 * PERIOD;
        let (mut gain, mut phase) =
            (0.2 * controller.0 / (1.0 + (w * lag).powi(2)).sqrt(), controller.1 - (w * lag).atan() - w * dead);
        for mode in &effects.resonances {
            // 1 − s + s ω₀² / (ω₀² − ω² + 2 i ζ ω₀ ω), with s its share.
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
    fn the_phase_margin_is_sixty_degrees_with_dead_time() {
        let lag = Some(LagParams { seconds: 0.004 });
        for seconds in [0.0, 0.002, 0.01] {
            let delay = (seconds > 0.0).then_some(DelayParams { seconds });
            let (gains, margin) = margins(Effects { lag, delay, ..Effects::default() });
            assert!((margin - 60.0).abs() < 0.5, "{margin}° at {gains:?}");
            assert_eq!(gains.mode_hz, None);
        }
    }

    #[test]
    fn the_gain_margin_is_two_with_a_lightly_damped_mode() {
        let mode = ResonanceParams { hz: 180.0, damping: 0.01, gain: 0.3 };
        let effects = Effects { resonances: vec![mode], ..Effects::default() };
        let (gains, _) = margins(effects.clone());
        assert_eq!(gains.mode_hz, Some(180.0));
        let (peak, _) = open_loop(&effects, &gains.pid, 180.0);
        assert!((0.4..0.6).contains(&peak), "{peak}");
    }
}
