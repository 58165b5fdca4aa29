//! Errors of the specification of a drive.

/// Errors of the specification of a drive.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExciteError {
    /// A field of a specification is out of its range.
    #[error("{field} = {value}: it has to be {must}")]
    Field {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The range, in words.
        must: String,
    },
    /// A segment exceeds the slew limit.
    #[error("{shape}: {needed:.6} V/s are needed, but slew_v_per_s = {limit}; {remedy}, or narrow lo_v … hi_v")]
    Slew {
        /// Shape of the segment.
        shape: &'static str,
        /// The steepest slope \[V/s\].
        needed: f64,
        /// The limit \[V/s\].
        limit: f64,
        /// Which field to change.
        remedy: &'static str,
    },
    /// Both effects are the same.
    #[error("both effects are {effect}; give two different ones")]
    Same {
        /// The effect.
        effect: &'static str,
    },
    /// No shape was given.
    #[error("a drive needs at least one segment")]
    Nothing,
}

pub(super) fn require(field: &'static str, value: f64, holds: bool, must: &str) -> Result<(), ExciteError> {
    if holds { Ok(()) } else { Err(ExciteError::Field { field, value, must: must.to_owned() }) }
}

pub(super) fn positive(field: &'static str, value: f64) -> Result<(), ExciteError> {
    require(field, value, value.is_finite() && value > 0.0, "a positive number")
}
