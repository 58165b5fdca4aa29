//! Arguments of `simulate` and `force`.

use std::path::PathBuf;

use clap::Args;

use super::help::{RECORDS, SIMULATE};
use super::shared::{JsonArg, MapArg, TemperatureArg, ZeroArg};
use super::values::{positive, seconds};
use crate::output::Target;

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
