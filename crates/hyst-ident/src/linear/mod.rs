//! Linear models and responses of an actuator in a flexible structure.
//!
//! Such an actuator has hysteresis and a structure with modes (Schirrer, Kozek and Benatzky, paper 2 of
//! docs/models.md). Contents: the frequency response with its coherence ([`response`]); the ARMAX model whose poles are
//! the modes of the structure ([`fit_armax`], [`choose_order`], [`Armax::modes`]; all in one call:
//! [`identify_structure`]); the gain over amplitude and frequency of sines ([`gain_map`]); loops without phase and gain
//! of the structure ([`corrected_loop`]).

mod armax;
mod band;
mod corrected;
mod error;
mod fundamental;
mod periodic;
mod roots;
mod spectrum;
mod structure;
#[cfg(test)]
mod tests;
mod welch;

pub use armax::{
    Armax, ArmaxOptions, Delay, Mode, Order, OrderChoice, OrderRow, Zero, choose_order, estimate_delay, fit_armax,
};
pub use band::{Decimated, band_of, decimate};
pub use corrected::{CorrectedLoop, LoopFigures, corrected_loop};
pub use error::LinearError;
pub use fundamental::{GainPoint, gain_map};
pub use periodic::periodic_response;
pub use spectrum::amplitude_density;
pub use structure::{Structure, StructureOptions, identify_structure};
pub use welch::{FrequencyResponse, Method, ResponseLine, WelchOptions, response};
pub(crate) use welch::{Hann, windows};
