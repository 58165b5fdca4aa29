//! The Bouc-Wen family: one memory that follows a differential equation in the input.
//!
//! `params.rs` contains the two published forms, `branch.rs` moves the memory along one branch, `operator.rs` is the
//! rate-independent operator with its inverse, `oscillator.rs` the mass-spring-damper with the operator in its
//! feedback.

mod branch;
mod operator;
mod oscillator;
mod params;
#[cfg(test)]
mod tests;

pub use operator::{BoucWen, BoucWenState};
pub use oscillator::{BoucWenOscillator, BoucWenOscillatorParams, BoucWenOscillatorState};
pub use params::{BoucWenClassicParams, BoucWenParams};
