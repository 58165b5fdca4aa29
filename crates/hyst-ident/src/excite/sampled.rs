//! Rows of a segment from a function of time, and checks of frequencies and counts.

use std::f64::consts::PI;

use super::error::{ExciteError, positive, require};

/// Maximum number of rows of a drive; a larger number is a typing error.
pub(super) const MAX_ROWS: f64 = 5e7;

/// Returns half a cosine wave from 0 to 1 for `x` from 0 to 1, and 0 or 1 outside.
pub(super) fn smooth(x: f64) -> f64 {
    0.5 - 0.5 * (PI * x.clamp(0.0, 1.0)).cos()
}

/// Returns the rows from 0 to `duration` \[s\], the last one not before `duration`. `share` is not called for later
/// times. The error for a duration out of range names `field`.
pub(super) fn sampled(
    (field, value): (&'static str, f64),
    duration: f64,
    rate: f64,
    share: impl Fn(f64) -> f64,
) -> Result<Vec<f64>, ExciteError> {
    let steps = (duration * rate - 1e-9).ceil();
    require(field, value, (1.0..MAX_ROWS).contains(&steps), "such that the segment has 2 to 5e7 rows")?;
    Ok((0..=steps as usize).map(|k| share((k as f64 / rate).min(duration))).collect())
}

pub(super) fn check_frequency(field: &'static str, frequency: f64, rate: f64) -> Result<(), ExciteError> {
    positive(field, frequency)?;
    require(field, frequency, frequency <= 0.25 * rate, "at most a quarter of rate_hz")
}

pub(super) fn check_count(field: &'static str, count: u32) -> Result<(), ExciteError> {
    require(field, f64::from(count), count > 0, "at least 1")
}
