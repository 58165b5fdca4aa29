//! The inverse of an activation-function model on the host: a sample at a time where that is stable, else backwards in time.

use super::capacity::REFERENCES;
use hyst_core::{Activation, ActivationInverse, AntiCausal, Either, Error, Invert};

/// What the preview may miss, of the largest |α u̇|.
const TOLERANCE: f64 = 1e-10;

pub(super) type HostActivationInverse = Either<ActivationInverse<f64>, AntiCausal<f64, REFERENCES>>;

pub(super) fn inverse(model: &Activation<f64>) -> Result<HostActivationInverse, Error> {
    match model.invert() {
        Ok(inverse) => Ok(Either::First(inverse)),
        Err(why) => match model.anti_causal(TOLERANCE) {
            Ok(inverse) => Ok(Either::Second(inverse)),
            // A preview that is too long says more than that the causal inverse is unstable.
            Err(capacity @ Error::Capacity { .. }) => Err(capacity),
            Err(_) => Err(why),
        },
    }
}

pub(super) fn lead(inverse: &HostActivationInverse) -> usize {
    match inverse {
        Either::First(_) => 0,
        Either::Second(inverse) => inverse.lead(),
    }
}
