//! Fits the whole nested model at once: weights of the base, zeros and all effects.
//!
//! If the weights of the base were fitted first and then held, they would take up part of an effect. So a few
//! parameters are searched nonlinearly, and at each trial all linear ones (weights, zeros, drift, the amplitude of a
//! tone) are solved again (variable projection; Golub and Pereyra 1973), with damped Gauss-Newton steps.

mod assembly;
mod bounds;
mod columns;
mod cross_validation;
mod hypothesis;
pub(crate) mod initial;
mod layout;
mod path;
mod probe;
mod problem;
mod projector;
mod sensor;
mod tangent;

pub(crate) use assembly::{dead_zone, hat};
pub(crate) use bounds::{ends_at_a_bound, slopes};
pub(crate) use cross_validation::folds_interleaved;
use hypothesis::Unknown;
pub(crate) use hypothesis::{Cause, Hypothesis};
pub(crate) use layout::{HATS, Layout};
pub(crate) use path::{SignalPath, limit_slope, thermal_state};
pub(crate) use probe::{Probe, Prober};
pub(crate) use problem::{Fitted, Problem};
use projector::Projector;
pub(crate) use sensor::{shown_motion, without_sensor_effects};
