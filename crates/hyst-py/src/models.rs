//! The table of models.
//!
//! An entry names the class, its keywords with unit and range, how the core builds the stage from them, how it is
//! inverted (`closed`, `search`, `compensator`, `refused` of `inverse.rs`, or a closure) and which of `temperature`,
//! `load` and `time` it cannot do without. Units: `u` is the input's, `y` the output's.

use hyst_core::{
    Build, CreepParams, DelayParams, DriftParams, Error, Everett, InterferenceParams, LagParams, PiParams,
    PreisachParams, ResonanceParams, Sampling, TemperatureParams,
};
use hyst_ident::model::capacity::{CREEP, DELAY, NODES, PLAYS};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::Needs;
use crate::inverse::{closed, compensator, refused};
use crate::model_macro::{Parameter, arguments, models, repr};
use crate::operator::Operator;

const IN_THE_SENSOR: &str = "this effect is in the sensor, not in the motion; no drive should follow it";

/// Preisach parameters from lists of the caller's.
pub(crate) fn triangle(
    low: f64,
    high: f64,
    density: &[f64],
    once: Option<&[f64]>,
    rest: Option<f64>,
) -> Result<PreisachParams<Vec<f64>>, Error> {
    let cells = (0..NODES).find(|n| n * (n + 1) / 2 >= density.len()).unwrap_or(NODES);
    if density.len() != cells * (cells + 1) / 2 {
        return Err(Error::OutOfRange { name: "preisach.density", must: "n (n + 1) / 2 values, n at most 64" });
    }
    let once = once.map_or_else(|| vec![0.0; cells], <[f64]>::to_vec);
    if once.len() != cells {
        return Err(Error::Lengths("preisach.once and the cells along one edge of preisach.density"));
    }
    Ok(PreisachParams { low, high, cells, rest: rest.unwrap_or(low), density: density.to_vec(), once })
}

models! {
    /// Play (backlash) of half-width ``radius``: ``p ← max(u − r, min(u + r, p))``, from 0.
    class Play {
        /// Half-width r [u], positive.
        radius: f64,
    }
    stage: hyst_core::Pi<f64, 1>,
    build: |p| hyst_core::Pi::new(0.0, &[p.radius], &[1.0]),
    inverse: refused("a play does not move while the input crosses its width"),
    needs: [],

    /// Stop (elasto-slip element) with yield ``limit``: ``s ← clamp(s + Δu, −r, r)``, from 0. Play and stop of one
    /// half-width add up to the input.
    class Stop {
        /// Yield r [u], positive.
        limit: f64,
    }
    stage: hyst_core::Pi<f64, 1>,
    build: |p| hyst_core::Pi::new(1.0, &[p.limit], &[-1.0]),
    inverse: refused("a stop does not move while it slips"),
    needs: [],

    /// Prandtl-Ishlinskii operator ``y = gain·u + Σ weights[i]·play(u, thresholds[i])``.
    ///
    /// Closed-form inverse, if gain and initial slopes are positive.
    class Pi {
        /// Gain of the identity [y/u].
        gain: f64,
        /// Half-widths of the plays [u], positive and strictly rising, shape (n,), n ≤ 64.
        thresholds: Vec<f64>,
        /// Weights of the plays [y/u], shape (n,).
        weights: Vec<f64>,
    }
    stage: hyst_core::Pi<f64, PLAYS>,
    build: |p| PiParams { gain: p.gain, thresholds: &p.thresholds, weights: &p.weights }.build(&()),
    inverse: closed,
    needs: [],

    /// Classical Preisach operator: relays of constant density in the cells of a triangle.
    ///
    /// Cell (a, b), b ≤ a, holds the relays that switch up in grid interval a and down in interval b. On the diagonal the
    /// relays have no width: the reversible part. The output is zero at rest. Closed-form inverse, if every cell on the
    /// diagonal has a density.
    class Preisach {
        /// Lowest input of the grid [u].
        low: f64,
        /// Highest input of the grid [u].
        high: f64,
        /// Output gained by each cell when all its relays switch up [y], shape (cells·(cells + 1)/2,), cells ≤ 64, in the
        /// order of ``numpy.tril_indices(cells)``: (0, 0), (1, 0), (1, 1), (2, 0), …
        density: Vec<f64>,
        /// Output gained once per grid interval by relays that switch up there and never down [y], shape (cells,); zeros
        /// if not given.
        once: Option<Vec<f64>> = None,
        /// Input at which the virgin memory rests [u]; the lowest if not given.
        rest: Option<f64> = None,
    }
    stage: Everett<f64, NODES>,
    build: |p| triangle(p.low, p.high, &p.density, p.once.as_deref(), p.rest)?.build(&()),
    inverse: closed,
    needs: [],

    /// Dead time ``y(t) = u(t − seconds)``; between samples the input is linear.
    class Delay {
        /// Dead time [s], at most 8190 periods.
        seconds: f64,
        /// Sample period [s].
        period: f64,
    }
    stage: hyst_core::Delay<f64, DELAY>,
    build: |p| DelayParams { seconds: p.seconds }.build(&Sampling { period: p.period }),
    inverse: |p, _, options| compensator(p.period, options, |chain, cx| {
        chain.with_delay(&DelayParams { seconds: p.seconds }, cx)
    }),
    needs: [],

    /// First-order lag ``τ ẏ + y = u``, exact for an input that is linear between samples.
    class Lag {
        /// Time constant τ [s].
        seconds: f64,
        /// Sample period [s].
        period: f64,
    }
    stage: hyst_core::Lag<f64>,
    build: |p| LagParams { seconds: p.seconds }.build(&Sampling { period: p.period }),
    inverse: |p, _, options| compensator(p.period, options, |chain, cx| {
        chain.with_lag(&LagParams { seconds: p.seconds }, cx)
    }),
    needs: [],

    /// Creep ``y = u + Σ shares[i]·xᵢ``, ``τᵢ ẋᵢ = u − xᵢ``, exact for an input that is linear between samples.
    ///
    /// Exact recursive inverse.
    class Creep {
        /// Time constants τ [s], positive, shape (n,), n ≤ 32.
        seconds: Vec<f64>,
        /// Settled shares [ratio], shape (n,).
        shares: Vec<f64>,
        /// Sample period [s].
        period: f64,
    }
    stage: hyst_core::Creep<f64, CREEP>,
    build: |p| CreepParams { seconds: &p.seconds, shares: &p.shares }.build(&Sampling { period: p.period }),
    inverse: closed,
    needs: [],

    /// Structural mode ``y = u + gain·(x − u)``, ``ẍ + 2ζω ẋ + ω² x = ω² u``, exact for an input that is linear between
    /// samples.
    class Resonance {
        /// Undamped natural frequency ω/2π [Hz].
        hz: f64,
        /// Damping ratio ζ, 0 ≤ ζ < 1.
        damping: f64,
        /// Share of the static output that the mode carries.
        gain: f64 = 1.0,
        /// Sample period [s].
        period: f64,
    }
    stage: hyst_core::Resonance<f64>,
    build: |p| ResonanceParams { hz: p.hz, damping: p.damping, gain: p.gain }.build(&Sampling { period: p.period }),
    inverse: |p, _, options| compensator(p.period, options, |chain, cx| {
        chain.with_resonance(&ResonanceParams { hz: p.hz, damping: p.damping, gain: p.gain }, cx)
    }),
    needs: [],

    /// Gain over temperature ``y = u·(1 + per_kelvin·(T − reference_degc))``.
    class Temperature {
        /// Relative change of gain [1/K].
        per_kelvin: f64,
        /// Temperature at which the gain is 1 [°C].
        reference_degc: f64,
    }
    stage: hyst_core::Temperature<f64>,
    build: |p| TemperatureParams { per_kelvin: p.per_kelvin, reference_degc: p.reference_degc }.build(&()),
    inverse: |p, _, options| compensator(1.0, options, |chain, _| {
        chain.with_temperature(&TemperatureParams { per_kelvin: p.per_kelvin, reference_degc: p.reference_degc })
    }),
    needs: [temperature],

    /// Drift of the sensor ``y = u + per_second·t`` on the lab's clock.
    class Drift {
        /// Rate [y/s].
        per_second: f64,
    }
    stage: hyst_core::Drift<f64>,
    build: |p| DriftParams { per_second: p.per_second }.build(&()),
    inverse: refused(IN_THE_SENSOR),
    needs: [time],

    /// Tone in the sensor ``y = u + amplitude·sin(2π·hz·t + phase)`` on the lab's clock.
    class Interference {
        /// Frequency [Hz].
        hz: f64,
        /// Amplitude [y].
        amplitude: f64,
        /// Phase at t = 0 [rad].
        phase: f64 = 0.0,
    }
    stage: hyst_core::Interference<f64>,
    build: |p| InterferenceParams { hz: p.hz, amplitude: p.amplitude, phase: p.phase }.build(&()),
    inverse: refused(IN_THE_SENSOR),
    needs: [time],
}
