//! Why a linear model or response cannot be had.

use crate::Samples;

/// Why a linear model or response cannot be had.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinearError {
    /// An option is out of its range.
    #[error("{field} = {value}: it has to be {must}")]
    Field {
        /// The option.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The range, in words.
        must: String,
    },
    /// There are too few rows.
    #[error("{what} needs segments of at least {needed} rows, but the longest has {found}; {remedy}")]
    TooShort {
        /// What was asked for.
        what: &'static str,
        /// Rows that it needs.
        needed: usize,
        /// Rows that there are.
        found: usize,
        /// What to do.
        remedy: &'static str,
    },
    /// Segments differ in their sample periods.
    #[error(
        "segments have sample periods of {first:.9} s and {other:.9} s, and one is needed; take those of one of them"
    )]
    MixedPeriods {
        /// That of the first segment \[s\].
        first: f64,
        /// Another \[s\].
        other: f64,
    },
    /// A column does not move.
    #[error("the {column} is constant; record while the actuator is driven")]
    Constant {
        /// `input` or `output`.
        column: &'static str,
    },
    /// The equations could not be solved.
    #[error(
        "no ARMAX model of order {order} fits the record; take a lower order, or a band that ends at the drive's highest frequency"
    )]
    Unfit {
        /// The order.
        order: usize,
    },
    /// No periods of the drive repeat.
    #[error("no period of {seconds} s repeats: {reason}; give the period of the drive, or none")]
    NotPeriodic {
        /// The period asked for \[s\].
        seconds: f64,
        /// What was found.
        reason: String,
    },
    /// No cycles of a sine were found.
    #[error("no sine was found in the input: {reason}; drive with `hystctl excite tones`, or give the frequency")]
    NoSine {
        /// What was found.
        reason: String,
    },
}

/// The segments of a linear model or response share one sample period.
pub(super) fn require_one_period(samples: &Samples) -> Result<(), LinearError> {
    let first = samples.period_of(0);
    match samples.periods.iter().find(|period| **period != first) {
        Some(other) => Err(LinearError::MixedPeriods { first, other: *other }),
        None => Ok(()),
    }
}

pub(super) fn require(
    field: &'static str,
    value: f64,
    holds: bool,
    must: impl Into<String>,
) -> Result<(), LinearError> {
    if holds { Ok(()) } else { Err(LinearError::Field { field, value, must: must.into() }) }
}
