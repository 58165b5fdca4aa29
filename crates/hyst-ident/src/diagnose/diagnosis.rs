//! Options and result of a diagnosis.

use super::evidence::{Breakdown, Picture};
use super::findings::Findings;
use super::probability::Weighed;
use crate::model::Model;
use crate::simulate::Zero;

/// Options of a diagnosis.
#[derive(Clone, Copy, Debug)]
pub struct DiagnoseOptions {
    /// How the sensor's zero is treated.
    pub zero: Zero,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        Self { zero: Zero::None, seed: 1 }
    }
}

/// A diagnosis: the extended model and the findings.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The user's model with every named effect; the unchanged model if there is none.
    pub extended: Model,
    /// The findings with their evidence.
    pub findings: Findings,
    /// Pictures to check by eye: the trace of each named effect, and the whole model before and after.
    pub pictures: Vec<Picture>,
    /// Breakdowns of the remainder by time, drive, branch and frequency.
    pub breakdowns: Vec<Breakdown>,
    /// Named effects and candidates, with the features from which their probability is computed.
    pub weighed: Vec<Weighed>,
}
