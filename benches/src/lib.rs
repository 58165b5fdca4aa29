//! Shared code of the benches: tasks with known parameters, clocks, an echo device.

pub mod clock;
pub mod echo;
pub mod task;
