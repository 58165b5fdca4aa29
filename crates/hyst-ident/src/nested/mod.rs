//! The whole nested model fitted at once: base weights, zeros and every effect.
//!
//! The base's weights would soak up part of an effect if they were fitted first and kept. So they
//! are never kept: few parameters are searched nonlinearly and at each trial all linear ones (weights,
//! zeros, drift, the amplitude of a tone) are solved again (variable projection; Golub and Pereyra
//! 1973), by damped Gauss-Newton steps.

mod cross_validation;
mod path;
mod problem;

pub(crate) use cross_validation::{cross_validate, folds_interleaved};
pub(crate) use path::SignalPath;
pub(crate) use problem::{Fitted, Problem};
