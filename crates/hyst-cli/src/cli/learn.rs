//! Arguments of `learn`.

use std::path::PathBuf;

use clap::Args;

use super::help::LEARN;
use super::run::{Control, RunArgs};
use super::shared::{JsonArg, LimitArgs, MapArg, TemperatureArg};
use super::values::{DEVICE_HELP, Device, celsius, positive, seconds};
use crate::output::Target;

/// Improve the drive of a repeated reference pass by pass with the measured error (iterative learning)
///
/// The first pass plays the drive of the model's inverse. Each further pass corrects the drive for the error that
/// repeats. Differences between two plays of the same drive (noise, creep, drift) are not learned. Learning ends when
/// the error reaches the repeatability, when passes bring no gain or are worse, or after the last pass. The best drive
/// is written. Then the error of the model is diagnosed.
#[derive(Debug, Args)]
#[command(after_help = LEARN)]
pub(crate) struct LearnArgs {
    // Not a comment for the documentation: it would take the brackets for links.
    #[arg(long, value_name = "DEVICE", help = DEVICE_HELP)]
    pub(crate) daq: Device,
    /// Model file
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Reference: record of the wanted output with one segment, - for stdin; or FORM:LOW,HIGH,HZ,SECONDS, where FORM is
    /// sine, triangle, steps, raster, spiral, spiral-y or lissajous
    #[arg(long)]
    pub(crate) reference: PathBuf,
    /// Drive to write (CSV): the best one; the reference is held for a while before its start and after its end
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Target,
    /// Maximum number of passes
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=50))]
    pub(crate) passes: u32,
    /// Evaluated plays of the same drive in each pass; one more play comes first and is ignored, because it still
    /// depends on earlier drives
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(2..=20))]
    pub(crate) plays: u32,
    /// Folder for a log of each pass (MCAP), empty or new
    #[arg(long, value_name = "FOLDER")]
    pub(crate) logs: Option<PathBuf>,
    /// Extended model to write, with the missing effects that the passes show
    #[arg(long, value_name = "MODEL")]
    pub(crate) extended: Option<Target>,
    #[command(flatten)]
    pub(crate) temperature: TemperatureArg,
    #[command(flatten)]
    pub(crate) limits: LimitArgs,
    /// Maximum tracking error in the output unit: learning ends and the device ramps to rest if the error is larger for
    /// 0.5 s, or for a quarter of a reference shorter than 2 s. Interruptions shorter than 0.1 s do not reset the timer
    #[arg(long, value_name = "Y", value_parser = positive)]
    pub(crate) max_error: Option<f64>,
    /// Maximum temperature: above it learning ends and the device ramps to rest
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) hottest: Option<f64>,
    /// Timeout of the device's watchdog: without a message for this long the device ramps to rest; 0.5 if not given
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) silence: Option<f64>,
    /// Clear the fault of an earlier run before the first pass
    #[arg(long)]
    pub(crate) clear: bool,
    /// Show a progress bar in the terminal instead of a plot of the last seconds
    #[arg(long)]
    pub(crate) plain: bool,
    /// Time for which the first value of the drive is held before each play; 2 if not given
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) settle: Option<f64>,
    /// Rest between plays
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) rest: f64,
    /// Seed of the noise of a simulated plant; from its file if not given
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub(crate) seed: Option<u64>,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

impl LearnArgs {
    /// Arguments of a `run` that plays the first pass.
    pub(crate) fn to_run(&self) -> RunArgs {
        RunArgs {
            daq: self.daq.clone(),
            model: Some(self.model.clone()),
            reference: Some(self.reference.clone()),
            drive: None,
            control: Control::Feedforward,
            pid: None,
            temperature: self.temperature,
            log: None,
            record: None,
            limits: self.limits.clone(),
            silence: self.silence,
            clear: self.clear,
            hottest: self.hottest,
            max_error: self.max_error,
            allow_delay: false,
            adapt: None,
            kout: None,
            live: None,
            plain: self.plain,
            settle: self.settle,
            seed: self.seed,
            rest: self.rest,
            map: self.map.clone(),
            json: self.json.clone(),
        }
    }
}
