//! Identification of models by search: a global search, a local refinement, and an estimate of how well the record
//! determines the parameters.
//!
//! A model's output is linear in most of its parameters. A family declares which: those are solved for at every trial
//! of the others (variable projection, Golub & Pereyra 1973), so only the others are searched. A Bouc-Wen model with
//! five parameters becomes a search in three variables, an activation-function model a search in one.
//!
//! - `family.rs`: the interface of a model for identification; `families/`: one file for each model.
//! - `projection.rs`: the linear parameters for trial values of the others, and the remaining error.
//! - `polish.rs`: Levenberg-Marquardt on the projected residual, from the result of the global search.
//! - `profile.rs`: the interval of a searched variable that the record allows.
//! - `slopes.rs`: derivatives of the output with respect to the unknowns, and from them the errors of the file's
//!   parameters.
//! - `convex.rs`: the same from the normal equations of a fit without a search.
//! - `uncertainty.rs`: standard errors and correlations at the optimum, and the names of undetermined parameters.
//! - `search.rs`: the whole sequence.

pub(crate) mod convex;
pub(crate) mod families;
mod family;
mod polish;
mod profile;
mod projection;
mod search;
mod slopes;
#[cfg(test)]
mod tests;
mod uncertainty;

pub use convex::{TableEstimate, TableOf};
pub(crate) use families::family_of;
pub use families::{Form, UnknownForm};
pub(crate) use family::{Family, Linear, OtherParameter, largest_input};
pub(crate) use search::{Identification, Located, SearchOptions};
pub(crate) use slopes::{Ended, parameters_of};
pub(crate) use uncertainty::Noise;
pub use uncertainty::{Determined, Estimate, Parameter, TradeOff};
