//! The stages around the hysteresis, in the order of the chain.

use hyst_core::{
    AsymmetryParams, CreepParams, DelayParams, DriftParams, Env, InterferenceParams, Invert, LagParams, LoadParams,
    RateLaw, RateParams, ResonanceParams, SaturationParams, Stage, TemperatureParams,
};
use pyo3::prelude::*;

use crate::arrays::List;
use crate::errors;
use crate::inversion::{Built, Inverted, Options, closed, compensator, refused};
use crate::model_macro::models;
use hyst_ident::model::capacity::{CREEP, DELAY};

const IN_THE_SENSOR: &str = "this effect is in the sensor and not in the motion, so the drive must not follow it";

/// Inverts in closed form. All references at or beyond a limit have the same input.
fn within_the_limits<P, Q>(
    built: &Built<'_, P, Q, hyst_core::Saturation<f64>>,
    options: &Options,
) -> PyResult<Inverted> {
    let inverse = built.stage.invert().map_err(errors::core)?;
    let [low, high] = [f64::MIN, f64::MAX].map(|y| inverse.step(&mut (), &Env::default(), y));
    Ok(closed(built, options)?.between(low, high, 0.0))
}

models! {
    /// Dead time ``y(t) = u(t − seconds)``, exact for an input that is linear between samples.
    class Delay {
        /// Dead time [s], at most 8190 periods.
        seconds: f64,
        /// Sample period [s].
        period: f64,
    }
    params: |p| Ok(DelayParams { seconds: p.seconds }),
    stage: hyst_core::Delay<f64, DELAY>,
    period: |p| p.period,
    inverse: compensator,
    needs: [],

    /// First-order lag ``τ ẏ + y = u``, exact for an input that is linear between samples.
    class Lag {
        /// Time constant τ [s].
        seconds: f64,
        /// Sample period [s].
        period: f64,
    }
    params: |p| Ok(LagParams { seconds: p.seconds }),
    stage: hyst_core::Lag<f64>,
    period: |p| p.period,
    inverse: compensator,
    needs: [],

    /// Asymmetry: a curve of one-sided dead zones after the hysteresis,
    /// ``y = u + Σ weights[j]·dead(u, thresholds[j])``.
    ///
    /// Closed-form inverse, if the curve is rising.
    class Asymmetry {
        /// Ends of the dead zones [y], in order of increasing distance from zero on each side, shape (n,), n ≤ 8.
        thresholds: List,
        /// Changes of slope [ratio], shape (n,).
        weights: List,
    }
    params: |p| Ok(AsymmetryParams::behind(p.thresholds.to_vec(), p.weights.to_vec())),
    stage: hyst_core::Asymmetry<f64, { hyst_core::MAX_DEAD_ZONES }>,
    inverse: closed,
    needs: [],

    /// Rate-dependent hysteresis: the loop widens by ``o(x) = volts·|x/reference_rate|^exponent·sgn x``. The stage is a
    /// play operator with half-width ``|o(u̇)|``, or with ``relaxes`` the lag ``u − v = o(v̇)``, which has an exact
    /// inverse.
    class Rate {
        /// Overdrive at the reference rate [u].
        volts: f64,
        /// Exponent, 0.05 to 1.
        exponent: f64,
        /// Reference rate [u/s].
        reference_rate: f64,
        /// Sample period [s].
        period: f64,
        /// Whether the output continues to move while the drive is at rest.
        relaxes: bool = false,
    }
    params: |p| Ok(RateParams {
        volts: p.volts,
        exponent: p.exponent,
        reference_rate: p.reference_rate,
        law: if p.relaxes { RateLaw::Relaxes } else { RateLaw::Holds },
    }),
    stage: hyst_core::Rate<f64>,
    period: |p| p.period,
    inverse: compensator,
    needs: [],

    /// Temperature dependence of gain and zero ``y = u·(1 + per_kelvin·ΔT) + expansion·ΔT`` with ``seconds·dΔT/dt + ΔT
    /// = T − reference_degc``.
    class Temperature {
        /// Relative change of gain [1/K].
        per_kelvin: f64,
        /// Temperature at which the gain is 1 [°C].
        reference_degc: f64,
        /// Thermal expansion [y/K].
        expansion: f64 = 0.0,
        /// Thermal time constant [s].
        seconds: f64 = 0.0,
        /// Sample period [s]; needed with a thermal time constant.
        period: f64 = 0.0,
    }
    params: |p| Ok(TemperatureParams {
        per_kelvin: p.per_kelvin,
        reference_degc: p.reference_degc,
        expansion: p.expansion,
        seconds: p.seconds,
        // The stage alone has no hysteresis beside which a gain could act.
        direct: 0.0,
    }),
    stage: hyst_core::Temperature<f64>,
    period: |p| if p.seconds == 0.0 && p.period == 0.0 { 1.0 } else { p.period },
    inverse: compensator,
    needs: [temperature],

    /// Creep ``y = u + Σ shares[i]·xᵢ``, ``τᵢ ẋᵢ = u − xᵢ``, exact for an input that is linear between samples.
    ///
    /// Exact recursive inverse.
    class Creep {
        /// Time constants τ [s], positive, shape (n,), n ≤ 32.
        seconds: List,
        /// Settled shares [ratio], shape (n,).
        shares: List,
        /// Sample period [s].
        period: f64,
    }
    params: |p| Ok(CreepParams { seconds: p.seconds.to_vec(), shares: p.shares.to_vec() }),
    stage: hyst_core::Creep<f64, CREEP>,
    period: |p| p.period,
    inverse: closed,
    needs: [],

    /// Load ``y = u·(1 + gain_per_newton·F) + per_newton·F``. Needs ``load`` [N].
    class Load {
        /// Compliance [y/N].
        per_newton: f64,
        /// Relative change of gain [1/N].
        gain_per_newton: f64 = 0.0,
    }
    params: |p| Ok(LoadParams { per_newton: p.per_newton, gain_per_newton: p.gain_per_newton }),
    stage: hyst_core::Load<f64>,
    inverse: compensator,
    needs: [load],

    /// Structural mode ``y = u + gain·(x − u)``, ``ẍ + 2ζω ẋ + ω² x = ω² u``, exact for an input that is linear between
    /// samples.
    class Resonance {
        /// Undamped natural frequency ω/2π [Hz].
        hz: f64,
        /// Damping ratio ζ, 0 ≤ ζ < 1.
        damping: f64,
        /// Share of the mode in the static output.
        gain: f64 = 1.0,
        /// Sample period [s].
        period: f64,
    }
    params: |p| Ok(ResonanceParams { hz: p.hz, damping: p.damping, gain: p.gain }),
    stage: hyst_core::Resonance<f64>,
    period: |p| p.period,
    inverse: compensator,
    needs: [],

    /// Saturation: the output equals the input between two knees and approaches the limits beyond them.
    ///
    /// Closed-form inverse for references between the limits.
    class Saturation {
        /// Lower limit [y].
        low: f64,
        /// Upper limit [y].
        high: f64,
        /// Width of each knee as a share of the range, 0 (a hard stop) to 0.5.
        knee: f64 = 0.1,
    }
    params: |p| Ok(SaturationParams::behind(p.low, p.high, p.knee)),
    stage: hyst_core::Saturation<f64>,
    inverse: within_the_limits,
    needs: [],

    /// Drift of the sensor ``y = u + per_second·t + settling·(1 − exp(−(t − since_s)/seconds))``, t the lab clock.
    class Drift {
        /// Rate [y/s].
        per_second: f64,
        /// Final value of the settling term [y].
        settling: f64 = 0.0,
        /// Time constant of the settling [s]; 0 without settling.
        seconds: f64 = 0.0,
        /// Start of the settling on the lab clock [s].
        since_s: f64 = 0.0,
    }
    params: |p| Ok(DriftParams { per_second: p.per_second, settling: p.settling, seconds: p.seconds, since_s: p.since_s }),
    stage: hyst_core::Drift<f64>,
    inverse: refused(IN_THE_SENSOR),
    needs: [time],

    /// Tone in the sensor ``y = u + amplitude·sin(2π·hz·t + phase)``, t the lab clock, without harmonics.
    class Interference {
        /// Frequency [Hz].
        hz: f64,
        /// Amplitude [y].
        amplitude: f64,
        /// Phase at t = 0 [rad].
        phase: f64 = 0.0,
    }
    params: |p| Ok(InterferenceParams { hz: p.hz, amplitude: p.amplitude, phase: p.phase, ..Default::default() }),
    stage: hyst_core::Interference<f64>,
    inverse: refused(IN_THE_SENSOR),
    needs: [time],
}
