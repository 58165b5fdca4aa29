//! Identifies Preisach models from designed experiments.
//!
//! A first-order descent curve rises from the lowest input to α and falls back. Its falling flank is the Everett
//! function, `E(α, β) = f_α − f_αβ` (Schirrer et al., eq. 2, with the sign of [`hyst_core::Everett`]). `peaks.rs` finds
//! such curves in a record, `flank.rs` reads one curve at an input, `reader.rs` reads a family of curves on a grid,
//! `surface.rs` averages families over peak durations, `breach.rs` finds where the result is not an Everett surface,
//! `nearest.rs` finds the nearest Everett surface, and `fod.rs` builds a model of it.
//!
//! `mirror.rs` identifies the mirror function of the dynamic model from records at several rates, and `dpm.rs` builds a
//! model of both parts.

mod breach;
mod dpm;
mod flank;
mod fod;
mod mirror;
mod nearest;
mod nodes;
mod peaks;
mod reader;
mod surface;
#[cfg(test)]
mod tests;

pub use crate::error::EverettError;
pub use breach::{Breach, BreachRule};
pub use dpm::{ClassicalPart, DpmFit, DpmReport, MirrorNode, fit_dpm};
pub use fod::{FodFit, FodOptions, FodReport, fit_fod, shows_only_curves};
pub use nearest::Moved;
pub use peaks::{Family, PeakShape};
pub use surface::Surface;
