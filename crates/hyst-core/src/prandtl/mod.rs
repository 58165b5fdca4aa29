//! The Prandtl-Ishlinskii family: weighted plays.

mod pi;

pub use pi::{Pi, PiParams, PiState};
