//! Arguments of `run`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::help::{PLANT, RUN, RUN_USAGE};
use super::shared::{JsonArg, LimitArgs, MapArg, TemperatureArg};
use super::values::{DEVICE_HELP, Device, PidGains, celsius, positive, seconds};
use crate::output::Target;

/// Play a drive, or follow a reference with a model, on a device and record the output
///
/// With --reference the drive is computed before anything moves, as by compensate, and the measured output is compared
/// with the reference. With --drive a file with voltage_v is played unchanged; a drive outside the limits is refused.
/// Only the times and voltages of this file are read. Without --limit the limits are those of the device; with a model
/// they are at most the range that the model was fitted to. Ctrl-C ramps the device to rest.
#[derive(Debug, Args)]
#[command(override_usage = RUN_USAGE, after_help = RUN, after_long_help = format!("{RUN}\n\n{PLANT}"))]
pub(crate) struct RunArgs {
    // `help =` instead of a doc comment: rustdoc reads the brackets as links.
    #[arg(long, value_name = "DEVICE", help = DEVICE_HELP)]
    pub(crate) daq: Device,
    /// Model file
    #[arg(long, requires = "reference", conflicts_with = "drive")]
    pub(crate) model: Option<PathBuf>,
    /// Reference: record of the wanted output, - for stdin; or FORM:LOW,HIGH,HZ,SECONDS, where FORM is sine, triangle,
    /// steps, raster, spiral, spiral-y or lissajous
    #[arg(long, requires = "model", required_unless_present = "drive", conflicts_with = "drive")]
    pub(crate) reference: Option<PathBuf>,
    /// Drive to play: record of voltages, as excite or compensate writes it; - for stdin
    #[arg(long)]
    pub(crate) drive: Option<PathBuf>,
    /// Controller that computes the drive from the reference
    #[arg(long, value_enum, default_value_t = Control::Feedforward, requires = "reference", conflicts_with = "drive")]
    pub(crate) control: Control,
    /// Gains of the PID in V/y, V/(y s) and V s/y, where y is the output unit; from the model if not given
    #[arg(long, value_name = "KP,KI[,KD]", allow_hyphen_values = true, conflicts_with = "drive")]
    pub(crate) pid: Option<PidGains>,
    #[command(flatten)]
    pub(crate) temperature: TemperatureArg,
    /// Log to write during the run (MCAP): all samples of segments and ramps, without the rests between segments
    #[arg(long, value_name = "MCAP")]
    pub(crate) log: Option<PathBuf>,
    /// Record to write after the run (CSV); - for stdout
    #[arg(long, value_name = "CSV")]
    pub(crate) record: Option<Target>,
    #[command(flatten)]
    pub(crate) limits: LimitArgs,
    /// Timeout of the device's watchdog: without a message for this long the device ramps to rest; 0.5 if not given
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) silence: Option<f64>,
    /// Clear the fault of an earlier run before this run
    #[arg(long)]
    pub(crate) clear: bool,
    /// Maximum temperature: above it the run ends and the device ramps to rest
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) hottest: Option<f64>,
    /// Maximum tracking error in the output unit: the run ends and the device ramps to rest if the error is larger for
    /// 0.5 s, or for a quarter of a segment shorter than 2 s. Interruptions shorter than 0.1 s do not reset the timer
    #[arg(long, value_name = "Y", value_parser = positive, conflicts_with = "drive")]
    pub(crate) max_error: Option<f64>,
    /// Exclude one constant delay from the tracking error: the delay with the smallest error is estimated and printed
    #[arg(long, requires = "reference", conflicts_with = "drive")]
    pub(crate) allow_delay: bool,
    /// Adapt the inverse to the actuator during the run, within bounds. With FILE the adaptation of an earlier run
    /// continues and is saved to the same file. The model file does not change
    #[arg(long, value_name = "FILE", num_args = 0..=1, requires = "reference", conflicts_with_all = ["drive", "kout"])]
    pub(crate) adapt: Option<Option<PathBuf>>,
    /// Stiffness of the output in N per output unit: the external force is estimated during the run, relative to the
    /// force at its start. The model must be that of the free actuator
    #[arg(long, value_name = "N_PER_Y", value_parser = positive, requires = "model", conflicts_with = "drive")]
    pub(crate) kout: Option<f64>,
    /// Stream the run to Foxglove or Lichtblick, which connect to this address over a WebSocket; 127.0.0.1:8765 if no
    /// address is given
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub(crate) live: Option<SocketAddr>,
    /// Show a progress bar in the terminal instead of a plot of the last seconds
    #[arg(long)]
    pub(crate) plain: bool,
    /// Time for which the first value is held before each segment, so that creep settles; if not given 2 for a
    /// reference and 0 for a drive
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) settle: Option<f64>,
    /// Seed of the noise of a simulated plant; from its file if not given
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub(crate) seed: Option<u64>,
    /// Rest between segments
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) rest: f64,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Controller that computes the drive of a reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Control {
    /// Straight line through the ends of the range that the model was fitted to: no compensation
    Gain,
    /// Inverse of the model
    #[default]
    Feedforward,
    /// PID on the measured output
    Pid,
    /// Inverse of the model and PID on the measured output
    #[value(name = "pid+feedforward")]
    #[serde(rename = "pid+feedforward")]
    PidFeedforward,
}

impl Control {
    /// Whether the controller uses the model's inverse.
    pub(crate) fn inverts(self) -> bool {
        matches!(self, Self::Feedforward | Self::PidFeedforward)
    }

    /// Whether the controller uses the measured output.
    pub(crate) fn closes(self) -> bool {
        matches!(self, Self::Pid | Self::PidFeedforward)
    }
}
