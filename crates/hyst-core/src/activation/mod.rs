//! The activation-function models: a static curve and a term in the input's rate.
//!
//! `kind.rs` holds the five functions, `operator.rs` the model and the static solve, `causal.rs` the inverse a sample at a
//! time, `anti_causal.rs` the one that runs backwards in time.

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
