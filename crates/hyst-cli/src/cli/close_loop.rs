//! Arguments of `close-loop`.

use std::path::PathBuf;

use clap::Args;
use hyst_ident::model::Kind;

use super::help::CLOSE_LOOP;
use super::values::positive;
use super::{Device, JsonArg};

/// Experiment, fit, diagnose, extend, compensate, measure again, until nothing more is found
///
/// Every turn plays another identification drive, shows how well the model of the turn before predicts it, looks for what that
/// model lacks on all records together, and follows a reference on the device. What an amplifier has not followed is measured anew
/// with a slower drive, and those records alone count. It ends when nothing more is found or after the last turn.
#[derive(Debug, Args)]
#[command(after_help = CLOSE_LOOP)]
pub(crate) struct CloseLoopArgs {
    /// Device: sim:PLANT.toml, the simulated actuator that the file describes
    #[arg(long, value_name = "DEVICE")]
    pub(crate) daq: Device,
    /// Base model to begin with: pi or preisach
    #[arg(long, value_name = "KIND", default_value = "pi", value_parser = base)]
    pub(crate) model: Kind,
    /// Most turns
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=20))]
    pub(crate) turns: u32,
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

/// A kind that is fitted at once and can be extended.
fn base(text: &str) -> Result<Kind, String> {
    match text.parse::<Kind>() {
        Ok(kind @ (Kind::Pi | Kind::Preisach)) => Ok(kind),
        _ => Err("give pi or preisach".to_owned()),
    }
}
