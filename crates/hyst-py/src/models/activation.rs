//! Activation-function models: five functions with the same parameters.

use hyst_core::{Activation, ActivationKind, ActivationParams, Either};
use hyst_ident::model::activation::{inverse, lead};
use pyo3::prelude::*;

use crate::errors;
use crate::inversion::{Built, Inverted, Options};
use crate::model_macro::models;

/// Inverts sample by sample if that is stable, otherwise backwards in time.
fn activation<P, Q>(built: &Built<'_, P, Q, Activation<f64>>, options: &Options) -> PyResult<Inverted> {
    options.only(&["tolerance"])?;
    let inverse = inverse(built.stage, options.tolerance.unwrap_or(1e-9)).map_err(errors::core)?;
    if let Either::First(_) = inverse {
        options.only(&[])?;
    }
    let lead = lead(&inverse);
    Ok(Inverted::in_band(inverse, lead, None))
}

/// Generates a class for each function from its formula.
macro_rules! activations {
    ($($name:ident $formula:literal;)*) => {
        models! { $(
            #[doc = concat!("Activation-function model ``z = k0·u + α u̇ + β·", $formula, "`` (Xie et al., eq. 2), u̇ the backward difference.")]
            ///
            /// Inverse: sample by sample if that is stable; for α < 0 backwards in time with preview. The option
            /// ``tolerance`` (default 1e-9, only for the latter) is the error relative to the maximum |α u̇|, as long
            /// as the drive stays away from 0 V, where a large γ is a switch.
            class $name {
                /// Gain [y/u].
                k0: f64,
                /// Gain of the rate of the input [y s/u].
                alpha: f64,
                /// Gain of the activation [y].
                beta: f64,
                /// Steepness of the activation [1/u].
                gamma: f64,
                /// Sample period [s].
                period: f64,
            }
            params: |p| Ok((
                ActivationKind::$name,
                ActivationParams { k0: p.k0, alpha: p.alpha, beta: p.beta, gamma: p.gamma },
            )),
            stage: Activation<f64>,
            period: |p| p.period,
            inverse: activation,
            needs: [],
        )* }
    };
}
activations! {
    Atan "atan(γu)";
    Sigmoid "1/(1 + e^(−γu))";
    Softplus "ln(1 + e^(γu))";
    Softsign "γu/(1 + |γu|)";
    Tanh "tanh(γu)";
}
