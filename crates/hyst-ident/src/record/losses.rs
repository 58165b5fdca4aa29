//! What is missing from the logs of a record.

use serde::{Deserialize, Serialize};

/// What is missing from a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Losses {
    /// Whether the log is truncated: the writer did not close it.
    pub cut_off: bool,
    /// Number of chunks and other records that are damaged and not read.
    pub damaged: usize,
    /// Number of gaps in time within a segment. A new segment begins after each gap.
    pub holes: usize,
}

impl Losses {
    /// Returns the sum over two logs.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            cut_off: self.cut_off || other.cut_off,
            damaged: self.damaged + other.damaged,
            holes: self.holes + other.holes,
        }
    }
}
