//! What the benches share: tasks with a known answer, and clocks.

pub mod clock;
pub mod echo;
pub mod task;
