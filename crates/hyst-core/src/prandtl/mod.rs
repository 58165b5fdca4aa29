//! The Prandtl-Ishlinskii family: weighted sums of play operators.

mod envelope;
mod gpi;
mod pi;
mod td_pi;
mod viscous;

pub use envelope::{Curve, Envelope, EnvelopeInverse, EnvelopeState};
pub use gpi::{Gpi, GpiInverse, GpiInverseState, GpiParams, GpiState};

pub use pi::{Pi, PiParams, PiState};
pub use td_pi::{TdPi, TdPiInverse, TdPiParams, TdPiState};
pub use viscous::{ViscousPi, ViscousPiInverse, ViscousPiInverseState, ViscousPiParams, ViscousPiState};
