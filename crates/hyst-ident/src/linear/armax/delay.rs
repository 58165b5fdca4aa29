//! The delay of the input.

use super::prediction::Signals;
use super::stacked::Stacked;
use crate::Samples;
use crate::linear::LinearError;

/// Lags of the models that are compared.
const LAGS: usize = 8;
/// The longest delay that is tried \[rows\].
const LONGEST: usize = 16;
/// An earlier start of the input's share must lower the prediction error this much to be believed.
const CLEARLY: f64 = 0.005;

/// The delay of the input \[rows\]: the longest with which an ARX model of eight lags, `A y = q⁻ᵏ B u`, predicts as well as the
/// best of all delays from 0 to 16 (within half a percent of its mean square).
///
/// A delay is no more than leading coefficients of B that are zero: leaving it out costs nothing but a higher order.
///
/// # Errors
/// When a column is constant or the record has fewer than 200 rows in one segment.
pub fn estimate_delay(samples: &Samples) -> Result<usize, LinearError> {
    let signals = Signals::new(samples)?;
    let longest = samples.segments.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    if longest < 200 {
        return Err(LinearError::TooShort {
            what: "the delay's estimate",
            needed: 200,
            found: longest,
            remedy: "record longer, or give the delay",
        });
    }
    // All delays predict the same rows, or their errors could not be compared.
    let first = LAGS + LONGEST;
    let missed = |delay: usize| {
        let mut stacked = Stacked::new(2 * LAGS + 2);
        for rows in &signals.rows {
            for t in rows.clone().skip(first) {
                stacked.row(|p| match p {
                    p if p < LAGS => signals.y[t - 1 - p],
                    p if p <= 2 * LAGS => signals.u[t - delay - (p - LAGS)],
                    p if p == 2 * LAGS + 1 => 1.0,
                    _ => signals.y[t],
                });
            }
        }
        stacked.triangle().rest
    };
    let missed: Vec<f64> = (0..=LONGEST).map(missed).collect();
    let least = missed.iter().copied().fold(f64::INFINITY, f64::min);
    Ok(missed.iter().rposition(|m| *m <= (1.0 + CLEARLY) * least).unwrap_or(0))
}
