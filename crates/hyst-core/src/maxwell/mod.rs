//! Maxwell-slip elements, and the temperature-dependent electromechanical model that their current drives.

mod circuit;
mod slip;
mod td_em;

pub use slip::{MaxwellSlip, MaxwellSlipParams, SlipReading};
pub use td_em::{TdEm, TdEmInverse, TdEmInverseState, TdEmParams, TdEmState};
