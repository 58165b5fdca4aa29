//! Limit of detection of one effect: the smallest size at which this record would have shown it.
//!
//! An effect of a given size changes the output by a column of numbers. The part of that column that the base and the
//! effects found cannot imitate is the gain of a search for it. The search accepts from a known gain on (`least_gain`
//! in `score.rs`). So the size follows from linear algebra, without a search. If an effect is not proportional to its
//! parameter, the column is recomputed at the size found.

use hyst_core::Error;
use serde::{Deserialize, Serialize};

use super::scan::Scan;

/// Maximum number of rounds in which the column is recomputed.
const ROUNDS: usize = 4;

/// Limit of detection of an effect in one record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Limit {
    /// The smallest size at which the effect would have been named.
    Size {
        /// Size.
        size: f64,
        /// Its unit.
        unit: String,
        /// What the size measures.
        meaning: String,
    },
    /// The record cannot show the effect, whatever its size.
    NotVisible {
        /// Reason.
        not_visible: String,
    },
}

impl Limit {
    pub(super) fn hidden(why: &str) -> Self {
        Self::NotVisible { not_visible: why.into() }
    }

    /// Returns the limit of an effect that the record cannot show because something else imitates it.
    pub(super) fn imitated() -> Self {
        Self::hidden("the base model or the effects found imitate it")
    }

    /// Returns a limit; `None` means that no size can be detected.
    pub(super) fn of(size: Option<f64>, unit: &str, meaning: String) -> Self {
        match size.filter(|s| s.is_finite() && *s > 0.0) {
            Some(size) => Self::Size { size, unit: unit.into(), meaning },
            None => Self::imitated(),
        }
    }
}

/// Shared context of all limits.
pub(super) struct Limits<'a> {
    pub(super) scan: Scan<'a>,
    /// Gain from which on an effect is accepted, and from which on a tone is.
    pub(super) least: f64,
    pub(super) least_tone: f64,
    /// Margin of a limit that follows from a bound of the size itself.
    pub(super) margin: f64,
    /// Symbol of the input's unit, and unit of the output.
    pub(super) input: &'a str,
    pub(super) output: &'a str,
}

impl Limits<'_> {
    /// Returns the size at which the part of an effect that nothing else imitates reaches `least` (Σ residual²).
    /// `change` returns the change of the output for a size.
    pub(super) fn size(
        &self,
        first: f64,
        most: f64,
        least: f64,
        change: &dyn Fn(f64) -> Result<Vec<f64>, Error>,
    ) -> Result<Option<f64>, Error> {
        let mut size = first;
        for _ in 0..ROUNDS {
            let left = self.scan.left(&change(size)?);
            if left <= 0.0 || left.is_nan() {
                return Ok(None);
            }
            let next = size * (least / left).sqrt();
            if (next / size - 1.0).abs() < 0.02 {
                return Ok(Some(next));
            }
            size = next.min(most);
        }
        // At the largest possible size the effect is not detected.
        let left = self.scan.left(&change(size)?);
        Ok((size < most || left >= least).then_some(size))
    }
}
