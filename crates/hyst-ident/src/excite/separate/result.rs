//! Options and result of a comparison of drives.

use serde::Serialize;

use crate::excite::Drive;

/// Options of [`separate`](super::separate).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparateOptions {
    /// Duration of the record \[s\].
    pub duration_s: f64,
    /// Standard deviation of the sensor noise as a share of the span of the output.
    pub noise: f64,
    /// Whether the record has `temperature_degc`.
    pub thermometer: bool,
    /// Whether the record has `load_n`.
    pub load_cell: bool,
    /// Seed of levels and phases.
    pub seed: u64,
}

impl Default for SeparateOptions {
    fn default() -> Self {
        Self { duration_s: 30.0, noise: 1e-3, thermometer: false, load_cell: false, seed: 1 }
    }
}

/// How well a record separates two effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The part that cannot be imitated is at least as large as the noise (RMS).
    Clear,
    /// It is at least a tenth of the noise: visible in the mean of many rows, if the misfit of the base model is not
    /// larger.
    Faint,
    /// It is smaller for all candidate drives.
    NotByADrive,
}

/// Result of one candidate drive. Values are RMS over the record, as multiples of the sensor noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// Name of the drive.
    pub drive: &'static str,
    /// Part of the first effect that the second cannot imitate.
    pub first_left: f64,
    /// Part of the second effect that the first cannot imitate.
    pub second_left: f64,
}

impl Tried {
    /// Returns the smaller of both, which applies whichever effect is present.
    pub fn left(&self) -> f64 {
        self.first_left.min(self.second_left)
    }
}

/// Result of [`separate`](super::separate).
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// Whether a drive separates the two effects.
    pub verdict: Verdict,
    /// All drives, the best first.
    pub tried: Vec<Tried>,
    /// The best drive.
    pub drive: Drive,
    /// Explanation: how the two effects differ, where to look, and what else to measure.
    pub reason: String,
}
