//! Values of a run at one time.

use hyst_hw::Sample;

/// Values at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Values {
    pub(super) sample: Sample,
    /// Wanted output \[output unit\].
    pub(super) wanted: Option<f64>,
    /// Output that the model predicts \[output unit\].
    pub(super) predicted: Option<f64>,
    /// Estimated force \[N\].
    pub(super) force: Option<f64>,
}
