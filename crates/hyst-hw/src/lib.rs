//! Data acquisition: a trait for devices that drive an actuator and measure it, a runner that is
//! generic over the trait, a simulated actuator, and devices on serial, CAN and TCP lines.
//!
//! - [`Daq`]: starts a sample clock, exchanges drive samples for measurements, rests and stops.
//! - [`record`]: plays drive segments on any [`Daq`] and returns the measured samples.
//! - [`Plant`]: the simulated actuator, described by a [`PlantConfig`] (a TOML file). It has any of the eleven
//!   [`EFFECTS`] and any [`Disturbance`], which is not an effect.
//! - [`Remote`]: a device at the other end of a [`Line`]: a serial port, a CAN bus or a socket.
//! - [`serve()`]: a device in software behind a line, with the plant as its actuator.
//! - [`wire`]: the protocol between host and device, and the device's side of it; `no_std` and without heap, for
//!   firmware.
//!
//! ```
//! use hyst_hw::{record, Plant, PlantConfig, RecordOptions};
//! use std::ops::ControlFlow;
//!
//! let config = PlantConfig::random_with(7, &["creep"])?;
//! let top_v = config.actuator.max_v;
//! let mut plant = Plant::new(config)?;
//! let drive: Vec<f64> = (0..200).map(|k| top_v * f64::from(k) / 200.0).collect();
//! let recording = record(&mut plant, &[drive], &RecordOptions::at(1000.0), |_| ControlFlow::Continue(()))?;
//! assert_eq!(recording.segments[0].samples.len(), 200);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![cfg_attr(not(feature = "std"), no_std)]

pub mod wire;

#[cfg(feature = "std")]
mod daq;
#[cfg(feature = "std")]
mod plant;
#[cfg(feature = "std")]
mod remote;
#[cfg(feature = "std")]
mod runner;
#[cfg(feature = "std")]
mod serve;

#[cfg(feature = "std")]
pub use daq::{Capabilities, ClockFit, Daq, OutputUnit, Sample, VoltageRange};
#[cfg(feature = "std")]
pub use plant::config::{
    Actuator, Asymmetry, Bed, Creep, Delay, Disturbance, Drift, Interference, Lag, Load, LoadShape, Mode, PlantConfig,
    Saturation, Sensor, Temperature, TemperatureShape, Viscosity,
};
#[cfg(feature = "std")]
pub use plant::error::{ConfigError, PlantError};
#[cfg(feature = "std")]
pub use plant::{DISTURBANCES, EFFECTS, Plant};
#[cfg(feature = "std")]
pub use remote::{
    Bus, CanLine, FROM_DEVICE, Interface, Line, OpenError, Port, Remote, RemoteError, RemoteOptions, Serial, Slcan,
    TO_DEVICE, Tcp, interfaces, ports,
};
#[cfg(all(feature = "std", target_os = "linux"))]
pub use remote::{SocketCan, SocketCanError};
#[cfg(feature = "std")]
pub use runner::{
    Cause, Failure, Phase, Progress, RecordOptions, Recording, Revision, SegmentRecord, record, record_with,
};
#[cfg(feature = "std")]
pub use serve::{PlantBoard, serve, serve_at};

/// The examples of the README, as tests.
#[cfg(all(doctest, feature = "std"))]
#[doc = include_str!("../README.md")]
pub struct Readme;
