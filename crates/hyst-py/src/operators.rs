//! The table of the papers' hysteresis models; `models.rs` has the stages of a chain and says how a table is read.

use std::sync::Arc;

use hyst_core::{
    Activation, ActivationKind, ActivationParams, AsymmetryParams, BoucWenClassicParams, BoucWenOscillatorParams,
    BoucWenParams, Build, Curve, DpmParams, Error, Exponentials, GlOrder, GpiParams, IfmParams, Invert, LfdmParams,
    LoadParams, MaxwellSlipParams, MirrorParams, PiParams, Sampling, SaturationParams, ShortMemory, SlipReading,
    TdEmParams, TdPiParams, ViscousPiParams,
};
use hyst_ident::model::capacity::{DELAY, MIRROR, NODES, PLAYS, REFERENCES, TAPS};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::Needs;
use crate::errors;
use crate::inverse::{Inverted, Options, closed, compensator, refused, search};
use crate::model_macro::{Parameter, arguments, models, repr};
use crate::models::triangle;
use crate::operator::Operator;
use crate::runner::Runner;
use hyst_core::Either;

/// All of a fractional model's memory, to 3e-7.
type FullMemory = Exponentials<f64, 40>;
/// Samples that a short memory holds.
const MEMORY: usize = 4096;
type Short = ShortMemory<f64, MEMORY>;

/// A length of memory that this build holds.
fn cut(samples: usize) -> Result<usize, Error> {
    match samples {
        1..=MEMORY => Ok(samples),
        _ => Err(Error::OutOfRange { name: "memory", must: "from 1 to 4096 samples, or None for all of it" }),
    }
}

/// An envelope from its two or four numbers.
fn curve(name: &'static str, numbers: &[f64]) -> Result<Curve, Error> {
    match numbers {
        [slope, offset] => Ok(Curve::Linear { slope: *slope, offset: *offset }),
        [height, rate, shift, offset] => {
            Ok(Curve::Tanh { height: *height, rate: *rate, shift: *shift, offset: *offset })
        }
        _ => Err(Error::OutOfRange { name, must: "[slope, offset] or [height, rate, shift, offset]" }),
    }
}

fn order_of(order: usize) -> Result<GlOrder, Error> {
    match order {
        1 => Ok(GlOrder::First),
        2 => Ok(GlOrder::Second),
        _ => Err(Error::OutOfRange { name: "order", must: "1 or 2" }),
    }
}

fn reading(elasto_slip: bool) -> SlipReading {
    if elasto_slip { SlipReading::ElastoSlip } else { SlipReading::Backlash }
}

/// The dynamic Preisach model with a mirror of at most [`MIRROR`]² nodes.
type HostDpm = hyst_core::Dpm<f64, NODES, MIRROR, MIRROR>;

/// By search over the given range, to the given tolerance or a part in 10⁹ of the range.
fn bouc_wen<P>(_: &P, stage: &hyst_core::BoucWen<f64>, options: &Options) -> PyResult<Inverted> {
    let (low, high, tolerance) = options.range()?;
    Ok(Inverted::exact(stage.inverse(low, high, tolerance).map_err(errors::core)?))
}

/// A sample at a time where that is stable, else backwards in time.
fn activation<P>(_: &P, stage: &Activation<f64>, options: &Options) -> PyResult<Inverted> {
    options.only(&["tolerance"])?;
    if stage.invert().is_ok() {
        return closed(&(), stage, &Options::default());
    }
    let inverse = stage.anti_causal::<REFERENCES>(options.tolerance.unwrap_or(1e-9)).map_err(errors::core)?;
    let lead = inverse.lead();
    Ok(Inverted::previewed(inverse, lead))
}

models! {
    /// Prandtl-Ishlinskii operator whose plays slide with viscous drag (rate-dependence):
    /// ``y = gain·u + Σ weights[i]·pᵢ``, ``seconds·ṗᵢ = dead(u − pᵢ, thresholds[i])``.
    ///
    /// ``seconds = 0`` is ``Pi``. Exact inverse.
    class ViscousPi {
        /// Gain of the identity [y/u].
        gain: f64,
        /// Half-widths of the plays [u], positive and strictly rising, shape (n,), n ≤ 64.
        thresholds: Vec<f64>,
        /// Weights of the plays [y/u], shape (n,).
        weights: Vec<f64>,
        /// Drag [s].
        seconds: f64,
        /// Sample period [s].
        period: f64,
    }
    stage: hyst_core::ViscousPi<f64, PLAYS>,
    build: |p| {
        let pi = PiParams { gain: p.gain, thresholds: &p.thresholds, weights: &p.weights };
        ViscousPiParams { pi, seconds: p.seconds }.build(&Sampling { period: p.period })
    },
    inverse: closed,
    needs: [],

    /// Generalised Prandtl-Ishlinskii operator: plays between two envelope functions,
    /// ``y = gain·F₀ + Σ weights[i]·Fᵢ``, ``Fᵢ ← max(left(u) − rᵢ, min(right(u) + rᵢ, Fᵢ))``.
    ///
    /// An envelope is ``[slope, offset]`` for ``slope·u + offset`` or ``[height, rate, shift, offset]`` for
    /// ``height·tanh(rate·u + shift) + offset``. Exact inverse; its drive jumps where the reference turns.
    class Gpi {
        /// Weight of the play of radius 0 [y per unit of the envelope].
        gain: f64,
        /// Radii [unit of the envelope], positive and strictly rising, shape (n,), n ≤ 64.
        thresholds: Vec<f64>,
        /// Weights [y per unit of the envelope], shape (n,).
        weights: Vec<f64>,
        /// Envelope of the rising side, shape (2,) or (4,).
        left: Vec<f64>,
        /// Envelope of the falling side, shape (2,) or (4,).
        right: Vec<f64>,
    }
    stage: hyst_core::Gpi<f64, PLAYS>,
    build: |p| GpiParams {
        left: curve("gpi.left", &p.left)?,
        right: curve("gpi.right", &p.right)?,
        gain: p.gain,
        thresholds: &p.thresholds,
        weights: &p.weights,
    }.build(&()),
    inverse: closed,
    needs: [],

    /// Temperature-dependent Prandtl-Ishlinskii model: thresholds ``alpha·i`` and weights
    /// ``epsilon·exp(eta·(T − t0))·exp(−tau·alpha·i)``, i = 0 … n, plays between the envelopes ``a0·u + a1`` (rising) and
    /// ``b0·u + b1`` (falling). Needs ``temperature`` [°C].
    ///
    /// Exact inverse, also while the temperature changes; its drive jumps where the reference turns.
    class TdPi {
        /// Spacing of the thresholds [unit of the envelope].
        alpha: f64,
        /// Weight at r = 0 and t0 [y per unit of the envelope].
        epsilon: f64,
        /// Decay of the weights with the threshold.
        tau: f64,
        /// Relative change of the weights with temperature [1/K].
        eta: f64,
        /// Slope of the rising side's envelope.
        a0: f64,
        /// Offset of the rising side's envelope.
        a1: f64,
        /// Slope of the falling side's envelope.
        b0: f64,
        /// Offset of the falling side's envelope.
        b1: f64,
        /// Number of thresholds besides 0, at most 64.
        n: u16 = 9,
        /// Reference temperature [°C].
        t0: f64 = 23.0,
    }
    stage: hyst_core::TdPi<f64, PLAYS>,
    build: |p| TdPiParams {
        alpha: p.alpha,
        epsilon: p.epsilon,
        tau: p.tau,
        eta: p.eta,
        a0: p.a0,
        a1: p.a1,
        b0: p.b0,
        b1: p.b1,
        plays: p.n,
        reference_degc: p.t0,
    }.build(&()),
    inverse: closed,
    needs: [temperature],

    /// Bank of Maxwell-slip elements, ``y = Σ gains[i]·element(u, widths[i])``.
    ///
    /// An element is a backlash of that total width; exact inverse, whose drive jumps where the reference turns.
    /// With ``elasto_slip`` it is a spring that slips at that deflection: such a bank saturates and has no inverse.
    class MaxwellSlip {
        /// Widths [u], positive and strictly rising, shape (n,), n ≤ 64.
        widths: Vec<f64>,
        /// Gains [y/u], shape (n,).
        gains: Vec<f64>,
        /// Whether an element is a spring that slips at that deflection; a backlash of that total width if not.
        elasto_slip: bool = false,
    }
    stage: hyst_core::MaxwellSlip<f64, PLAYS>,
    build: |p| MaxwellSlipParams { reading: reading(p.elasto_slip), widths: &p.widths, gains: &p.gains }.build(&()),
    inverse: closed,
    needs: [],

    /// Temperature-dependent electromechanical model: a Maxwell-slip bank gives the current that charges C ∥ R; the voltage
    /// drives a mass on a spring through the coupling ``ψ(T)``. Needs ``temperature`` [°C].
    ///
    /// The linear part is exact for a current that is linear between samples. Inverse: band-limited with preview, then exact.
    class TdEm {
        /// Widths of the slip elements [u], shape (n,), n ≤ 64.
        widths: Vec<f64>,
        /// Gains of the slip elements [A/u], shape (n,).
        gains: Vec<f64>,
        /// Capacitance [F].
        capacitance: f64,
        /// Resistance [Ω].
        resistance: f64,
        /// Mass [kg].
        mass: f64,
        /// Stiffness [N/m].
        stiffness: f64,
        /// Damping [N s/m].
        damping: f64,
        /// Coefficients of ``ψ(T) = psi[0] + psi[1]·T + psi[2]·T²`` [N/V, T in °C], shape (3,).
        psi: Vec<f64>,
        /// Sample period [s].
        period: f64,
        /// Whether an element is a spring that slips; a backlash, as the paper's numbers ask for, if not.
        elasto_slip: bool = false,
        /// Output units in a metre: 1e6 for µm.
        per_metre: f64 = 1.0,
        /// Temperature for which the inverse's filter is made [°C]; its gain follows the given one.
        filter_degc: f64 = 23.0,
    }
    stage: hyst_core::TdEm<f64, PLAYS>,
    build: |p| {
        let coupling = <[f64; 3]>::try_from(p.psi.as_slice())
            .map_err(|_| Error::OutOfRange { name: "td-em.psi", must: "three coefficients" })?;
        TdEmParams {
            slip: MaxwellSlipParams { reading: reading(p.elasto_slip), widths: &p.widths, gains: &p.gains },
            capacitance: p.capacitance,
            resistance: p.resistance,
            mass: p.mass,
            stiffness: p.stiffness,
            damping: p.damping,
            coupling,
            per_metre: p.per_metre,
        }.build(&Sampling { period: p.period })
    },
    inverse: |p, stage, options| {
        options.only(&["bandwidth_hz"])?;
        let inverse = stage.band_limited::<TAPS>(p.filter_degc, options.bandwidth_hz).map_err(errors::core)?;
        let (lead, bandwidth_hz, band_error) = (inverse.lead(), Some(inverse.bandwidth_hz()), inverse.error());
        Ok(Inverted { engine: Arc::new(Runner::new(inverse)), lead, bandwidth_hz, band_error })
    },
    needs: [temperature],

    /// Linear fractional-order differential model ``(1 + c·s^beta) X = (a + b·s^alpha) U``, all of its memory (to 3e-7) or a short
    /// one.
    ///
    /// Closed-form inverse.
    class Lfdm {
        /// Gain at rest [y/u].
        a: f64,
        /// Weight of the input's derivative.
        b: f64,
        /// Weight of the output's derivative.
        c: f64,
        /// Order of the input's derivative, 0 to 1.
        alpha: f64,
        /// Order of the output's derivative, 0 to 1.
        beta: f64,
        /// Sample period [s].
        period: f64,
        /// Order of accuracy of the sampled derivatives: 1 (the paper's) or 2.
        order: usize = 1,
        /// Samples of memory, at most 4096: the paper's short memory. All of it, as 40 exponentials, if not given.
        memory: Option<usize> = None,
    }
    stage: Either<hyst_core::Lfdm<f64, FullMemory>, hyst_core::Lfdm<f64, Short>>,
    build: |p| {
        let params = LfdmParams { a: p.a, b: p.b, c: p.c, alpha: p.alpha, beta: p.beta, order: order_of(p.order)? };
        let cx = Sampling { period: p.period };
        Ok(match p.memory {
            None => Either::First(params.build(&cx)?),
            Some(samples) => Either::Second(Build::<hyst_core::Lfdm<f64, Short>>::build(&params, &cx)?.cut(cut(samples)?)),
        })
    },
    inverse: closed,
    needs: [],

    /// Improved fractional-order model ``X = delta·U + (a + b·s^alpha)/(1 + c·s^beta)·(e^(−tau·s) − 1)·U``, all of its memory
    /// (to 3e-7) or a short one.
    ///
    /// The inverse solves the recursion; it exists where the sampled model has no zero outside the unit circle.
    class Ifm {
        /// Gain of the hysteresis at rest [y/u].
        a: f64,
        /// Weight of the input's derivative.
        b: f64,
        /// Weight of the hysteresis' derivative.
        c: f64,
        /// Order of the input's derivative, 0 to 1.
        alpha: f64,
        /// Order of the hysteresis' derivative, 0 to 1.
        beta: f64,
        /// Time delay [s], at most 8190 periods.
        tau: f64,
        /// Gain of the linear part [y/u].
        delta: f64,
        /// Sample period [s].
        period: f64,
        /// Order of accuracy of the sampled derivatives: 1 (the paper's) or 2.
        order: usize = 1,
        /// Samples of memory, at most 4096: the paper's short memory. All of it, as 40 exponentials, if not given.
        memory: Option<usize> = None,
    }
    stage: Either<hyst_core::Ifm<f64, FullMemory, DELAY>, hyst_core::Ifm<f64, Short, DELAY>>,
    build: |p| {
        let params = IfmParams {
            a: p.a,
            b: p.b,
            c: p.c,
            alpha: p.alpha,
            beta: p.beta,
            tau: p.tau,
            delta: p.delta,
            order: order_of(p.order)?,
        };
        let cx = Sampling { period: p.period };
        Ok(match p.memory {
            None => Either::First(params.build(&cx)?),
            Some(samples) => {
                Either::Second(Build::<hyst_core::Ifm<f64, Short, DELAY>>::build(&params, &cx)?.cut(cut(samples)?))
            }
        })
    },
    inverse: closed,
    needs: [],

    /// Dynamic Preisach model: a classical one whose branches are weighted by a mirror function ξ(D, P) of their average rate D
    /// and change P, bilinear on a uniform grid, 1 at D = 0 and clamped beyond the other edges.
    ///
    /// With ``fade = 0`` the stack form as printed, which steps where loops close; with ``fade > 0`` the steps fade with that travel
    /// of the input, and the output is continuous. ``drifting`` is the recursion of eq. 17, which drifts. Inverse by search
    /// (``fade > 0``): give ``low`` and ``high``.
    class Dpm {
        /// Lowest input of the Preisach grid [u].
        low: f64,
        /// Highest input of the Preisach grid [u].
        high: f64,
        /// Output gained by each cell, as in ``Preisach`` [y].
        density: Vec<f64>,
        /// Lowest rate of the mirror's grid [u/s].
        rate_low: f64,
        /// Highest rate of the mirror's grid [u/s].
        rate_high: f64,
        /// Nodes along the rate, at most 32.
        rates: usize,
        /// Lowest change of the mirror's grid [u].
        change_low: f64,
        /// Highest change of the mirror's grid [u].
        change_high: f64,
        /// Nodes along the change, at most 32.
        changes: usize,
        /// ξ at the nodes, positive, shape (rates·changes,): node (d, p) at d·changes + p.
        mirror: Vec<f64>,
        /// Sample period [s].
        period: f64,
        /// Output gained once per grid interval by relays that never switch back [y]; zeros if not given.
        once: Option<Vec<f64>> = None,
        /// Input at which the virgin memory rests [u]; the lowest if not given.
        rest: Option<f64> = None,
        /// Travel over which the step at a closing loop fades to 1/e [u].
        fade: f64 = 0.0,
        /// The recursion of eq. 17 instead.
        drifting: bool = false,
    }
    stage: HostDpm,
    build: |p| {
        let preisach = triangle(p.low, p.high, &p.density, p.once.as_deref(), p.rest)?;
        let mirror = MirrorParams {
            rate_low: p.rate_low,
            rate_high: p.rate_high,
            rates: p.rates,
            change_low: p.change_low,
            change_high: p.change_high,
            changes: p.changes,
            weights: p.mirror.clone(),
        };
        let model: HostDpm = DpmParams { preisach, mirror, fade: p.fade }.build(&Sampling { period: p.period })?;
        Ok(if p.drifting { model.drifting() } else { model })
    },
    inverse: search,
    needs: [],

    /// Bouc-Wen operator ``y = k0·u + g``, ``ġ = α·u̇ − β·|u̇|·|g|ⁿ⁻¹·g − γ·u̇·|g|ⁿ`` (rate-independent).
    ///
    /// Exact for n = 1 and 2, else to 1e-5 of the largest g in one sample (n ≤ 10). Inverse by search: give ``low`` and ``high``. Where the
    /// slope is negative just after a turn, the drive jumps over the fold.
    class BoucWen {
        /// Gain of the part without memory [y/u].
        k0: f64,
        /// Slope of the memory at zero [y/u].
        alpha: f64,
        /// Dissipation, zero or positive.
        beta: f64,
        /// Difference between the way out and the way back, from −beta to beta.
        gamma: f64,
        /// Sharpness of the bend, 1 to 20.
        n: f64 = 1.0,
    }
    stage: hyst_core::BoucWen<f64>,
    build: |p| BoucWenParams { k0: p.k0, alpha: p.alpha, beta: p.beta, gamma: p.gamma, n: p.n }.build(&()),
    inverse: bouc_wen,
    needs: [],

    /// Bouc-Wen operator in the form ``y = d·u − h``, ``ḣ = a·u̇ − b·|u̇|·h − gamma·u̇·|h|``.
    ///
    /// ``BoucWen`` with k0 = d, alpha = −a, beta = b, gamma = −gamma, n = 1. Inverse by search: give ``low`` and ``high``.
    class BoucWenClassic {
        /// Slope of the memory at zero [y/u].
        a: f64,
        /// Dissipation, zero or positive.
        b: f64,
        /// Difference between the way out and the way back, from −b to b.
        gamma: f64,
        /// Gain of the part without memory [y/u].
        d: f64,
    }
    stage: hyst_core::BoucWen<f64>,
    build: |p| BoucWenClassicParams { d: p.d, a: p.a, b: p.b, gamma: p.gamma }.build(&()),
    inverse: bouc_wen,
    needs: [],

    /// Oscillator with a Bouc-Wen element: ``m·ÿ + c·ẏ + k·y + z = u``,
    /// ``ż = α·ẏ − β·(γ·|ẏ|·|z|^(ν−1)·z + δ·ẏ·|z|^ν)``, u linear between samples.
    class BoucWenOscillator {
        /// Mass m [u s²/y].
        mass: f64,
        /// Damping c [u s/y].
        damping: f64,
        /// Stiffness k [u/y].
        stiffness: f64,
        /// Stiffness of the hysteretic force at zero [u/y].
        alpha: f64,
        /// Scale of what bends it.
        beta: f64,
        /// Dissipation.
        gamma: f64,
        /// Difference between the way out and the way back.
        delta: f64,
        /// Sample period [s].
        period: f64,
        /// Sharpness of the bend, 1 to 20.
        nu: f64 = 1.0,
    }
    stage: hyst_core::BoucWenOscillator<f64>,
    build: |p| BoucWenOscillatorParams {
        mass: p.mass,
        damping: p.damping,
        stiffness: p.stiffness,
        alpha: p.alpha,
        beta: p.beta,
        gamma: p.gamma,
        delta: p.delta,
        nu: p.nu,
    }.build(&Sampling { period: p.period }),
    inverse: refused("the drive of an oscillator takes the reference's acceleration and jerk; track it with feedback"),
    needs: [],

    /// Activation-function model ``z = k0·u + α u̇ + β·atan(γu)`` (Xie et al., eq. 2), u̇ the backward difference.
    ///
    /// Inverse: a sample at a time where that is stable; for α < 0 backwards in time with a preview, to within ``tolerance`` of the
    /// largest |α u̇| while the drive keeps out of the switch at 0 V that a large γ makes.
    class Atan {
        /// Gain [y/u].
        k0: f64,
        /// Share of the input's rate [y s/u].
        alpha: f64,
        /// Size of the activation [y].
        beta: f64,
        /// Its sharpness [1/u].
        gamma: f64,
        /// Sample period [s].
        period: f64,
    }
    stage: Activation<f64>,
    build: |p| (
        ActivationKind::Atan, ActivationParams { k0: p.k0, alpha: p.alpha, beta: p.beta, gamma: p.gamma },
    ).build(&Sampling { period: p.period }),
    inverse: activation,
    needs: [],

    /// Activation-function model ``z = k0·u + α u̇ + β·1/(1 + e^(−γu))`` (Xie et al., eq. 2), u̇ the backward difference.
    ///
    /// Inverse: a sample at a time where that is stable; for α < 0 backwards in time with a preview, to within ``tolerance`` of the
    /// largest |α u̇| while the drive keeps out of the switch at 0 V that a large γ makes.
    class Sigmoid {
        /// Gain [y/u].
        k0: f64,
        /// Share of the input's rate [y s/u].
        alpha: f64,
        /// Size of the activation [y].
        beta: f64,
        /// Its sharpness [1/u].
        gamma: f64,
        /// Sample period [s].
        period: f64,
    }
    stage: Activation<f64>,
    build: |p| (
        ActivationKind::Sigmoid, ActivationParams { k0: p.k0, alpha: p.alpha, beta: p.beta, gamma: p.gamma },
    ).build(&Sampling { period: p.period }),
    inverse: activation,
    needs: [],

    /// Activation-function model ``z = k0·u + α u̇ + β·ln(1 + e^(γu))`` (Xie et al., eq. 2), u̇ the backward difference.
    ///
    /// Inverse: a sample at a time where that is stable; for α < 0 backwards in time with a preview, to within ``tolerance`` of the
    /// largest |α u̇| while the drive keeps out of the switch at 0 V that a large γ makes.
    class Softplus {
        /// Gain [y/u].
        k0: f64,
        /// Share of the input's rate [y s/u].
        alpha: f64,
        /// Size of the activation [y].
        beta: f64,
        /// Its sharpness [1/u].
        gamma: f64,
        /// Sample period [s].
        period: f64,
    }
    stage: Activation<f64>,
    build: |p| (
        ActivationKind::Softplus, ActivationParams { k0: p.k0, alpha: p.alpha, beta: p.beta, gamma: p.gamma },
    ).build(&Sampling { period: p.period }),
    inverse: activation,
    needs: [],

    /// Activation-function model ``z = k0·u + α u̇ + β·γu/(1 + |γu|)`` (Xie et al., eq. 2), u̇ the backward difference.
    ///
    /// Inverse: a sample at a time where that is stable; for α < 0 backwards in time with a preview, to within ``tolerance`` of the
    /// largest |α u̇| while the drive keeps out of the switch at 0 V that a large γ makes.
    class Softsign {
        /// Gain [y/u].
        k0: f64,
        /// Share of the input's rate [y s/u].
        alpha: f64,
        /// Size of the activation [y].
        beta: f64,
        /// Its sharpness [1/u].
        gamma: f64,
        /// Sample period [s].
        period: f64,
    }
    stage: Activation<f64>,
    build: |p| (
        ActivationKind::Softsign, ActivationParams { k0: p.k0, alpha: p.alpha, beta: p.beta, gamma: p.gamma },
    ).build(&Sampling { period: p.period }),
    inverse: activation,
    needs: [],

    /// Activation-function model ``z = k0·u + α u̇ + β·tanh(γu)`` (Xie et al., eq. 2), u̇ the backward difference.
    ///
    /// Inverse: a sample at a time where that is stable; for α < 0 backwards in time with a preview, to within ``tolerance`` of the
    /// largest |α u̇| while the drive keeps out of the switch at 0 V that a large γ makes.
    class Tanh {
        /// Gain [y/u].
        k0: f64,
        /// Share of the input's rate [y s/u].
        alpha: f64,
        /// Size of the activation [y].
        beta: f64,
        /// Its sharpness [1/u].
        gamma: f64,
        /// Sample period [s].
        period: f64,
    }
    stage: Activation<f64>,
    build: |p| (
        ActivationKind::Tanh, ActivationParams { k0: p.k0, alpha: p.alpha, beta: p.beta, gamma: p.gamma },
    ).build(&Sampling { period: p.period }),
    inverse: activation,
    needs: [],

    /// Asymmetry: a curve of one-sided dead zones behind the hysteresis,
    /// ``y = u + Σ weights[j]·dead(u, thresholds[j])``.
    ///
    /// Closed-form inverse, if the curve rises.
    class Asymmetry {
        /// Where the dead zones end [y]; on each side of zero moving away from it, shape (n,), n ≤ 4.
        thresholds: Vec<f64>,
        /// Changes of slope [ratio], shape (n,).
        weights: Vec<f64>,
    }
    stage: hyst_core::Asymmetry<f64, 4>,
    build: |p| AsymmetryParams { thresholds: &p.thresholds, weights: &p.weights }.build(&()),
    inverse: closed,
    needs: [],

    /// Load ``y = u + per_newton·F``. Needs ``load`` [N].
    class Load {
        /// Compliance [y/N].
        per_newton: f64,
    }
    stage: hyst_core::Load<f64>,
    build: |p| LoadParams { per_newton: p.per_newton }.build(&()),
    inverse: |p, _, options| compensator(1.0, options, |chain, _| {
        chain.with_load(&LoadParams { per_newton: p.per_newton })
    }),
    needs: [load],

    /// Saturation: the output is the input between two knees and approaches the limits beyond.
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
    stage: hyst_core::Saturation<f64>,
    build: |p| SaturationParams { low: p.low, high: p.high, knee: p.knee }.build(&()),
    inverse: closed,
    needs: [],
}
