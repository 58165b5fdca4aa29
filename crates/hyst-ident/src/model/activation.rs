//! The inverse of an activation-function model on the host: a sample at a time where that is stable, else backwards in time.

use super::capacity::REFERENCES;
use hyst_core::{Activation, ActivationInverse, AntiCausal, Either, Error, Invert};

/// The inverse of an activation-function model as the host runs it: the first is causal, the second looks ahead.
pub type HostActivationInverse = Either<ActivationInverse<f64>, AntiCausal<f64, REFERENCES>>;

/// The causal inverse where there is one; else the one backwards in time, whose preview misses `tolerance` of the largest
/// |α u̇|.
///
/// # Errors
/// [`Error::NotInvertible`] with the reason against the causal inverse, if there is neither. If the preview is too long or the
/// tolerance out of range, that.
pub fn inverse(model: &Activation<f64>, tolerance: f64) -> Result<HostActivationInverse, Error> {
    match model.invert() {
        Ok(inverse) => Ok(Either::First(inverse)),
        Err(why) => match model.anti_causal(tolerance) {
            Ok(inverse) => Ok(Either::Second(inverse)),
            // It refers to the causal inverse, which has said more.
            Err(Error::NotInvertible(_)) => Err(why),
            Err(of_the_preview) => Err(of_the_preview),
        },
    }
}

/// Samples by which its reference must be known ahead.
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
    fn what_is_refused_says_the_reason_that_counts() {
        let params = ActivationParams { k0: 1.0, alpha: -0.01, beta: 0.5, gamma: 0.1 };
        assert!(lead(&inverse_of(params, 1e-3, 1e-9).unwrap()) > 0);
        let causal = inverse_of(ActivationParams { alpha: 0.01, ..params }, 1e-3, 1e-9).unwrap();
        assert!(matches!(causal, Either::First(_)) && lead(&causal) == 0);
        let why = |params, period, tolerance| inverse_of(params, period, tolerance).map(|_| ()).unwrap_err();
        // Falls within a sample: nothing to do with the sign of alpha, whichever it has.
        for alpha in [0.01, -0.001] {
            let falling = why(ActivationParams { alpha, beta: -30.0, gamma: 1.0, ..params }, 0.01, 1e-9);
            assert!(falling.to_string().contains("must rise with the input within a sample"), "{falling}");
        }
        assert!(matches!(why(params, 1e-3, 2.0), Error::OutOfRange { .. }));
        assert!(matches!(why(params, 1e-7, 1e-9), Error::Capacity { .. }));
    }
}
