//! Arguments of `close-loop`.

use std::path::PathBuf;

use clap::Args;
use hyst_ident::model::Kind;

use super::help::CLOSE_LOOP;
use super::values::{positive, seconds};
use super::{Device, JsonArg};

/// Experiment, fit, diagnose, extend, compensate, measure again, until nothing more is found
///
/// Every turn plays another identification drive, shows how well the model of the turn before predicts it, looks for what that
/// model lacks on all records together, and follows a reference on the device. What an amplifier has not followed is measured anew
/// with a slower drive, and those records alone count. It ends when nothing more is found or after the last turn.
///
/// With --until the experiments are chosen: each one for what the diagnosis of all records before it has left open.
#[derive(Debug, Args)]
#[command(after_help = CLOSE_LOOP)]
pub(crate) struct CloseLoopArgs {
    /// Device: sim:PLANT.toml, the simulated actuator that the file describes
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    /// Base model to begin with: pi or preisach
    #[arg(long, value_name = "KIND", default_value = "pi", value_parser = base)]
    pub(crate) model: Kind,
    /// Most turns; 4 if nothing is given, with --until 12
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=20))]
    pub(crate) turns: Option<u32>,
    /// Choose the experiments: begin with a short one, then play the drive that decides most of what is open per second, until each named
    /// effect has this probability and no effect without a name has 0.5 or more
    #[arg(long, value_name = "PROBABILITY", value_parser = probability)]
    pub(crate) until: Option<f64>,
    /// Time for the chosen experiments in seconds, as 120 or 120s
    #[arg(long, value_name = "SECONDS", default_value = "120", requires = "until", value_parser = duration)]
    pub(crate) within: f64,
    /// Standard error that the best known parameter of each effect is to have, as a share of its value
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, requires = "until", value_parser = positive)]
    pub(crate) precision: f64,
    /// Samples per second
    #[arg(long, value_name = "HZ", default_value_t = 1000.0, value_parser = positive, allow_negative_numbers = true)]
    pub(crate) rate: f64,
    /// Seed of the drives
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Folder to write into, empty or new
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// A probability that can be reached and is worth asking for.
fn probability(text: &str) -> Result<f64, String> {
    let usable = |p: &f64| (0.9..1.0).contains(p);
    text.parse().ok().filter(usable).ok_or_else(|| {
        "it has to be a probability from 0.9, where a diagnosis names an effect, to below 1, as 0.95".to_owned()
    })
}

/// Seconds, with or without their unit.
fn duration(text: &str) -> Result<f64, String> {
    seconds(text.strip_suffix('s').unwrap_or(text))
}

/// A kind that is fitted at once and can be extended.
fn base(text: &str) -> Result<Kind, String> {
    match text.parse::<Kind>() {
        Ok(kind @ (Kind::Pi | Kind::Preisach)) => Ok(kind),
        _ => Err("give pi or preisach".to_owned()),
    }
}
