//! Estimates the delay of the input.

use super::prediction::Signals;
use super::stacked::Stacked;
use crate::Samples;
use crate::linear::LinearError;

/// Order of the compared models.
const ARX_ORDER: usize = 8;
/// Maximum delay \[rows\].
const MAX_DELAY: usize = 16;
/// Maximum relative increase of the squared prediction error for a longer delay.
const ERROR_TOLERANCE: f64 = 0.005;

/// Returns the delay of the input \[rows\]: the longest delay from 0 to 16 with which an ARX model of order 8, `A y =
/// q⁻ᵏ B u`, predicts as well as with the best one (within half a percent of the mean square).
///
/// A delay is equivalent to leading coefficients of B that are 0. A model with a shorter delay only needs a higher
/// order.
///
/// # Errors
/// If a column is constant or no segment has 200 rows.
pub fn estimate_delay(samples: &Samples) -> Result<usize, LinearError> {
    let signals = Signals::new(samples)?;
    let longest = samples.segments.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    if longest < 200 {
        return Err(LinearError::TooShort {
            what: "the estimate of the delay",
            needed: 200,
            found: longest,
            remedy: "record longer, or give the delay",
        });
    }
    // All delays predict the same rows, so that their errors are comparable.
    let first = ARX_ORDER + MAX_DELAY;
    let squared_error = |delay: usize| {
        let mut stacked = Stacked::new(2 * ARX_ORDER + 2);
        for rows in &signals.rows {
            for t in rows.clone().skip(first) {
                stacked.row(|p| match p {
                    p if p < ARX_ORDER => signals.y[t - 1 - p],
                    p if p <= 2 * ARX_ORDER => signals.u[t - delay - (p - ARX_ORDER)],
                    p if p == 2 * ARX_ORDER + 1 => 1.0,
                    _ => signals.y[t],
                });
            }
        }
        stacked.triangle().rest
    };
    let errors: Vec<f64> = (0..=MAX_DELAY).map(squared_error).collect();
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    Ok(errors.iter().rposition(|e| *e <= (1.0 + ERROR_TOLERANCE) * least).unwrap_or(0))
}
