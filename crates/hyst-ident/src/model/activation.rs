//! The inverse of an activation-function model on the host: causal if that is stable, else anti-causal.

use super::capacity::REFERENCES;
use hyst_core::{Activation, ActivationInverse, AntiCausal, Either, Error, Invert};

/// The inverse of an activation-function model on the host.
///
/// The first variant is causal, the second needs a preview of the reference.
pub type HostActivationInverse = Either<ActivationInverse<f64>, AntiCausal<f64, REFERENCES>>;

/// Returns the causal inverse if it exists, else the anti-causal one.
///
/// `tolerance` is the error of the preview of the anti-causal inverse, relative to the largest |α u̇|.
///
/// # Errors
/// [`Error::NotInvertible`] with the reason against the causal inverse, if neither exists. Another error if the preview
/// is too long or the tolerance is out of range.
pub fn inverse(model: &Activation<f64>, tolerance: f64) -> Result<HostActivationInverse, Error> {
    match model.invert() {
        Ok(inverse) => Ok(Either::First(inverse)),
        Err(why) => match model.anti_causal(tolerance) {
            Ok(inverse) => Ok(Either::Second(inverse)),
            // The error of the causal inverse is more specific.
            Err(Error::NotInvertible(_)) => Err(why),
            Err(of_the_preview) => Err(of_the_preview),
        },
    }
}

/// Returns the preview of the reference that the inverse needs \[samples\].
pub fn lead(inverse: &HostActivationInverse) -> usize {
    match inverse {
        Either::First(_) => 0,
        Either::Second(inverse) => inverse.lead(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_core::{ActivationKind, ActivationParams, Build, Sampling};

    fn inverse_of(params: ActivationParams, period: f64, tolerance: f64) -> Result<HostActivationInverse, Error> {
        inverse(&(ActivationKind::Tanh, params).build(&Sampling { period }).unwrap(), tolerance)
    }

    #[test]
    fn the_error_states_the_relevant_reason() {
        let params = ActivationParams { k0: 1.0, alpha: -0.01, beta: 0.5, gamma: 0.1 };
        assert!(lead(&inverse_of(params, 1e-3, 1e-9).unwrap()) > 0);
        let causal = inverse_of(ActivationParams { alpha: 0.01, ..params }, 1e-3, 1e-9).unwrap();
        assert!(matches!(causal, Either::First(_)) && lead(&causal) == 0);
        let why = |params, period, tolerance| inverse_of(params, period, tolerance).map(|_| ()).unwrap_err();
        // The output falls within a sample; this does not depend on the sign of alpha.
        for alpha in [0.01, -0.001] {
            let falling = why(ActivationParams { alpha, beta: -30.0, gamma: 1.0, ..params }, 0.01, 1e-9);
            assert!(falling.to_string().contains("must rise with the input within a sample"), "{falling}");
        }
        assert!(matches!(why(params, 1e-3, 2.0), Error::OutOfRange { .. }));
        assert!(matches!(why(params, 1e-7, 1e-9), Error::Capacity { .. }));
    }
}
