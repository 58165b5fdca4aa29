//! Bouc-Wen operators and an oscillator with a Bouc-Wen element.

use hyst_core::{BoucWen as Operator, BoucWenClassicParams, BoucWenOscillatorParams, BoucWenParams};
use pyo3::prelude::*;

use crate::errors;
use crate::inversion::{Built, Inverted, Options, refused};
use crate::model_macro::models;

/// Inverts by a search over the given range, to the given tolerance or 1e-9 of the range.
fn by_search<P, Q>(built: &Built<'_, P, Q, Operator<f64>>, options: &Options) -> PyResult<Inverted> {
    let (low, high, tolerance) = options.range()?;
    let inverse = built.stage.inverse(low, high, tolerance).map_err(errors::core)?;
    Ok(Inverted::exact(inverse).between(low, high, tolerance))
}

models! {
    /// Bouc-Wen operator ``y = k0·u + g``, ``ġ = α·u̇ − β·|u̇|·|g|ⁿ⁻¹·g − γ·u̇·|g|ⁿ`` (rate-independent).
    ///
    /// Exact for n = 1 and 2; otherwise the error is 1e-5 of the maximum g in one sample (n ≤ 10). Inverse by search:
    /// give ``low`` and ``high``. If the slope is negative just after a reversal, the drive jumps over the fold.
    class BoucWen {
        /// Gain of the memory-free part [y/u].
        k0: f64,
        /// Slope of the hysteretic part at zero [y/u].
        alpha: f64,
        /// Dissipation, zero or positive.
        beta: f64,
        /// Difference between loading and unloading, from −beta to beta.
        gamma: f64,
        /// Sharpness of the transition, 1 to 20.
        n: f64 = 1.0,
    }
    params: |p| Ok(BoucWenParams { k0: p.k0, alpha: p.alpha, beta: p.beta, gamma: p.gamma, n: p.n }),
    stage: hyst_core::BoucWen<f64>,
    inverse: by_search,
    needs: [],

    /// Bouc-Wen operator in the form ``y = d·u − h``, ``ḣ = a·u̇ − b·|u̇|·h − gamma·u̇·|h|``.
    ///
    /// ``BoucWen`` with k0 = d, alpha = −a, beta = b, gamma = −gamma, n = 1. Inverse by search: give ``low`` and
    /// ``high``.
    class BoucWenClassic {
        /// Slope of the hysteretic part at zero [y/u].
        a: f64,
        /// Dissipation, zero or positive.
        b: f64,
        /// Difference between loading and unloading, from −b to b.
        gamma: f64,
        /// Gain of the memory-free part [y/u].
        d: f64,
    }
    params: |p| Ok(BoucWenClassicParams { d: p.d, a: p.a, b: p.b, gamma: p.gamma }),
    stage: hyst_core::BoucWen<f64>,
    inverse: by_search,
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
        /// Scale of gamma and delta.
        beta: f64,
        /// Dissipation.
        gamma: f64,
        /// Difference between loading and unloading.
        delta: f64,
        /// Sample period [s].
        period: f64,
        /// Sharpness of the transition, 1 to 20.
        nu: f64 = 1.0,
    }
    params: |p| Ok(BoucWenOscillatorParams {
        mass: p.mass,
        damping: p.damping,
        stiffness: p.stiffness,
        alpha: p.alpha,
        beta: p.beta,
        gamma: p.gamma,
        delta: p.delta,
        nu: p.nu,
    }),
    stage: hyst_core::BoucWenOscillator<f64>,
    period: |p| p.period,
    inverse: refused("the drive of an oscillator needs acceleration and jerk of the reference; use feedback"),
    needs: [],
}
