//! Errors of the learning.

use crate::compensate::CompensateError;

/// Errors of the learning.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearnError {
    /// The first drive cannot be computed.
    #[error(transparent)]
    Compensate(#[from] CompensateError),
    /// The reference has more than one segment.
    #[error("{record}: the reference has {segments} segments; learn each one from a separate file")]
    Segments {
        /// The reference.
        record: String,
        /// Number of segments.
        segments: usize,
    },
    /// The reference is constant.
    #[error("{record}: the reference does not move: all values are {value}; give a reference that moves")]
    Still {
        /// The reference.
        record: String,
        /// Its value \[output unit\].
        value: f64,
    },
    /// Plays differ in length from the drive, or there are fewer than two.
    #[error(
        "a pass needs at least two plays of {rows} rows each; there are {plays}, one of {other} rows; repeat the whole pass"
    )]
    Plays {
        /// Rows of the drive.
        rows: usize,
        /// Number of plays.
        plays: usize,
        /// Rows of the first play of another length, or of any play.
        other: usize,
    },
    /// A value is not a number.
    #[error("play {play}, row {row}: the output is not a number; check the sensor")]
    NotFinite {
        /// Number of the play, from 1.
        play: usize,
        /// Number of the row, from 1.
        row: usize,
    },
    /// The output hardly follows the reference, or moves in the opposite direction.
    #[error("the output does not follow the reference (correlation {correlation:.2}, gain {gain:.2}): {advice}")]
    NotFollowing {
        /// Correlation of predicted and measured output.
        correlation: f64,
        /// Slope of the measured over the predicted output.
        gain: f64,
        /// What to do.
        advice: &'static str,
    },
}
