//! Arguments of `compensate`.

use std::path::PathBuf;

use clap::Args;

use super::help::COMPENSATE;
use super::shared::{JsonArg, LimitArgs, MapArg, TemperatureArg};
use crate::output::Target;

/// Compute the drive that makes an actuator follow a reference
///
/// The reference has time_s and the model's output column, and temperature_degc if the model needs it. The drive file
/// has the reference's columns, then the computed input. Limited rows are reported on stderr. Nothing moves.
#[derive(Debug, Args)]
#[command(after_help = COMPENSATE)]
pub(crate) struct CompensateArgs {
    /// Model file
    #[arg(long)]
    pub(crate) model: PathBuf,
    /// Reference: record of the wanted output, or FORM:LOW,HIGH,HZ,SECONDS at the sample rate of the model's record;
    /// FORM is sine, triangle, steps, raster, spiral, spiral-y or lissajous
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
