//! Checks that the output follows the prediction.

use super::error::LearnError;

/// Minimum correlation for learning: below it the change has the wrong sign at too many frequencies.
const MIN_CORRELATION: f64 = 0.5;

/// Checks that the output moves as predicted.
pub(super) fn check_following(predicted: &[f64], output: &[f64]) -> Result<(), LearnError> {
    let n = predicted.len() as f64;
    let mean = |x: &[f64]| x.iter().sum::<f64>() / n;
    let (mean_v, mean_y) = (mean(predicted), mean(output));
    let (mut own, mut cross, mut all) = (0.0, 0.0, 0.0);
    for (v, y) in predicted.iter().zip(output) {
        let (v, y) = (v - mean_v, y - mean_y);
        own += v * v;
        cross += v * y;
        all += y * y;
    }
    let correlation = cross / (own * all).sqrt().max(f64::MIN_POSITIVE);
    let gain = cross / own.max(f64::MIN_POSITIVE);
    if correlation >= MIN_CORRELATION {
        return Ok(());
    }
    let advice = if correlation < -MIN_CORRELATION {
        "the model has the wrong sign for this actuator; fit a model to a record of this actuator"
    } else {
        "check the sensor, the amplifier, and that the model is of this actuator"
    };
    Err(LearnError::NotFollowing { correlation, gain, advice })
}
