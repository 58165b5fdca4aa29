//! A fitted model: chain stages with parameters and units, independent of the sample period.

pub mod activation;
pub mod capacity;
mod effects;
mod file;
mod given;
mod operator;
mod stages;
mod units;

pub use effects::{CreepBank, Effect, Effects, Widening};
pub use file::{Channel, FittedOn, Model, ModelError, SCHEMA, ZERO};
pub use given::Ends;
pub use hyst_core::Kind;
pub use operator::{Base, Compensator, HostChain, InverseState, Operator, OperatorInverse, OperatorState, searchable};

pub(crate) use effects::{InputSide, creep_share};
pub(crate) use operator::{DEFAULT_DEGC as TEMPERATURE_OF_INVERSE, searched_range};
