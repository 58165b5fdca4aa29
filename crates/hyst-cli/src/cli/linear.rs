//! Arguments of `response`, `gain` and `loop`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use hyst_ident::linear::Order;

use super::shared::{JsonArg, MapArg};
use super::values::positive;
use crate::output::Target;

const RESPONSE: &str = "\
Examples:
  hystctl excite multisine --to 200 --seconds 40 --periods 10 --high 100 -o u.csv
  hystctl run --daq sim:plant.toml --drive u.csv --record noise.csv
  hystctl response noise.csv -o response.csv --picture response.svg
  hystctl response noise.csv --period 4 --at 10 --at 20

Gain and phase are H1 estimates with Hann windows, half overlapped, or averages over whole periods with --period. Their band is \
the 95 % confidence band. Modes are poles of an ARMAX model; their standard errors hold if its prediction errors are white.";

const GAIN: &str = "\
Examples:
  hystctl excite tones --frequencies 1,5,10,20 --amplitudes 0.25,0.5,1 --high 100 -o u.csv
  hystctl run --daq sim:plant.toml --drive u.csv --record tones.csv
  hystctl gain tones.csv -o gain.csv

A segment of constant amplitude gives one point, averaged over its cycles. A decaying or modulated sine gives one point per cycle.";

const LOOP: &str = "\
Examples:
  hystctl response noise.csv --at 10              # the structure's phase at the drive's frequency: -9.6 deg
  hystctl loop sine.csv --phase -9.6
  hystctl loop inverse.csv --reference reference.csv --phase -9.6

Give the phase of the linear structure, measured with a small drive. The lag of a large sine also contains hysteresis.";

/// Estimate the frequency response with coherence, and the modes of the structure
///
/// If the drive excites only the lower part of the band, the rows are low-pass filtered and decimated before the model
/// is fitted.
#[derive(Debug, Args)]
#[command(after_help = RESPONSE)]
pub(crate) struct ResponseArgs {
    /// Records; several records are evaluated together
    #[arg(required = true)]
    pub(crate) records: Vec<PathBuf>,
    /// Order of the ARMAX model: auto, or a number (2 for each mode)
    #[arg(long, value_name = "auto|N", default_value = "auto")]
    pub(crate) order: OrderArg,
    /// Delay of the input, in rows that the model is fitted to; estimated if not given
    #[arg(long, value_name = "ROWS")]
    pub(crate) delay: Option<usize>,
    /// Highest frequency of the model; the end of the coherent band if not given
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) to: Option<f64>,
    /// Length of the Welch windows; chosen from the record if not given
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true, conflicts_with = "period")]
    pub(crate) window: Option<f64>,
    /// Period of a periodic drive: average over periods instead of Welch windows
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) period: Option<f64>,
    /// Print the model's gain and phase at this frequency; may be given several times
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) at: Vec<f64>,
    /// Response to write (CSV); - for stdout
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Option<Target>,
    /// Picture to write, .svg or .png: gain, phase, coherence
    #[arg(long, value_name = "PICTURE")]
    pub(crate) picture: Option<Target>,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Measure gain and phase of sines over amplitude and frequency
#[derive(Debug, Args)]
#[command(after_help = GAIN)]
pub(crate) struct GainArgs {
    /// Records; several records are evaluated together
    #[arg(required = true)]
    pub(crate) records: Vec<PathBuf>,
    /// Frequency of the drive; the strongest spectral line of each segment if not given
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) frequency: Option<f64>,
    /// Points to write (CSV); - for stdout
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Option<Target>,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Measure width and linearity of a loop, before and after phase and gain of the structure are removed
#[derive(Debug, Args)]
#[command(after_help = LOOP)]
pub(crate) struct LoopArgs {
    /// Record of one sine drive
    pub(crate) record: PathBuf,
    /// Phase of the structure at the frequency of the drive; negative for a lag
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(crate) phase: f64,
    /// Reference with the same rows as the record; the drive of the record if not given
    #[arg(long)]
    pub(crate) reference: Option<PathBuf>,
    /// Frequency of the drive; its strongest spectral line if not given
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) frequency: Option<f64>,
    /// Loop to write (CSV) with columns wanted, measured and straightened; - for stdout
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Option<Target>,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// Order of a model: `auto` or a number.
#[derive(Clone, Debug)]
pub(crate) struct OrderArg(pub(crate) Order);

impl FromStr for OrderArg {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.parse()) {
            ("auto", _) => Ok(Self(Order::default())),
            (_, Ok(order)) => Ok(Self(Order::Fixed(order))),
            _ => Err("expected auto or an integer; give auto, or an order from 1 to 40".to_owned()),
        }
    }
}
