//! Arguments of `log`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::shared::JsonArg;
use crate::output::Target;

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
/// Everything before the cut is kept. A log of hystctl loses at most the last 0.5 s.
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
