//! Arguments of `fit`.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use hyst_ident::model::Kind;

use super::help::{FIT, RECORDS};
use super::search::SearchArgs;
use super::shared::{JsonArg, MapArg, ZeroArg};
use crate::output::Target;

/// Fit a hysteresis model to one or more records
#[derive(Debug, Args)]
#[command(after_help = format!("{FIT}\n\n{RECORDS}"))]
pub(crate) struct FitArgs {
    /// Records to fit; several records are fitted together
    #[arg(required = true)]
    pub(crate) train: Vec<PathBuf>,
    /// Kind of model; for dpm give records of slow and of fast drives
    #[arg(long, value_name = "KIND", value_parser = kinds())]
    pub(crate) model: Kind,
    /// Data that a preisach model is fitted to: all rows by least squares (rows), or the Everett surface measured by first-order
    /// descent curves (fod); dpm detects such curves without this option
    #[arg(long, value_name = "rows|fod", value_enum, hide_possible_values = true)]
    pub(crate) from: Option<FitFrom>,
    /// Refuse a measured surface that is not monotone; without this option the nearest monotone surface replaces it
    #[arg(long, requires = "from")]
    pub(crate) as_measured: bool,
    /// Model file to write; - for stdout
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: Target,
    /// Table of the search to write (CSV): one row for each generation of each trial
    #[arg(long, value_name = "CSV")]
    pub(crate) trace: Option<Target>,
    /// Picture of the search to write, .svg or .png
    #[arg(long, value_name = "PICTURE")]
    pub(crate) picture: Option<Target>,
    #[command(flatten)]
    pub(crate) search: SearchArgs,
    #[command(flatten)]
    pub(crate) zero: ZeroArg,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Data that a Preisach model is identified from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FitFrom {
    /// All rows, by least squares
    Rows,
    /// The falling flanks of first-order descent curves
    Fod,
}

fn kinds() -> impl TypedValueParser<Value = Kind> {
    PossibleValuesParser::new(Kind::ALL.map(Kind::name)).try_map(|name| name.parse::<Kind>())
}
