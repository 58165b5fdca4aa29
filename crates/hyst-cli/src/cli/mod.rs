//! The command line: what clap parses, and nothing else.

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

/// Identify, diagnose and compensate piezo actuators and others with hysteresis.
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
        /// The shell
        shell: Shell,
    },
}

/// See the whole way on a simulated actuator: experiment, fit, diagnosis, compensation
///
/// The effect that the actuator has besides hysteresis is drawn from the seed and told to nobody. Writes records,
/// models, findings, the drive, a log of the compensated run and a picture.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl demo --seed 3 --out demo-out")]
pub(crate) struct DemoArgs {
    /// Which actuator
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Folder to write into, empty or from an earlier demo, whose files are replaced
    #[arg(long, value_name = "FOLDER", default_value = "demo-out")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Fit a model of the hysteresis to one or more records
#[derive(Debug, Args)]
#[command(after_help = format!("{FIT}\n\n{RECORDS}"))]
pub(crate) struct FitArgs {
    /// Records to fit, as one
    #[arg(required = true)]
    pub(crate) train: Vec<PathBuf>,
    /// Kind of model; dpm takes records at several rates
    #[arg(long, value_name = "KIND", value_parser = kinds())]
    pub(crate) model: Kind,
    /// What a preisach model is made of: all rows by least squares, or the Everett surface that first-order descent curves
    /// measure (dpm finds such curves by itself)
    #[arg(long, value_name = "rows|fod", value_enum, hide_possible_values = true)]
    pub(crate) from: Option<FitFrom>,
    /// Take the measured surface as it is or not at all; else one that is not monotone is moved to the nearest that is
    #[arg(long, requires = "from")]
    pub(crate) as_measured: bool,
    /// Model file to write; - for stdout
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: Target,
    /// Table of how the search went, to write: every generation of every trial (CSV)
    #[arg(long, value_name = "CSV")]
    pub(crate) trace: Option<Target>,
    /// Picture of how the search went, to write, .svg or .png
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

/// What a Preisach model is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FitFrom {
    /// All rows, by least squares
    Rows,
    /// The falling flanks of first-order descent curves
    Fod,
}

/// Write a model's parameters for a board
///
/// postcard is a versioned, check-summed block of bytes that firmware loads without heap (`hyst_core::read_block`); rust
/// is source with constants for `hyst-core`; c is a C99 header with the block and every parameter with its unit. None of
/// them depends on a sample period.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  hystctl export extended.json --format postcard -o model.bin\n  \
    hystctl export extended.json --format c --name x_axis -o x_axis.h")]
pub(crate) struct ExportArgs {
    /// Model file
    pub(crate) model: PathBuf,
    /// What to write
    #[arg(long, value_enum)]
    pub(crate) format: ExportFormat,
    /// What the symbols of a C header begin with, so that a program can have two models; hyst if not given
    #[arg(long)]
    pub(crate) name: Option<CName>,
    /// File to write; stdout if not given
    #[arg(short, long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) output: Target,
}

/// Form of an exported model.
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
/// Writes the record's own columns untouched, then predicted_um (or _nm, _mm, _n) and settling (1 marks a start-up row
/// of the model). Where the record has the output too, the errors are printed to stderr.
#[derive(Debug, Args)]
#[command(after_help = format!("{SIMULATE}\n\n{RECORDS}"))]
pub(crate) struct SimulateArgs {
    /// Model file
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Record with the input; its output is compared, if it has one
    pub(crate) input: PathBuf,
    /// Take each segment as one period of a steady state: it is passed twice through the model, and the second pass counts
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
/// What a model of the free actuator does not explain of the measured displacement, times the output's stiffness; the record's columns are kept,
/// and estimated_force_n is added. Where the record has load_n, the estimate is compared with it.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  hystctl force --model free.json record.csv --kout 1.08 --free-until 2 -o force.csv"
)]
pub(crate) struct ForceArgs {
    /// Model of the actuator without a force
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Record with input and output
    pub(crate) record: PathBuf,
    /// Stiffness of the output, in N per output unit; that of the model's compliance if not given
    #[arg(long, value_name = "N_PER_UNIT", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) kout: Option<f64>,
    /// Record without a force, of the same day: gain and zero of the model are corrected by it
    #[arg(long, value_name = "RECORD", conflicts_with = "free_until")]
    pub(crate) free: Option<PathBuf>,
    /// The same from the beginning of the record itself, as long as no force acts there
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

/// Find out which effects a model lacks, name them and add them
///
/// Effects are searched on the training records alone; the test record is only simulated.
#[derive(Debug, Args)]
#[command(after_help = DIAGNOSE)]
pub(crate) struct DiagnoseArgs {
    /// Records that the model was fitted to
    #[arg(required = true)]
    pub(crate) train: Vec<PathBuf>,
    /// Record to show the errors on, never fitted
    #[arg(long)]
    pub(crate) test: Option<PathBuf>,
    /// Model file; `auto` fits pi or preisach to the records, whichever explains them better
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Model file to write, with the effects that were found; - for stdout
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: Option<Target>,
    /// Findings file to write (JSON); - for stdout
    #[arg(long, value_name = "JSON")]
    pub(crate) findings: Option<Target>,
    /// Report to write: one page with the evidence in plots, to read, check and hand on (HTML); - for stdout
    #[arg(long, value_name = "HTML")]
    pub(crate) report: Option<Target>,
    /// Seed of the bootstrap that judges effects
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) zero: ZeroArg,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Fit and diagnose many actuators: a row of results each, and a page that shows them together
///
/// Every record is one actuator, as a file of a folder or a line of a list. What is done is kept in a journal beside the results as it comes, so
/// that the same command continues where it was ended, by whatever; files that have changed are done again. A record that
/// cannot be read or fitted is a row with the reason.
#[derive(Debug, Args)]
#[command(after_help = FLEET)]
pub(crate) struct FleetArgs {
    /// Folder of records, or a list of them: a path in each line, or a CSV table with the column file and, as it has them, test, serial and date
    #[arg(value_name = "DIR|LIST")]
    pub(crate) records: PathBuf,
    /// Results to write (Parquet): errors, effects, probabilities, parameters with standard errors
    #[arg(short, long, value_name = "PARQUET")]
    pub(crate) output: PathBuf,
    /// Page to write: effects, control charts of parameters, what stands out, what failed (HTML)
    #[arg(long, value_name = "HTML")]
    pub(crate) page: Option<PathBuf>,
    /// Folder for the report of each actuator
    #[arg(long, value_name = "DIR")]
    pub(crate) reports: Option<PathBuf>,
    /// Kind of the model that is fitted; `auto` takes pi or preisach, whichever explains a record better
    #[arg(long, default_value = "auto", value_name = "KIND")]
    pub(crate) model: String,
    /// Actuators at a time; one for each core if not given
    #[arg(long, value_name = "COUNT")]
    pub(crate) jobs: Option<usize>,
    /// Seed of the bootstrap that judges effects
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
/// The reference has time_s and the model's output column, and temperature_degc where the model needs it. The drive has
/// the reference's columns, then the computed input. What was limited is told on stderr. Nothing is moved.
#[derive(Debug, Args)]
#[command(after_help = COMPENSATE)]
pub(crate) struct CompensateArgs {
    /// Model file
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Record of the wanted output, or FORM:LOW,HIGH,HZ,SECONDS with sine, triangle, steps, raster, spiral, spiral-y or lissajous, at the rate of the model's record
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

/// Play a drive, or a reference through a model, on a device and record what it does
///
/// With --reference the drive is computed before anything moves, as by compensate, and the measured output is compared
/// with the reference. With --drive a file with voltage_v is played as it stands; a drive outside the limits is refused.
/// Limits that are not given are the device's, and with a model no wider than the record that it was fitted to. Ctrl-C
/// ramps the device to rest. A record or log that is there already is kept: its name gets the ending .~1~, or the
/// next free number.
#[derive(Debug, Args)]
#[command(override_usage = RUN_USAGE, after_help = RUN, after_long_help = format!("{RUN}\n\n{PLANT}"))]
pub(crate) struct RunArgs {
    // Not a comment for the documentation: it would take the brackets for links.
    #[arg(long, value_name = "DEVICE", help = DEVICE)]
    pub(crate) daq: Device,
    /// Model file
    #[arg(long, requires = "reference", conflicts_with = "drive")]
    pub(crate) model: Option<PathBuf>,
    /// Record of the wanted output, - for stdin; or FORM:LOW,HIGH,HZ,SECONDS, with sine, triangle, steps, raster, spiral, spiral-y or lissajous
    #[arg(long, requires = "model", required_unless_present = "drive", conflicts_with = "drive")]
    pub(crate) reference: Option<PathBuf>,
    /// Record of the voltages to play, as excite or compensate writes it; - for stdin
    #[arg(long)]
    pub(crate) drive: Option<PathBuf>,
    /// What makes the drive of the reference
    #[arg(long, value_enum, default_value_t = Control::Feedforward, requires = "reference", conflicts_with = "drive")]
    pub(crate) control: Control,
    /// Gains of the PID: V per output unit, V per output unit and second, V s per output unit; from the model if not given
    #[arg(long, value_name = "KP,KI[,KD]", allow_hyphen_values = true, conflicts_with = "drive")]
    pub(crate) pid: Option<PidGains>,
    #[command(flatten)]
    pub(crate) temperature: TemperatureArg,
    /// Log to write while the device runs (MCAP): all samples but those of rests between segments, ramps included
    #[arg(long, value_name = "MCAP")]
    pub(crate) log: Option<PathBuf>,
    /// Record to write when all is measured (CSV); - for stdout
    #[arg(long, value_name = "CSV")]
    pub(crate) record: Option<Target>,
    #[command(flatten)]
    pub(crate) limits: LimitArgs,
    /// Silence of this computer after which a device comes to rest by itself; 0.5 if not given
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) silence: Option<f64>,
    /// Clear the fault with which the device has ended an earlier run
    #[arg(long)]
    pub(crate) clear: bool,
    /// End the run and come to rest above this temperature
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) hottest: Option<f64>,
    /// End the run and come to rest when the output is further than this from the reference for half a second, or a quarter of a segment that is shorter than two; breaks of a tenth of a second are no end [output unit]
    #[arg(long, value_name = "Y", value_parser = positive, conflicts_with = "drive")]
    pub(crate) max_error: Option<f64>,
    /// Compare the output with the reference as late as it is: one delay, the one with the least error, does not count as an error. It is printed
    #[arg(long, requires = "reference", conflicts_with = "drive")]
    pub(crate) allow_delay: bool,
    /// Keep up with the actuator: correct what the inverse aims at by what is measured while it moves, within bounds. With FILE, continue from what an
    /// earlier run has left there and leave it there again; the model stays as it is
    #[arg(long, value_name = "FILE", num_args = 0..=1, requires = "reference", conflicts_with_all = ["drive", "kout"])]
    pub(crate) adapt: Option<Option<PathBuf>>,
    /// Stiffness of the output: estimate the external force while the device runs, from a model of the free actuator. It is counted from what acts when the run begins [N per output unit]
    #[arg(long, value_name = "N_PER_Y", value_parser = positive, requires = "model")]
    pub(crate) kout: Option<f64>,
    /// Show the run while it goes on in Foxglove or Lichtblick, which connect over a WebSocket to this address; 127.0.0.1:8765 if none is given
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub(crate) live: Option<SocketAddr>,
    /// Show a bar on a terminal instead of a picture of the last seconds
    #[arg(long)]
    pub(crate) plain: bool,
    /// Hold at the first value before a segment begins; 2 for a reference and 0 for a drive if not given. A model takes the actuator as
    /// settled there, and creep takes its time
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) settle: Option<f64>,
    /// Seed of a simulated plant's noise, so that a second record has another one; that of its file if not given
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub(crate) seed: Option<u64>,
    /// Rest between two segments
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) rest: f64,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

const DEVICE: &str = "Device: sim:PLANT.toml (the simulated actuator that the file describes), serial:PORT[@BAUD], slcan:PORT[@BITS_PER_S], can:INTERFACE[,fd] or tcp:HOST:PORT";

/// Emergency stop: whatever a device does, let it come to rest and stay there
///
/// The device ramps to rest at the slew limit of its run, and starts again only once that is cleared (run --clear). A serial port that another
/// program holds cannot be reached so: press Ctrl-C there. On a CAN bus, and at the socket of a simulator, there is room for both.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl stop --daq can:can0")]
pub(crate) struct StopArgs {
    /// Device, as for run
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    /// Clear the fault of a device that has come to rest, so that it can be started again; nothing moves by that
    #[arg(long)]
    pub(crate) clear: bool,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Ask a device how it stands: at rest, running, or with which fault
///
/// Nothing moves, and a run of another program goes on.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl status --daq serial:/dev/ttyACM0")]
pub(crate) struct StatusArgs {
    /// Device, as for run
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Record what the sensors show while nothing moves
///
/// The device stays at rest: noise, drift and what shakes the bench can be seen, and a thermometer can be read.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl record --daq serial:/dev/ttyACM0 --seconds 60 -o rest.csv")]
pub(crate) struct RecordArgs {
    /// Device, as for run
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    /// How long
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) seconds: f64,
    /// Samples a second; 1000 if not given, as far as the device goes along
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) rate: Option<f64>,
    /// Record to write (CSV); - for stdout
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Option<Target>,
    /// Log to write while it lasts (MCAP)
    #[arg(long, value_name = "MCAP")]
    pub(crate) log: Option<PathBuf>,
    /// End above this temperature
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) hottest: Option<f64>,
    /// Show the run while it goes on in Foxglove or Lichtblick, which connect over a WebSocket to this address; 127.0.0.1:8765 if none is given
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub(crate) live: Option<SocketAddr>,
    /// Show a bar on a terminal instead of a picture of the last seconds
    #[arg(long)]
    pub(crate) plain: bool,
    /// Seed of a simulated plant's noise; that of its file if not given
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub(crate) seed: Option<u64>,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Look into the log of a run, make a record of it, or recover one that was cut off
///
/// fit, diagnose and the other commands read logs as they read records.
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

/// Say what ran, how long, and whether the log is whole
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl log info run.mcap")]
pub(crate) struct LogInfoArgs {
    /// Log (MCAP)
    pub(crate) log: PathBuf,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Make a record of a log
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl log convert run.mcap -o run.csv")]
pub(crate) struct LogConvertArgs {
    /// Log (MCAP)
    pub(crate) log: PathBuf,
    /// CSV file to write; stdout if not given
    #[arg(short, long, value_name = "CSV", default_value = "-", hide_default_value = true)]
    pub(crate) output: Target,
    /// Ramps before and after each segment too
    #[arg(long)]
    pub(crate) ramps: bool,
}

/// Make a closed log of one that was cut off
///
/// Everything up to the cut is kept: with hystctl's own logs all but the last second.
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

/// What makes the drive of a reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Control {
    /// A straight line through the ends of what the model was fitted to: no compensation
    Gain,
    /// The model's inverse
    #[default]
    Feedforward,
    /// A PID on the measured output
    Pid,
    /// Both
    #[value(name = "pid+feedforward")]
    #[serde(rename = "pid+feedforward")]
    PidFeedforward,
}

impl Control {
    /// Whether the model's inverse takes part.
    pub(crate) fn inverts(self) -> bool {
        matches!(self, Self::Feedforward | Self::PidFeedforward)
    }

    /// Whether the measured output takes part.
    pub(crate) fn closes(self) -> bool {
        matches!(self, Self::Pid | Self::PidFeedforward)
    }
}

/// What keeps a drive in bounds.
#[derive(Clone, Debug, Args)]
pub(crate) struct LimitArgs {
    /// Lowest and highest voltage; if not given, those of the record that the model was fitted to
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub(crate) limit: Option<VoltageLimits>,
    /// Steepest slope of the drive
    #[arg(long, value_name = "V_PER_S", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) slew: Option<f64>,
    /// Band in which lag, delay and resonances are inverted; chosen if not given
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) bandwidth: Option<f64>,
}

#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct TemperatureArg {
    /// Temperature, where the model needs it and the record or reference has no column of it
    #[arg(long = "temperature", value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) degc: Option<f64>,
}

#[derive(Clone, Debug, Args)]
pub(crate) struct MapArg {
    /// Take a column of another name, as voltage_v=Vin, or of the other sign, as displacement_um=-Sensor; a column without a name goes by its number, as time_s=1; may be given several times
    #[arg(long, value_name = "NAME=COLUMN")]
    pub(crate) map: Vec<String>,
    /// Samples a second of a file without times; times that it has are not read
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) rate: Option<f64>,
}

/// Show what a file holds: channels, units, rate, noise, and what may be wrong
///
/// A line for each channel: what the record reads it as (- where it is not read), its unit (? where the file states none), minimum, maximum,
/// resolution (the smallest difference between two values), rows, and rows without a value. `note` is what was done to read the file,
/// `warning` what may be wrong with the data. Ends with the command to type next. Nothing is written.
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

/// Write a file of any format as a record, or as what other programs load
///
/// Units are converted, columns get the names of the record format, and times the even grid that a fit uses.
#[derive(Debug, Args)]
#[command(after_help = format!("Example:\n  hystctl convert scope.txt record.csv --map 'voltage_v=CH1 (V)'\n\n{RECORDS}"))]
pub(crate) struct ConvertArgs {
    /// File to read
    pub(crate) input: PathBuf,
    /// File to write, in the format that its name ends in: .csv, .npy, .mat or .tdms; - for CSV on stdout
    pub(crate) output: Target,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Draw records: loops, time, spectra, and what models miss of them
///
/// Several records are drawn over one another. With --model each record is simulated, and a panel for each model shows measured minus predicted,
/// all on one scale. Nothing is fitted.
#[derive(Debug, Args)]
#[command(after_help = format!("Examples:\n  hystctl plot train.csv -o train.svg\n  hystctl plot test.csv --model pi.json --model extended.json -o compared.svg\n\n{RECORDS}"))]
pub(crate) struct PlotArgs {
    /// Records to draw
    #[arg(required = true)]
    pub(crate) records: Vec<PathBuf>,
    /// Model files to compare with them; may be given several times
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

/// List the serial ports and CAN interfaces at which a device may be
///
/// Nothing is sent and nothing moves: they are only looked at.
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
    /// Zero of the sensor: the model's (none), or one constant for each file (per-record)
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
    fn the_definition_is_sound() {
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
    fn other_devices_and_models_are_refused_with_what_there_is() {
        let message = parse("hystctl run --daq usb:3 --drive u.csv").unwrap_err();
        assert!(message.contains("sim:PLANT.toml"), "{message}");
        let message = parse("hystctl fit a.csv --model preisch -o m.json").unwrap_err();
        assert!(message.contains("pi, preisach"), "{message}");
    }
}
