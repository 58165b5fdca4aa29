//! Activation-function models: five functions, one set of parameters.

use hyst_core::{Activation, ActivationKind, ActivationParams, Invert};
use hyst_ident::model::capacity::REFERENCES;
use pyo3::prelude::*;

use crate::errors;
use crate::inversion::{Built, Inverted, Options, closed};
use crate::model_macro::models;

/// A sample at a time where that is stable, else backwards in time.
fn activation<P, Q>(built: &Built<'_, P, Q, Activation<f64>>, options: &Options) -> PyResult<Inverted> {
    options.only(&["tolerance"])?;
    if built.stage.invert().is_ok() {
        return closed(built, &Options::default());
    }
    let inverse = built.stage.anti_causal::<REFERENCES>(options.tolerance.unwrap_or(1e-9)).map_err(errors::core)?;
    let lead = inverse.lead();
    Ok(Inverted::in_band(inverse, lead, None))
}

/// A class for each function, from its formula.
macro_rules! activations {
    ($($name:ident $formula:literal;)*) => {
        models! { $(
            #[doc = concat!("Activation-function model ``z = k0·u + α u̇ + β·", $formula, "`` (Xie et al., eq. 2), u̇ the backward difference.")]
            ///
            /// Inverse: a sample at a time where that is stable; for α < 0 backwards in time with a preview, to within ``tolerance`` of the
            /// largest |α u̇| while the drive keeps out of the switch at 0 V that a large γ makes.
            class $name {
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
