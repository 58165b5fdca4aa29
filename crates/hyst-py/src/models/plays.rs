//! Play operators and the models that consist of them.

use hyst_core::{Curve, Error, GpiParams, PiParams, TdPiParams, ViscousPiParams};

use crate::arrays::List;
use crate::inversion::{closed, refused};
use crate::model_macro::models;
use hyst_ident::model::capacity::PLAYS;

fn pi(gain: f64, thresholds: &[f64], weights: &[f64]) -> PiParams<Vec<f64>> {
    PiParams { gain, thresholds: thresholds.to_vec(), weights: weights.to_vec() }
}

/// Returns an envelope from its two or four numbers.
fn curve(name: &'static str, numbers: &[f64]) -> Result<Curve, Error> {
    match numbers {
        [slope, offset] => Ok(Curve::Linear { slope: *slope, offset: *offset }),
        [height, rate, shift, offset] => {
            Ok(Curve::Tanh { height: *height, rate: *rate, shift: *shift, offset: *offset })
        }
        _ => Err(Error::OutOfRange { name, must: "[slope, offset] or [height, rate, shift, offset]" }),
    }
}

models! {
    /// Play operator (backlash) of half-width ``radius``: ``p ← max(u − r, min(u + r, p))``, from 0.
    class Play {
        /// Half-width r [u], positive.
        radius: f64,
    }
    params: |p| Ok(pi(0.0, &[p.radius], &[1.0])),
    stage: hyst_core::Pi<f64, 1>,
    inverse: refused("the output does not change while the input crosses the width of the play"),
    needs: [],

    /// Stop operator (elasto-slip element) with yield ``limit``: ``s ← clamp(s + Δu, −r, r)``, from 0. Play and stop of
    /// the same half-width add up to the input.
    class Stop {
        /// Yield r [u], positive.
        limit: f64,
    }
    params: |p| Ok(pi(1.0, &[p.limit], &[-1.0])),
    stage: hyst_core::Pi<f64, 1>,
    inverse: refused("the output does not change while the stop slips"),
    needs: [],

    /// Prandtl-Ishlinskii operator ``y = gain·u + Σ weights[i]·play(u, thresholds[i])``.
    ///
    /// Closed-form inverse, if gain and initial slopes are positive.
    class Pi {
        /// Gain of the identity [y/u].
        gain: f64,
        /// Half-widths of the play operators [u], positive and strictly rising, shape (n,), n ≤ 64.
        thresholds: List,
        /// Weights of the play operators [y/u], shape (n,).
        weights: List,
    }
    params: |p| Ok(pi(p.gain, &p.thresholds, &p.weights)),
    stage: hyst_core::Pi<f64, PLAYS>,
    inverse: closed,
    needs: [],

    /// Prandtl-Ishlinskii operator with viscous play operators (rate-dependent): ``y = gain·u + Σ weights[i]·pᵢ``. Play
    /// i is at rest for ``|u − pᵢ| ≤ thresholds[i]``. Beyond that it follows with the speed v of ``seconds·v +
    /// sqrt(volt_seconds·v) = |u − pᵢ| − thresholds[i]``.
    ///
    /// The loop widens by ``seconds`` times the rate and by the square root of ``volt_seconds`` times the rate. With
    /// both 0 it is ``Pi``. Exact inverse.
    class ViscousPi {
        /// Gain of the identity [y/u].
        gain: f64,
        /// Half-widths of the play operators [u], positive and strictly rising, shape (n,), n ≤ 64.
        thresholds: List,
        /// Weights of the play operators [y/u], shape (n,).
        weights: List,
        /// Drag proportional to the rate [s].
        seconds: f64,
        /// Sample period [s].
        period: f64,
        /// Drag proportional to the square root of the rate [u s].
        volt_seconds: f64 = 0.0,
    }
    params: |p| Ok(ViscousPiParams {
        pi: pi(p.gain, &p.thresholds, &p.weights),
        seconds: p.seconds,
        volt_seconds: p.volt_seconds,
    }),
    stage: hyst_core::ViscousPi<f64, PLAYS>,
    period: |p| p.period,
    inverse: closed,
    needs: [],

    /// Generalised Prandtl-Ishlinskii operator: play operators between two envelope functions,
    /// ``y = gain·F₀ + Σ weights[i]·Fᵢ``, ``Fᵢ ← max(left(u) − rᵢ, min(right(u) + rᵢ, Fᵢ))``.
    ///
    /// An envelope is ``[slope, offset]`` for ``slope·u + offset`` or ``[height, rate, shift, offset]`` for
    /// ``height·tanh(rate·u + shift) + offset``. The inverse is exact for drives with ``left(u) ≤ right(u)``; beyond a
    /// crossing of the envelopes it has an error. Its drive jumps at each reversal of the reference.
    class Gpi {
        /// Weight of the play operator of radius 0 [y per unit of the envelope].
        gain: f64,
        /// Radii [unit of the envelope], positive and strictly rising, shape (n,), n ≤ 64.
        thresholds: List,
        /// Weights [y per unit of the envelope], shape (n,).
        weights: List,
        /// Envelope of the rising side, shape (2,) or (4,).
        left: List,
        /// Envelope of the falling side, shape (2,) or (4,).
        right: List,
    }
    params: |p| Ok(GpiParams {
        left: curve("gpi.left", &p.left)?,
        right: curve("gpi.right", &p.right)?,
        gain: p.gain,
        thresholds: p.thresholds.to_vec(),
        weights: p.weights.to_vec(),
    }),
    stage: hyst_core::Gpi<f64, PLAYS>,
    inverse: closed,
    needs: [],

    /// Temperature-dependent Prandtl-Ishlinskii model: thresholds ``alpha·i`` and weights ``epsilon·exp(eta·(T −
    /// t0))·exp(−tau·alpha·i)``, i = 0 … n, with play operators between the envelopes ``a0·u + a1`` (rising) and ``b0·u
    /// + b1`` (falling). Needs ``temperature`` [°C].
    ///
    /// The inverse is exact, also at a changing temperature, for drives with ``a0·u + a1 ≤ b0·u + b1``. Its drive jumps
    /// at each reversal of the reference.
    class TdPi {
        /// Spacing of the thresholds [unit of the envelope].
        alpha: f64,
        /// Weight at r = 0 and t0 [y per unit of the envelope].
        epsilon: f64,
        /// Decay of the weights with the threshold.
        tau: f64,
        /// Relative change of the weights with temperature [1/K].
        eta: f64,
        /// Slope of the envelope of the rising side.
        a0: f64,
        /// Offset of the envelope of the rising side.
        a1: f64,
        /// Slope of the envelope of the falling side.
        b0: f64,
        /// Offset of the envelope of the falling side.
        b1: f64,
        /// Number of thresholds without that at 0, at most 64.
        n: u16 = 9,
        /// Reference temperature [°C].
        t0: f64 = 23.0,
    }
    params: |p| Ok(TdPiParams {
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
    }),
    stage: hyst_core::TdPi<f64, PLAYS>,
    inverse: closed,
    needs: [temperature],
}
