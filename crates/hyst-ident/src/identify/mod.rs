//! Identification of models by search: global, then local, then honest about what the record determines.
//!
//! A model's output is linear in most of its parameters. A family says in which: those are solved for at every
//! trial of the others (variable projection, Golub & Pereyra 1973), and only the others are searched. So a Bouc-Wen model
//! of five parameters is a search in three, an activation-function model one in a single variable.
//!
//! - `family.rs`: what a model has to say to be identified; `families/`: one file for each.
//! - `projection.rs`: the linear parameters for trial values of the others, and the error that remains.
//! - `polish.rs`: Levenberg-Marquardt on the projected residual, from where the global search ended.
//! - `profile.rs`: how far a searched variable can go before the record objects.
//! - `choice.rs`: where a record calls for plays or slipping elements.
//! - `slopes.rs`: how the output changes with what was searched and solved for, and the file's parameters with it.
//! - `convex.rs`: the same from the normal equations of a fit in which nothing is searched.
//! - `uncertainty.rs`: standard errors and correlations at the optimum; parameters that the record cannot determine, by name.
//! - `search.rs`: all of it in a row.

pub(crate) mod choice;
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
pub use families::{Form, UnknownForm};
pub(crate) use families::{family_of, largest_input};
pub(crate) use family::{Beside, Family, Linear};
pub(crate) use search::{Identification, Located, SearchOptions};
pub(crate) use slopes::{Ended, parameters_of};
pub(crate) use uncertainty::Noise;
pub use uncertainty::{Determined, Estimate, Parameter, TradeOff};
