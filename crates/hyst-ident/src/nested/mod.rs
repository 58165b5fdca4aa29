//! Fits the whole nested model at once: weights of the base, zeros and all effects.
//!
//! If the weights of the base were fitted first and then held, they would take up part of an effect. So a few
//! parameters are searched nonlinearly, and at each trial all linear ones (weights, zeros, drift, the amplitude of a
//! tone) are solved again (variable projection; Golub and Pereyra 1973), with damped Gauss-Newton steps.

mod assembly;
mod bounds;
mod columns;
mod cross_validation;
mod fitted;
mod gauss_newton;
mod hypothesis;
pub(crate) mod initial;
mod jacobian;
mod layout;
mod motion;
mod path;
mod probe;
mod problem;
mod projector;
mod sensor;
mod tangent;
mod wander;

pub(crate) use bounds::{ends_at_a_bound, slopes};
pub(crate) use fitted::Fitted;
pub(crate) use hypothesis::{Cause, Hypothesis};
pub(crate) use layout::Layout;
pub(crate) use motion::dead_zone;
pub(crate) use path::{SignalPath, limit_slope, thermal_state};
pub(crate) use probe::{Probe, Prober};
pub(crate) use problem::Problem;
pub(crate) use sensor::{shown_motion, without_sensor_effects};
pub(crate) use wander::{HATS, hat};
