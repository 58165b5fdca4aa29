//! Arguments of `info`, `convert` and `plot`.

use std::path::PathBuf;

use clap::Args;

use super::help::RECORDS;
use super::shared::{JsonArg, MapArg, ZeroArg};
use crate::output::Target;

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
