//! The errors of one pass, and the reason why learning ended.

use serde::Serialize;

/// The errors of one pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pass {
    /// RMS of reference minus output over all plays \[output unit\].
    pub rmse: f64,
    /// Maximum absolute error \[output unit\].
    pub max_abs: f64,
    /// RMS of the mean error of the plays, without noise: the repeatable part, which can be learned \[output unit\].
    pub repeating: f64,
    /// Repeatability estimated after this pass: RMS difference between plays \[output unit\].
    pub repeatability: f64,
    /// Number of rows at which a limit acted on the drive.
    pub limited_rows: usize,
}

impl Pass {
    /// Returns the error divided by the repeatability; `None` if all plays are equal.
    pub fn over_repeatability(&self) -> Option<f64> {
        (self.repeatability > 0.0).then(|| self.rmse / self.repeatability)
    }
}

/// Reason why learning ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// The error is at the repeatability.
    AtFloor,
    /// The last two passes, or three with worse ones, improved the error by less than 5 %.
    NoGain,
    /// Three passes in a row were worse than the best.
    Worse,
    /// The maximum number of passes was reached.
    Passes,
}
