//! Arguments of `diagnose` and `fleet`.

use std::path::PathBuf;

use clap::Args;

use super::help::{DIAGNOSE, FLEET};
use super::shared::{JsonArg, MapArg, ZeroArg};
use crate::output::Target;

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
/// to the results. After an interruption the same command continues. It repeats actuators whose files have changed, and
/// those of another version of hystctl. A record that cannot be read or fitted gets a row with the reason.
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
