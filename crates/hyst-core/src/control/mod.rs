//! Feedback control, adaptation, force observer, drive limits and residual monitoring.

mod adapt;
mod force;
mod limits;
mod pid;
mod tracking;
mod watch;

pub use adapt::{Adaptation, AdaptationOptions, Adapted};
pub use force::{AffineFit, ForceObservation, ForceObserver, ForceParams};
pub use limits::{Limited, Limits};
pub use pid::{Pid, PidParams, PidState};
pub use tracking::{Tracking, TrackingState};
pub use watch::{Watch, WatchState};
