//! The activation-function models: a static curve plus a term in the rate of the input.
//!
//! `kind.rs` contains the five functions, `operator.rs` the model and its static solution, `causal.rs` the inverse
//! sample by sample, `anti_causal.rs` the inverse backwards in time.

mod anti_causal;
mod causal;
mod kind;
mod operator;
#[cfg(test)]
mod published;
#[cfg(test)]
mod tests;

pub use anti_causal::{AntiCausal, AntiCausalState};
pub use causal::{ActivationInverse, ActivationInverseState};
pub use kind::ActivationKind;
pub use operator::{Activation, ActivationParams, ActivationState};
