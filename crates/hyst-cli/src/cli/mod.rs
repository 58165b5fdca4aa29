//! Arguments of all commands, as clap parses them.

mod close_loop;
mod compare;
mod excite;
mod help;
mod learn;
mod linear;
mod search;
mod values;

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use hyst_ident::export::CName;
use hyst_ident::model::Kind;
use hyst_ident::simulate::Zero;
use serde::Serialize;

use crate::output::Target;
pub(crate) use close_loop::CloseLoopArgs;
pub(crate) use compare::CompareArgs;
pub(crate) use excite::{Common, ExciteArgs, ExciteKind, PeakForm, SeparateArgs};
use help::{COMPENSATE, DIAGNOSE, EXAMPLES, FIT, FLEET, PLANT, RECORDS, RUN, RUN_USAGE, SIMULATE};
pub(crate) use learn::LearnArgs;
pub(crate) use linear::{GainArgs, LoopArgs, ResponseArgs};
pub(crate) use search::SearchArgs;
pub(crate) use values::{Device, PidGains, VoltageLimits};
use values::{celsius, positive, seconds};

/// Identify, diagnose and compensate piezo actuators and other actuators with hysteresis.
#[derive(Debug, Parser)]
#[command(name = "hystctl", version = env!("HYST_VERSION"), after_help = EXAMPLES, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Fit(FitArgs),
    Compare(CompareArgs),
    Simulate(SimulateArgs),
    Diagnose(DiagnoseArgs),
    Fleet(FleetArgs),
    CloseLoop(CloseLoopArgs),
    Learn(LearnArgs),
    Compensate(CompensateArgs),
    Excite(ExciteArgs),
    Response(ResponseArgs),
    Gain(GainArgs),
    Loop(LoopArgs),
    Force(ForceArgs),
    Run(RunArgs),
    Record(RecordArgs),
    Stop(StopArgs),
    Status(StatusArgs),
    Devices(DevicesArgs),
    Info(InfoArgs),
    Convert(ConvertArgs),
    Plot(PlotArgs),
    Log(LogArgs),
    Export(ExportArgs),
    Demo(DemoArgs),
    /// Print a completion script for a shell
    #[command(after_help = "Example:\n  hystctl completions bash > /etc/bash_completion.d/hystctl")]
    Completions {
        /// Shell to complete for
        shell: Shell,
    },
}

/// Run all steps on a simulated actuator: experiment, fit, diagnosis, compensation
///
/// The seed chooses the effect that the actuator has besides hysteresis; fit and diagnosis use only the records. Writes
/// records, models, findings, the drive, a log of the compensated run and a picture.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl demo --seed 3 --out demo-out")]
pub(crate) struct DemoArgs {
    /// Seed that chooses the simulated actuator
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Folder to write into: new, empty, or of an earlier demo, whose files are replaced
    #[arg(long, value_name = "FOLDER", default_value = "demo-out")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Fit a hysteresis model to one or more records
#[derive(Debug, Args)]
#[command(after_help = format!("{FIT}\n\n{RECORDS}"))]
pub(crate) struct FitArgs {
    /// Records to fit; several records are fitted together
    #[arg(required = true)]
    pub(crate) train: Vec<PathBuf>,
    /// Kind of model; for dpm give records of slow and of fast drives
    #[arg(long, value_name = "KIND", value_parser = kinds())]
    pub(crate) model: Kind,
    /// Source of a preisach model: all rows by least squares (rows), or the Everett surface measured by first-order
    /// descent curves (fod); dpm detects such curves without this option
    #[arg(long, value_name = "rows|fod", value_enum, hide_possible_values = true)]
    pub(crate) from: Option<FitFrom>,
    /// Refuse a measured surface that is not monotone; without this option the nearest monotone surface replaces it
    #[arg(long, requires = "from")]
    pub(crate) as_measured: bool,
    /// Model file to write; - for stdout
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: Target,
    /// Table of the search to write (CSV): one row for each generation of each trial
    #[arg(long, value_name = "CSV")]
    pub(crate) trace: Option<Target>,
    /// Picture of the search to write, .svg or .png
    #[arg(long, value_name = "PICTURE")]
    pub(crate) picture: Option<Target>,
    #[command(flatten)]
    pub(crate) search: SearchArgs,
    #[command(flatten)]
    pub(crate) zero: ZeroArg,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Data that a Preisach model is identified from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FitFrom {
    /// All rows, by least squares
    Rows,
    /// The falling flanks of first-order descent curves
    Fod,
}

/// Export a model's parameters for firmware
///
/// postcard is a versioned block of bytes with a checksum; firmware loads it without a heap (`hyst_core::read_block`).
/// rust is source code with constants for `hyst-core`. c is a C99 header with the block and every parameter with its
/// unit. No format depends on a sample period.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  hystctl export extended.json --format postcard -o model.bin\n  \
    hystctl export extended.json --format c --name x_axis -o x_axis.h")]
pub(crate) struct ExportArgs {
    /// Model file
    pub(crate) model: PathBuf,
    /// Format to write
    #[arg(long, value_enum)]
    pub(crate) format: ExportFormat,
    /// Prefix of the symbols in a C header; two models in one program need two prefixes; hyst if not given
    #[arg(long)]
    pub(crate) name: Option<CName>,
    /// File to write; stdout if not given
    #[arg(short, long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) output: Target,
}

/// Format of an exported model.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ExportFormat {
    /// A C99 header
    C,
    /// Rust source
    Rust,
    /// A block of bytes
    Postcard,
}

/// Predict the output of a record with a model
///
/// Writes the record's own columns unchanged, then predicted_um (or _nm, _mm, _n) and settling (1 marks a start-up row
/// of the model). If the record has the output, the errors are printed to stderr.
#[derive(Debug, Args)]
#[command(after_help = format!("{SIMULATE}\n\n{RECORDS}"))]
pub(crate) struct SimulateArgs {
    /// Model file
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Record with the input; a measured output is compared with the prediction
    pub(crate) input: PathBuf,
    /// Take each segment as one period of a steady state: the model runs through it twice, and the second pass counts
    #[arg(long)]
    pub(crate) periodic: bool,
    #[command(flatten)]
    pub(crate) temperature: TemperatureArg,
    /// CSV file to write; stdout if not given
    #[arg(short, long, value_name = "CSV", default_value = "-", hide_default_value = true)]
    pub(crate) output: Target,
    #[command(flatten)]
    pub(crate) zero: ZeroArg,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Estimate an external force without a force sensor
///
/// The force is the residual of a model of the free actuator times the stiffness of the output. The file has the
/// record's columns and estimated_force_n. If the record has load_n, the estimate is compared with it.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  hystctl force --model free.json record.csv --kout 1.08 --free-until 2 -o force.csv"
)]
pub(crate) struct ForceArgs {
    /// Model of the free actuator (no external force)
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Record with input and output
    pub(crate) record: PathBuf,
    /// Stiffness of the output in N per output unit; from the model's compliance if not given
    #[arg(long, value_name = "N_PER_UNIT", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) kout: Option<f64>,
    /// Record without a force, of the same day; it corrects gain and zero of the model
    #[arg(long, value_name = "RECORD", conflicts_with = "free_until")]
    pub(crate) free: Option<PathBuf>,
    /// Correct gain and zero of the model by the first SECONDS of the record, in which no force acts
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) free_until: Option<f64>,
    #[command(flatten)]
    pub(crate) temperature: TemperatureArg,
    /// CSV file to write; stdout if not given
    #[arg(short, long, value_name = "CSV", default_value = "-", hide_default_value = true)]
    pub(crate) output: Target,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Find the effects that are missing in a model, name them and add them
///
/// Effects are searched on the training records only; the test record is only simulated.
#[derive(Debug, Args)]
#[command(after_help = DIAGNOSE)]
pub(crate) struct DiagnoseArgs {
    /// Records that the model was fitted to
    #[arg(required = true)]
    pub(crate) train: Vec<PathBuf>,
    /// Test record: its errors are reported, it is never fitted
    #[arg(long)]
    pub(crate) test: Option<PathBuf>,
    /// Model file; `auto` fits pi to the records, or preisach if that predicts them better
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Extended model to write, with the effects that were named; - for stdout
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: Option<Target>,
    /// Findings file to write (JSON); - for stdout
    #[arg(long, value_name = "JSON")]
    pub(crate) findings: Option<Target>,
    /// Report to write (HTML): one self-contained page with tables and plots of the evidence; - for stdout
    #[arg(long, value_name = "HTML")]
    pub(crate) report: Option<Target>,
    /// Seed of the bootstrap that tests the effects
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) zero: ZeroArg,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Fit and diagnose many actuators: one row of results for each, and one page
///
/// Each record is one actuator: a file of a folder or a line of a list. Finished actuators are kept in a journal next
/// to the results. After an interruption the same command continues; it repeats actuators whose files have changed. A
/// record that cannot be read or fitted gets a row with the reason.
#[derive(Debug, Args)]
#[command(after_help = FLEET)]
pub(crate) struct FleetArgs {
    /// Folder of records, or a list: one path per line, or a CSV table with the column file and optionally test, serial
    /// and date
    #[arg(value_name = "DIR|LIST")]
    pub(crate) records: PathBuf,
    /// Results to write (Parquet): errors, effects, probabilities, parameters with standard errors
    #[arg(short, long, value_name = "PARQUET")]
    pub(crate) output: PathBuf,
    /// Page to write (HTML): effects, control charts of parameters, values outside their limits, failed records
    #[arg(long, value_name = "HTML")]
    pub(crate) page: Option<PathBuf>,
    /// Folder for the report of each actuator
    #[arg(long, value_name = "DIR")]
    pub(crate) reports: Option<PathBuf>,
    /// Kind of model to fit; `auto` takes pi, or preisach if that predicts the record better
    #[arg(long, default_value = "auto", value_name = "KIND")]
    pub(crate) model: String,
    /// Actuators processed in parallel; one per core if not given
    #[arg(long, value_name = "COUNT")]
    pub(crate) jobs: Option<usize>,
    /// Seed of the bootstrap that tests the effects
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) zero: ZeroArg,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Compute the drive that makes an actuator follow a reference
///
/// The reference has time_s and the model's output column, and temperature_degc if the model needs it. The drive file
/// has the reference's columns, then the computed input. Limited rows are reported on stderr. Nothing moves.
#[derive(Debug, Args)]
#[command(after_help = COMPENSATE)]
pub(crate) struct CompensateArgs {
    /// Model file
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Reference: record of the wanted output, or FORM:LOW,HIGH,HZ,SECONDS at the sample rate of the model's record;
    /// FORM is sine, triangle, steps, raster, spiral, spiral-y or lissajous
    pub(crate) reference: PathBuf,
    #[command(flatten)]
    pub(crate) temperature: TemperatureArg,
    /// Drive file to write (CSV); - for stdout
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Target,
    #[command(flatten)]
    pub(crate) limits: LimitArgs,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Play a drive, or follow a reference with a model, on a device and record the output
///
/// With --reference the drive is computed before anything moves, as by compensate, and the measured output is compared
/// with the reference. With --drive a file with voltage_v is played unchanged; a drive outside the limits is refused.
/// Without --limit the limits are the device's; with a model they are at most the range that it was fitted to. Ctrl-C
/// ramps the device to rest. An existing record or log is kept: it is renamed with the ending .~1~ or the next free
/// number.
#[derive(Debug, Args)]
#[command(override_usage = RUN_USAGE, after_help = RUN, after_long_help = format!("{RUN}\n\n{PLANT}"))]
pub(crate) struct RunArgs {
    // `help =` instead of a doc comment: rustdoc reads the brackets as links.
    #[arg(long, value_name = "DEVICE", help = DEVICE)]
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
    /// Log to write during the run (MCAP): all samples of segments and ramps, none of the rests between segments
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
    /// End the run and ramp to rest above this temperature
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) hottest: Option<f64>,
    /// End the run and ramp to rest if the tracking error exceeds this for 0.5 s, or for a quarter of a segment shorter
    /// than 2 s; interruptions shorter than 0.1 s do not reset the timer [output unit]
    #[arg(long, value_name = "Y", value_parser = positive, conflicts_with = "drive")]
    pub(crate) max_error: Option<f64>,
    /// Exclude one constant delay from the tracking error: the delay with the smallest error is estimated and printed
    #[arg(long, requires = "reference", conflicts_with = "drive")]
    pub(crate) allow_delay: bool,
    /// Adapt the inverse to the actuator during the run, within bounds; with FILE, continue from the adaptation of an
    /// earlier run and save it there again. The model file does not change
    #[arg(long, value_name = "FILE", num_args = 0..=1, requires = "reference", conflicts_with_all = ["drive", "kout"])]
    pub(crate) adapt: Option<Option<PathBuf>>,
    /// Estimate the external force during the run with this stiffness of the output and a model of the free actuator;
    /// the force is relative to the force at the start of the run [N per output unit]
    #[arg(long, value_name = "N_PER_Y", value_parser = positive, requires = "model")]
    pub(crate) kout: Option<f64>,
    /// Stream the run to Foxglove or Lichtblick, which connect to this address over a WebSocket; 127.0.0.1:8765 if no
    /// address is given
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub(crate) live: Option<SocketAddr>,
    /// Show a progress bar in the terminal instead of a plot of the last seconds
    #[arg(long)]
    pub(crate) plain: bool,
    /// Hold the first value this long before each segment; 2 for a reference and 0 for a drive if not given. The model
    /// assumes a settled actuator, and creep needs time to settle
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

const DEVICE: &str = "Device: sim:PLANT.toml (simulated plant, described by the file), serial:PORT[@BAUD], \
    slcan:PORT[@BITS_PER_S], can:INTERFACE[,fd] or tcp:HOST:PORT";

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
    /// End the recording above this temperature
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

/// Inspect the log of a run, convert it to a record, or recover one that was cut off
///
/// fit, diagnose and the other commands also read logs directly, as they read records.
#[derive(Debug, Args)]
pub(crate) struct LogArgs {
    #[command(subcommand)]
    pub(crate) command: LogCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum LogCommand {
    Info(LogInfoArgs),
    Convert(LogConvertArgs),
    Recover(LogRecoverArgs),
}

/// Show the content of a log, its duration, and whether it was closed
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl log info run.mcap")]
pub(crate) struct LogInfoArgs {
    /// Log (MCAP)
    pub(crate) log: PathBuf,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Convert a log to a record
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl log convert run.mcap -o run.csv")]
pub(crate) struct LogConvertArgs {
    /// Log (MCAP)
    pub(crate) log: PathBuf,
    /// CSV file to write; stdout if not given
    #[arg(short, long, value_name = "CSV", default_value = "-", hide_default_value = true)]
    pub(crate) output: Target,
    /// Include the ramps before and after each segment
    #[arg(long)]
    pub(crate) ramps: bool,
}

/// Make a closed log from one that was cut off
///
/// Everything before the cut is kept. A log of hystctl loses at most the last second.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl log recover run.mcap -o whole.mcap")]
pub(crate) struct LogRecoverArgs {
    /// Log (MCAP)
    pub(crate) log: PathBuf,
    /// Log to write
    #[arg(short, long, value_name = "MCAP")]
    pub(crate) output: Target,
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

/// Limits of a drive.
#[derive(Clone, Debug, Args)]
pub(crate) struct LimitArgs {
    /// Minimum and maximum voltage in V; the range that the model was fitted to if not given
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub(crate) limit: Option<VoltageLimits>,
    /// Maximum slope of the drive
    #[arg(long, value_name = "V_PER_S", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) slew: Option<f64>,
    /// Bandwidth in which lag, delay and resonances are inverted; computed from the model if not given
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) bandwidth: Option<f64>,
}

#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct TemperatureArg {
    /// Constant temperature, if the model needs one and the record or reference has no temperature column
    #[arg(long = "temperature", value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) degc: Option<f64>,
}

#[derive(Clone, Debug, Args)]
pub(crate) struct MapArg {
    /// Read a column of another name (voltage_v=Vin), with the opposite sign (displacement_um=-Sensor), or by its
    /// number (time_s=1); may be given several times
    #[arg(long, value_name = "NAME=COLUMN")]
    pub(crate) map: Vec<String>,
    /// Sample rate of a file without times (times in the file are ignored), or of a reference given as
    /// FORM:LOW,HIGH,HZ,SECONDS
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) rate: Option<f64>,
}

/// Show what a file holds: channels, units, sample rate, noise and possible problems
///
/// Each channel has a line: what the record reads it as (- if it is not read), its unit (? if the file states none),
/// minimum, maximum, resolution (smallest difference between two values), rows, and rows without a value. `note` lines
/// say what was done to read the file, `warning` lines what may be wrong with the data. The last line is the command to
/// type next. Nothing is written.
#[derive(Debug, Args)]
#[command(after_help = format!("Example:\n  hystctl info scan.csv\n\n{RECORDS}"))]
pub(crate) struct InfoArgs {
    /// File to look at
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Convert a file of any readable format to a record or to a format of other programs
///
/// Units are converted, columns get the names of the record format, and the samples are put on an even time grid, as
/// for a fit.
#[derive(Debug, Args)]
#[command(after_help = format!("Example:\n  hystctl convert scope.txt record.csv --map 'voltage_v=CH1 (V)'\n\n{RECORDS}"))]
pub(crate) struct ConvertArgs {
    /// File to read
    pub(crate) input: PathBuf,
    /// File to write; the ending selects the format: .csv, .npy, .mat or .tdms; - for CSV on stdout
    pub(crate) output: Target,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Plot records: loops, time series, spectra, and residuals of models
///
/// Several records are drawn over one another. With --model each record is simulated, and a panel for each model shows
/// the residuals (measured minus predicted), all on one scale. Nothing is fitted.
#[derive(Debug, Args)]
#[command(after_help = format!("Examples:\n  hystctl plot train.csv -o train.svg\n  \
    hystctl plot test.csv --model pi.json --model extended.json -o compared.svg\n\n{RECORDS}"))]
pub(crate) struct PlotArgs {
    /// Records to plot
    #[arg(required = true)]
    pub(crate) records: Vec<PathBuf>,
    /// Model file whose residuals are plotted; may be given several times
    #[arg(long)]
    pub(crate) model: Vec<PathBuf>,
    /// Picture to write, .svg or .png; - for SVG on stdout
    #[arg(short, long, value_name = "PICTURE")]
    pub(crate) output: Target,
    #[command(flatten)]
    pub(crate) zero: ZeroArg,
    #[command(flatten)]
    pub(crate) map: MapArg,
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

#[derive(Clone, Debug, Args)]
pub(crate) struct JsonArg {
    /// Print the report as JSON to stdout
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ZeroArg {
    /// Sensor zero: the model's (none), or one constant for each file (per-record)
    #[arg(long, value_enum, default_value_t = ZeroMode::None, hide_possible_values = true, value_name = "none|per-record")]
    zero: ZeroMode,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ZeroMode {
    None,
    PerRecord,
}

impl ZeroArg {
    pub(crate) fn get(&self) -> Zero {
        match self.zero {
            ZeroMode::None => Zero::None,
            ZeroMode::PerRecord => Zero::PerRecord,
        }
    }
}

fn kinds() -> impl TypedValueParser<Value = Kind> {
    PossibleValuesParser::new(Kind::ALL.map(Kind::name)).try_map(|name| name.parse::<Kind>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn parse(line: &str) -> Result<Command, String> {
        Cli::try_parse_from(line.split(' ')).map(|cli| cli.command).map_err(|error| error.to_string())
    }

    #[test]
    fn clap_accepts_the_definition() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_run_has_either_a_reference_or_a_drive() {
        let run = |rest: &str| parse(&format!("hystctl run --daq sim:p.toml {rest}"));
        run("--drive u.csv").unwrap();
        run("--model m.json --reference r.csv").unwrap();
        for rest in ["--record a.csv", "--reference r.csv", "--model m.json", "--model m.json --drive u.csv"] {
            run(rest).unwrap_err();
        }
        run("--model m.json --reference r.csv --drive u.csv").unwrap_err();
    }

    #[test]
    fn negative_voltages_are_values() {
        let line = "hystctl compensate --model m.json r.csv -o - --limit -20,120";
        let Ok(Command::Compensate(args)) = parse(line) else { panic!("not a compensation") };
        assert_eq!(args.limits.limit, Some(VoltageLimits { low: -20.0, high: 120.0 }));
        assert_eq!(args.output, Target::Stdout);
        parse("hystctl excite sine --frequency 1 --cycles 2 --low -20 --high 50 -o u.csv").unwrap();
    }

    #[test]
    fn unknown_devices_and_models_are_refused_with_the_known_ones() {
        let message = parse("hystctl run --daq usb:3 --drive u.csv").unwrap_err();
        assert!(message.contains("sim:PLANT.toml"), "{message}");
        let message = parse("hystctl fit a.csv --model preisch -o m.json").unwrap_err();
        assert!(message.contains("pi, preisach"), "{message}");
    }
}
