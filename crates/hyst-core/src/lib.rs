//! Hysteresis operators, the actuator chain around them, and their inverses.
//!
//! An actuator is a chain of named stages,
//!
//! ```text
//! u [V] → delay → lag → rate → HYSTERESIS, asymmetry → ×temperature → +creep → ×load
//!   → resonance(s) → saturation → +drift → +interference → y
//! ```
//!
//! Every stage except the hysteresis is the identity plus a correction, so it is optional. The same source runs in
//! firmware, on the command line and in identification, with `f32` or `f64`. It uses no heap and no `unsafe`, and does
//! not panic on any input. Results are bit-identical on all targets: every transcendental function is from `libm`, and
//! every sum has a fixed order.
//!
//! Each stage has three types: **parameters** ([`LagParams`], …: physical quantities in seconds, hertz, 1/K, always
//! `f64`), **coefficients** ([`Lag`], …: for one sample period, built once by the fallible [`Build::build`]) and
//! **state** (the history, one per actuator).
//!
//! | model | folder or file | inverse |
//! |---|---|---|
//! | play and stop | `play.rs` | – |
//! | Prandtl-Ishlinskii, of plays or of stops | `prandtl/pi.rs` | closed form, the same type |
//! | … with envelopes, with temperature | `prandtl/gpi.rs` `prandtl/td_pi.rs` | closed form, also exact at a changing temperature |
//! | … rate-dependent: viscous plays | `prandtl/viscous/` | exact: one pass over the plays, or Newton's method in a bracket |
//! | Preisach as an Everett map | `preisach/operator.rs` | exact, cell by cell; approximate with the inverse surface |
//! | dynamic Preisach | `preisach/dpm/` | search, exact; approximate with the inverse surface |
//! | Maxwell slip | `maxwell/slip.rs` | closed form |
//! | temperature-dependent electromechanical | `maxwell/td_em.rs` | band-limited with preview, then exact |
//! | Bouc-Wen, and the oscillator with it | `bouc_wen/` | search; none for the oscillator |
//! | fractional models, LFDM and IFM | `fractional/` | the recursion solved for the input; IFM only where that is stable |
//! | activation functions | `activation/` | sample by sample, or backwards in time with preview |
//! | delay, lag, resonance | `chain/` | band-limited with preview, `chain/preview.rs` |
//! | creep, asymmetry, temperature, load, saturation | `chain/` | exact |
//! | drift, interference | `chain/` | none: they are in the sensor, not in the motion |
//! | the whole chain | `chain/chain.rs` | `chain/compensator.rs` |
//! | PID, force observer, feedforward with feedback | `control/` | – |
//! | a chain's parameters as a block of bytes | `params/` | – |
//!
//! ```
//! use hyst_core::{Env, Invert, Pi, Stage};
//! let pi = Pi::<f64, 2>::new(0.1, &[10.0, 20.0], &[0.02, 0.01])?;
//! let inverse = pi.invert()?;
//! let (mut forward, mut backward) = (pi.state(), inverse.state());
//! let env = Env::default();
//! for reference in [0.0, 1.0, 4.0, 2.5, 3.0] {
//!     let drive = inverse.step(&mut backward, &env, reference);
//!     let reached = pi.step(&mut forward, &env, drive);
//!     assert!((reached - reference).abs() < 1e-12);
//! }
//! # Ok::<(), hyst_core::Error>(())
//! ```
#![no_std]

#[cfg(test)]
extern crate std;

mod activation;
mod bouc_wen;
mod chain;
mod complex;
mod control;
mod either;
mod error;
mod fractional;
mod maxwell;
mod params;
mod play;
mod prandtl;
mod preisach;
mod real;
mod ring;
mod search;
mod stage;
mod zeros;

pub use activation::*;
pub use bouc_wen::*;
pub use chain::*;
pub use complex::Complex;
pub use control::*;
pub use either::Either;
pub use error::Error;
pub use fractional::*;
pub use maxwell::*;
pub use params::*;
pub use play::{play, stop};
pub use prandtl::*;
pub use preisach::*;
pub use real::Real;
pub use search::{Search, SearchState};
pub use stage::{Build, Env, Invert, Meta, Params, Probe, Sampling, Stage};

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
