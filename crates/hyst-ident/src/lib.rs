//! Records, fits, simulation, diagnosis and experiment design for actuators with hysteresis.
//!
//! Processing steps: [`record::Record`] (read and checked) → [`fit::fit`] (a base model) → [`diagnose::diagnose`]
//! (missing effects, named and added) → [`compensate::compensate`] (the drive that makes the actuator follow a
//! reference). [`simulate::simulate`] computes the prediction of a model, [`excite`] designs the drive of an
//! identification experiment, [`learn`] improves the drive for a periodic reference.
//!
//! This crate is independent of devices and terminals: it reports progress to closures and returns results.

pub mod atomic_file;
mod base;
pub mod batch;
pub mod clipping;
pub mod compare;
pub mod compensate;
mod creep_rest;
mod criteria;
pub mod diagnose;
pub mod digits;
mod drive;
mod error;
pub mod everett;
pub mod excite;
pub mod experiment;
pub mod export;
pub mod fit;
pub mod force;
pub mod frozen;
pub mod full_memory;
pub mod identify;
pub mod learn;
pub mod linear;
mod loop_gains;
mod lsq;
mod memory;
pub mod metrics;
pub mod model;
mod nested;
pub mod noise;
pub mod optimize;
pub mod record;
mod repetition;
mod samples;
mod settle;
pub mod simulate;
pub mod spikes;
mod statistics;
pub mod stop;
mod tone_phase;
pub mod tracking;
mod widened;

pub use drive::{BetweenSamples, UnknownBetweenSamples};
pub use loop_gains::{LoopGains, loop_gains};
pub use samples::Samples;
pub use statistics::range;

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
