//! Arguments of `record`, `stop`, `status` and `devices`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

use super::shared::JsonArg;
use super::values::{Device, celsius, positive};
use crate::output::Target;

/// Emergency stop: ramp a device to rest and keep it there
///
/// The device ramps to rest at the slew limit of its run. It starts again only after its fault is cleared (stop --clear
/// or run --clear). A serial port that another program uses cannot be opened: press Ctrl-C in that program. A CAN bus
/// and the socket of a simulator accept both programs.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl stop --daq can:can0")]
pub(crate) struct StopArgs {
    /// Device, as for run
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    /// Clear the fault of a device at rest, so that it can start again; nothing moves
    #[arg(long)]
    pub(crate) clear: bool,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Show the state of a device: at rest, running, or stopped by a fault
///
/// Nothing moves, and a run of another program continues.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl status --daq serial:/dev/ttyACM0")]
pub(crate) struct StatusArgs {
    /// Device, as for run
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Record the sensors of a device at rest
///
/// Nothing moves. The record shows noise, drift and vibrations of the bench, and the temperature if it is measured.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl record --daq serial:/dev/ttyACM0 --seconds 60 -o rest.csv")]
pub(crate) struct RecordArgs {
    /// Device, as for run
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    /// Duration
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) seconds: f64,
    /// Sample rate; 1000 if not given, within the range of the device
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) rate: Option<f64>,
    /// Record to write (CSV); - for stdout
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Option<Target>,
    /// Log to write during the recording (MCAP)
    #[arg(long, value_name = "MCAP")]
    pub(crate) log: Option<PathBuf>,
    /// Maximum temperature: above it the recording ends
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) hottest: Option<f64>,
    /// Stream the samples to Foxglove or Lichtblick, which connect to this address over a WebSocket; 127.0.0.1:8765 if
    /// no address is given
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub(crate) live: Option<SocketAddr>,
    /// Show a progress bar in the terminal instead of a plot of the last seconds
    #[arg(long)]
    pub(crate) plain: bool,
    /// Seed of the noise of a simulated plant; from its file if not given
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub(crate) seed: Option<u64>,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// List the serial ports and CAN interfaces at which a device may be connected
///
/// Nothing is sent and nothing moves.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl devices")]
pub(crate) struct DevicesArgs {
    #[command(flatten)]
    pub(crate) json: JsonArg,
}
