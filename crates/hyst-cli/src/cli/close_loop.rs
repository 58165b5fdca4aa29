//! Arguments of `close-loop`.

use std::path::PathBuf;

use clap::Args;
use hyst_ident::model::Kind;

use super::help::CLOSE_LOOP;
use super::shared::JsonArg;
use super::values::{Device, positive, seconds};

/// Repeat experiment, diagnosis and compensation on a simulated plant until no further effect is found
///
/// Each turn plays a new identification drive, reports how well the model of the previous turn predicts it, searches
/// missing effects on all records together, and follows a reference on the device. If the amplifier did not follow a
/// drive, the records are discarded and measured again with a slower drive. The loop ends when no further effect is
/// found or after the last turn.
///
/// With --until each experiment is chosen to decide between effects that all earlier records leave undecided.
#[derive(Debug, Args)]
#[command(after_help = CLOSE_LOOP)]
pub(crate) struct CloseLoopArgs {
    /// Device: sim:PLANT.toml (simulated plant, described by the file)
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    /// Base model of the first turn: pi or preisach
    #[arg(long, value_name = "KIND", default_value = "pi", value_parser = base)]
    pub(crate) model: Kind,
    /// Maximum number of turns; 4 if not given, 12 with --until
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=20))]
    pub(crate) turns: Option<u32>,
    /// Choose the experiments: first a short one, then the drive that decides most per second, until each named effect
    /// has at least this probability and each effect that is not named has less than 0.5
    #[arg(long, value_name = "PROBABILITY", value_parser = probability)]
    pub(crate) until: Option<f64>,
    /// Total time of the chosen experiments in seconds, for example 120 or 120s
    #[arg(long, value_name = "SECONDS", default_value = "120", requires = "until", value_parser = duration)]
    pub(crate) within: f64,
    /// Target standard error of the best known parameter of each effect, as a share of its value
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, requires = "until", value_parser = positive)]
    pub(crate) precision: f64,
    /// Sample rate
    #[arg(long, value_name = "HZ", default_value_t = 1000.0, value_parser = positive, allow_negative_numbers = true)]
    pub(crate) rate: f64,
    /// Seed of the drives
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Folder to write into; new or empty
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Parses a probability from 0.9 to below 1.
fn probability(text: &str) -> Result<f64, String> {
    let usable = |p: &f64| (0.9..1.0).contains(p);
    text.parse()
        .ok()
        .filter(usable)
        .ok_or_else(|| "expected a probability from 0.9 to below 1, for example 0.95".to_owned())
}

/// Parses a time \[s\], with or without the unit `s`.
fn duration(text: &str) -> Result<f64, String> {
    seconds(text.strip_suffix('s').unwrap_or(text))
}

/// Parses the kind of a base model that is fitted without a search and can be extended.
fn base(text: &str) -> Result<Kind, String> {
    match text.parse::<Kind>() {
        Ok(kind @ (Kind::Pi | Kind::Preisach)) => Ok(kind),
        _ => Err("not a base model of close-loop; give pi or preisach".to_owned()),
    }
}
