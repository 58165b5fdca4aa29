//! Many candidates a pass: eight parameter sets of one model run side by side over the record, one in each lane of the processor's
//! vector registers.
//!
//! A [`Kernel`] is a model written for that: no branch depends on a candidate's numbers. The compiler vectorises its loops; `pulp`
//! chooses the instructions at run time. Results are the same bits on every processor: the compiler neither fuses nor reorders operations, and
//! those that are written as fused ([`Lanes::times_plus`]) are rounded once everywhere, by an instruction or without one.
//! The models themselves are those of `hyst-core`; the tests hold the two together.
//!
//! [`Errors`] is the cost of a search over a kernel's parameters: the root mean square error over the rows of a record. It
//! allocates nothing, and gives up on eight candidates as soon as all are worse than they may be.

mod activation;
mod bouc_wen;
mod errors;
mod lanes;
mod pi;
mod td_pi;
#[cfg(test)]
mod tests;

pub use activation::ActivationKernel;
pub use bouc_wen::BoucWenKernel;
pub use errors::{Errors, ErrorsError};
pub use lanes::{LANES, Lanes};
pub use pi::PiKernel;
pub use td_pi::TdPiKernel;

use std::ops::Range;

/// One row as a kernel sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Input \[u\].
    pub input: f64,
    /// Rate of the input over the last sample \[u/s\]; 0 in the first row of a segment.
    pub rate: f64,
    /// Temperature \[°C\].
    pub temperature: f64,
}

/// A model that runs eight candidates side by side.
pub trait Kernel: Sync {
    /// What a pass needs of eight parameter sets.
    type Coefficients;
    /// The histories of eight candidates.
    type State;

    /// Parameters of one candidate.
    fn parameters(&self) -> usize;

    /// From the parameters, one [`Lanes`] each.
    fn coefficients(&self, parameters: &[Lanes]) -> Self::Coefficients;

    /// Virgin memory.
    fn state(&self) -> Self::State;

    /// The outputs at a row; the first one after [`state`](Self::state) is that at rest.
    fn step(&self, c: &Self::Coefficients, s: &mut Self::State, row: &Row) -> Lanes;
}

/// The columns of a record that a pass runs over.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// What drives the model.
    pub rows: &'a [Row],
    /// What was measured \[y\].
    pub output: &'a [f64],
    /// Rows that count.
    pub counts: &'a [bool],
    /// Stretches between which the device rests.
    pub segments: &'a [Range<usize>],
}

/// The rows of samples: rates from the sample period.
pub fn rows_of(samples: &crate::Samples) -> Vec<Row> {
    let mut rows = Vec::with_capacity(samples.len());
    for (i, segment) in samples.segments.iter().enumerate() {
        for k in segment.clone() {
            let input = samples.input[k];
            let before = if k == segment.start { input } else { samples.input[k - 1] };
            let rate = (input - before) / samples.period_of(i);
            rows.push(Row { input, rate, temperature: samples.env(k).temperature });
        }
    }
    rows
}
