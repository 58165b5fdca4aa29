//! Arguments of `learn`.

use std::path::PathBuf;

use clap::Args;

use super::help::LEARN;
use super::values::{celsius, positive, seconds};
use super::{DEVICE, Device, JsonArg, LimitArgs, MapArg, RunArgs, TemperatureArg};
use crate::cli::Control;
use crate::output::Target;

/// Improve the drive of a reference that repeats, pass by pass, by what is measured while it plays
///
/// The first pass plays the drive of the model's inverse. Each further pass corrects it by the error that repeats; what differs between two plays of the
/// same drive (noise, creep, drift) is not learned. It ends when the error is that of playing the same drive again, when passes bring
/// nothing more or are worse, or after the last pass. The best drive is written. What the model had wrong is then diagnosed.
#[derive(Debug, Args)]
#[command(after_help = LEARN)]
pub(crate) struct LearnArgs {
    // Not a comment for the documentation: it would take the brackets for links.
    #[arg(long, value_name = "DEVICE", help = DEVICE)]
    pub(crate) daq: Device,
    /// Model file
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Record of the wanted output, one segment, - for stdin; or FORM:LOW,HIGH,HZ,SECONDS, with sine, triangle, steps, raster, spiral, spiral-y or lissajous
    #[arg(long)]
    pub(crate) reference: PathBuf,
    /// Drive to write (CSV): the best one, with the reference held for a while before and behind it
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Target,
    /// Most passes
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=50))]
    pub(crate) passes: u32,
    /// Plays of the same drive in a pass, besides a first one that is not looked at: the actuator still remembers other drives in it
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(2..=20))]
    pub(crate) plays: u32,
    /// Folder for a log of each pass (MCAP), empty or new
    #[arg(long, value_name = "FOLDER")]
    pub(crate) logs: Option<PathBuf>,
    /// Model file to write: with the effects that the passes show and the model lacks
    #[arg(long, value_name = "MODEL")]
    pub(crate) extended: Option<Target>,
    #[command(flatten)]
    pub(crate) temperature: TemperatureArg,
    #[command(flatten)]
    pub(crate) limits: LimitArgs,
    /// End it and come to rest when the output is further than this from the reference for half a second, or a quarter of a reference that is shorter than two [output unit]
    #[arg(long, value_name = "Y", value_parser = positive)]
    pub(crate) max_error: Option<f64>,
    /// End it and come to rest above this temperature
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) hottest: Option<f64>,
    /// Silence of this computer after which a device comes to rest by itself; 0.5 if not given
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) silence: Option<f64>,
    /// Clear the fault with which the device has ended an earlier run
    #[arg(long)]
    pub(crate) clear: bool,
    /// Show a bar on a terminal instead of a picture of the last seconds
    #[arg(long)]
    pub(crate) plain: bool,
    /// Hold at the first value of the drive before it begins; 2 if not given
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) settle: Option<f64>,
    /// Rest between two plays
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) rest: f64,
    /// Seed of a simulated plant's noise; that of its file if not given
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub(crate) seed: Option<u64>,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

impl LearnArgs {
    /// The run of the first pass.
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
