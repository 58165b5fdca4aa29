//! The whole nested model fitted at once: base weights, zeros and every effect.
//!
//! The base's weights would soak up part of an effect if they were fitted first and kept. So they
//! are never kept: few parameters are searched nonlinearly and at each trial all linear ones (weights,
//! zeros, drift, the amplitude of a tone) are solved again (variable projection; Golub and Pereyra
//! 1973), by damped Gauss-Newton steps.

mod assembly;
mod bounds;
mod columns;
mod cross_validation;
mod hypothesis;
mod layout;
pub(crate) mod owed;
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
pub(crate) use path::{SignalPath, limit_slope, warmth};
pub(crate) use probe::{Probe, Vantage};
pub(crate) use problem::{Fitted, Problem};
use projector::Projector;
pub(crate) use sensor::{shown_motion, without_sensor_effects};
