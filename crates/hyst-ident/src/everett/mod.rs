//! Preisach models from designed experiments instead of from whatever a record holds.
//!
//! A first-order descent curve rises from the lowest input to α and falls back; its falling flank is the Everett function
//! itself, `E(α, β) = f_α − f_αβ` (Schirrer et al., eq. 2, counted as [`hyst_core::Everett`] counts). `peaks.rs` finds such
//! curves in a record, `flank.rs` reads one of them at an input and `reader.rs` a family of them on a
//! grid, `surface.rs` averages families over peak durations, `breach.rs`
//! says where the result is no Everett surface, `nearest.rs` finds the nearest one that is, `fod.rs` makes a model of it.
//!
//! `mirror.rs` identifies the mirror function of the dynamic model from records at several rates, `dpm.rs` makes a model of
//! both parts.

mod breach;
mod dpm;
mod flank;
mod fod;
mod mirror;
mod nearest;
mod peaks;
mod reader;
mod surface;
#[cfg(test)]
mod tests;

pub use breach::{Breach, BreachRule};
pub use dpm::{ClassicalPart, DpmFit, DpmReport, MirrorNode, fit_dpm};
pub use fod::{FodFit, FodOptions, FodReport, fit_fod, shows_only_curves};
pub use nearest::Moved;
pub use peaks::{Family, PeakShape};
pub use surface::Surface;

/// Why a record gives no Everett surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EverettError {
    /// Not enough first-order descent curves.
    #[error(
        "{record}: {found} of the {needed} first-order descent curves are there that a surface needs at least ({passed_over} excursions of the input are none: they turn on the way); drive single peaks of growing height from the lowest input and back, e.g. with `hystctl excite forc`"
    )]
    TooFewCurves {
        /// The record.
        record: String,
        /// Curves of different heights.
        found: usize,
        /// Curves that would do.
        needed: usize,
        /// Excursions from the lowest input that are no such curve.
        passed_over: usize,
    },
    /// A node that no curve shows.
    #[error(
        "{record}: no curve has a row near α = {alpha}, β = {beta} of the grid; sample faster, or let the peaks last longer"
    )]
    Unseen {
        /// The record.
        record: String,
        /// Upper input of the node.
        alpha: f64,
        /// Lower input of the node.
        beta: f64,
    },
    /// The measured surface is no Everett surface and was asked for as it is.
    #[error(
        "{record}: the measured surface falls at {nodes} of its nodes, {beyond} of them by more than 3 standard errors, so no Preisach model has it as it is; leave --as-measured out for the nearest valid surface"
    )]
    NotMonotone {
        /// The record.
        record: String,
        /// Nodes that break a rule, by however little.
        nodes: usize,
        /// Those that break it by more than noise.
        beyond: usize,
    },
    /// Nothing tells how the output depends on the rate.
    #[error(
        "{record}: every segment moves at about the same rate ({slowest:.4} to {fastest:.4} input units/s), so nothing shows how the output depends on it; add records at other rates, each rate in a file or a segment of its own, or fit preisach"
    )]
    OneRate {
        /// The record.
        record: String,
        /// Mean rate of the slowest segment.
        slowest: f64,
        /// Mean rate of the fastest segment.
        fastest: f64,
    },
    /// The quadratic programme had no solution.
    #[error("{record}: no valid surface near the measured one was found; look for rows that are far off the others")]
    Unsolvable {
        /// The record.
        record: String,
    },
}
