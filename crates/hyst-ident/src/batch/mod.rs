//! Many candidates per pass: eight parameter sets of one model run together over the record, one in each lane of the
//! processor's vector registers.
//!
//! A [`Kernel`] is a model written for that: no branch depends on a candidate's values. The compiler vectorises its
//! loops; `pulp` chooses the instructions at run time. Results are identical on every processor: the compiler neither
//! fuses nor reorders operations, and fused operations ([`Lanes::times_plus`]) are rounded once everywhere, with or
//! without an instruction for them. The tests compare the kernels with the models of `hyst-core`.
//!
//! [`Errors`] is the cost of a search over a kernel's parameters: the RMS error over the rows of a record. It allocates
//! nothing, and stops early if all eight candidates exceed their limits.

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

/// One row of a kernel's input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Input \[u\].
    pub input: f64,
    /// Rate of the input over the last sample \[u/s\]; 0 in the first row of a segment.
    pub rate: f64,
    /// Temperature \[°C\].
    pub temperature: f64,
}

/// A model that runs eight candidates together.
pub trait Kernel: Sync {
    /// Coefficients of a pass, computed from eight parameter sets.
    type Coefficients;
    /// States of eight candidates.
    type State;

    /// Returns the number of parameters of one candidate.
    fn parameters(&self) -> usize;

    /// Computes the coefficients from the parameters, one [`Lanes`] each.
    fn coefficients(&self, parameters: &[Lanes]) -> Self::Coefficients;

    /// Returns the state with virgin memory.
    fn state(&self) -> Self::State;

    /// Returns the outputs at a row; the first call after [`state`](Self::state) gives the output at rest.
    fn step(&self, c: &Self::Coefficients, s: &mut Self::State, row: &Row) -> Lanes;
}

/// The columns of a record for a pass.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// Input of the model.
    pub rows: &'a [Row],
    /// Measured output \[y\].
    pub output: &'a [f64],
    /// Rows that count.
    pub counts: &'a [bool],
    /// Segments; the device rests before each.
    pub segments: &'a [Range<usize>],
}

/// Returns the rows of samples, with rates from the sample period.
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
