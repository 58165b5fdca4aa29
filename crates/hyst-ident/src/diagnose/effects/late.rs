//! What delay and lag share: start values and the smallest size that counts.

use crate::nested::{Fitted, Problem};
use crate::samples::Samples;

/// Ratio of successive start values, and their maximum as a share of the longest segment.
const RATIO: f64 = 12.0;
pub(super) const MAX_SHARE: f64 = 0.01;
/// Maximum time of a limit of detection, as a share of the longest segment.
pub(super) const MAX_LIMIT_SHARE: f64 = 0.1;
/// Minimum time, in sample periods; beside a drag, whose law is not exact, a delay of a fraction of a sample is the
/// misfit of that law.
const MIN_SAMPLES: f64 = 0.02;
const MIN_SAMPLES_BESIDE_DRAG: f64 = 0.3;

/// Returns start values \[s\]: one sample, and longer ones if the sample rate is high for the record.
pub(super) fn starts(samples: &Samples) -> impl Iterator<Item = f64> {
    let most = MAX_SHARE * samples.longest_segment();
    let times = [1.0, RATIO, RATIO * RATIO].map(|periods| periods * samples.period);
    times.into_iter().enumerate().filter(move |(i, seconds)| *i == 0 || *seconds < most).map(|(_, seconds)| seconds)
}

/// Returns whether a time \[s\] is long enough to be an effect of its own.
pub(super) fn is_long_enough(problem: &Problem<'_>, fit: &Fitted, seconds: f64) -> bool {
    let least = if fit.hypothesis.drag.is_some() { MIN_SAMPLES_BESIDE_DRAG } else { MIN_SAMPLES };
    seconds > least * problem.samples.period
}
