//! A fitted model: chain stages with parameters and units, independent of the sample period.

pub mod activation;
pub mod capacity;
mod effects;
mod file;
mod fitted;
mod given;
mod operator;
mod stages;
mod units;

pub use effects::{CreepBank, Effect, Effects, Widening};
pub use file::{ModelError, SCHEMA};
pub use fitted::{Channel, FittedOn, Model, ZERO};
pub use given::Ends;
pub use hyst_core::Kind;
pub use operator::{Base, Compensator, HostChain, InverseState, Operator, OperatorInverse, OperatorState, searchable};

pub(crate) use effects::{InputSide, creep_share};
pub(crate) use fitted::unit_of;
pub(crate) use operator::{DEFAULT_DEGC as TEMPERATURE_OF_INVERSE, searched_range};
