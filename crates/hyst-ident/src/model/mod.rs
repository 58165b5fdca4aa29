//! A fitted model: chain stages with parameters and units, independent of the sample period.

mod effects;
mod file;
mod operator;

pub use effects::{CreepBank, Effect, Effects};
pub use file::{Channel, FittedOn, Model, ModelError, SCHEMA};
pub use operator::{AnyOperator, Base, Compensator, HostChain, Kind, NODES, Operator, OperatorInverse, PreisachSpec};

pub(crate) use effects::Parameter;
pub(crate) use operator::{CREEP, OperatorState, TAPS, cell_index};
