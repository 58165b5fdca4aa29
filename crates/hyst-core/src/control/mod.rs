//! What stands between a model and the actuator: limits of the drive.

mod limits;

pub use limits::{Limited, Limits};
