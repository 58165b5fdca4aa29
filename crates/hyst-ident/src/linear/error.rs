//! Errors of linear models and responses.

use crate::Samples;

/// Errors of linear models and responses.
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
        /// The estimate.
        what: &'static str,
        /// Required rows.
        needed: usize,
        /// Rows of the longest segment.
        found: usize,
        /// What to do.
        remedy: &'static str,
    },
    /// Segments differ in their sample periods.
    #[error("segments have sample periods of {first:.9} s and {other:.9} s; use segments of one sample period")]
    MixedPeriods {
        /// Sample period of the first segment \[s\].
        first: f64,
        /// Another sample period \[s\].
        other: f64,
    },
    /// A column is constant.
    #[error("the {column} is constant; make a record in which the actuator is driven")]
    Constant {
        /// `input` or `output`.
        column: &'static str,
    },
    /// The equations could not be solved.
    #[error(
        "no ARMAX model of order {order} fits the record; use a lower order, or a band up to the highest frequency of the drive"
    )]
    Unfit {
        /// The order.
        order: usize,
    },
    /// No periods of the drive repeat.
    #[error("no period of {seconds} s repeats: {reason}; give the period of the drive, or omit it")]
    NotPeriodic {
        /// The given period \[s\].
        seconds: f64,
        /// The reason, in words.
        reason: String,
    },
    /// No cycles of a sine were found.
    #[error("no sine was found in the input: {reason}; drive with `hystctl excite tones`, or give the frequency")]
    NoSine {
        /// The reason, in words.
        reason: String,
    },
}

/// Checks that all segments have the same sample period.
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
