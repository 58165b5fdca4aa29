//! Arguments of several commands.

use clap::{Args, ValueEnum};
use hyst_ident::simulate::Zero;

use super::values::{VoltageLimits, celsius, positive};

/// Limits of a drive.
#[derive(Clone, Debug, Args)]
pub(crate) struct LimitArgs {
    /// Minimum and maximum voltage in V; the range that the model was fitted to if not given
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub(crate) limit: Option<VoltageLimits>,
    /// Maximum slope of the drive in V/s
    #[arg(long, value_name = "V_PER_S", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) slew: Option<f64>,
    /// Bandwidth in which lag, delay and resonances are inverted; computed from the model if not given
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) bandwidth: Option<f64>,
}

#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct TemperatureArg {
    /// Constant temperature, if the model needs one and the record or reference has no temperature column
    #[arg(long = "temperature", value_name = "DEGC", allow_negative_numbers = true, value_parser = celsius)]
    pub(crate) degc: Option<f64>,
}

#[derive(Clone, Debug, Args)]
pub(crate) struct MapArg {
    /// Read a column of another name (voltage_v=Vin), with a scale (displacement_um=2*Sensor for 2 µm/V), with the
    /// opposite sign (displacement_um=-Sensor), or by its number (time_s=1); may be given several times
    #[arg(long, value_name = "NAME=COLUMN")]
    pub(crate) map: Vec<String>,
    /// Sample rate of a file without times (times in the file are ignored), or of a reference given as
    /// FORM:LOW,HIGH,HZ,SECONDS
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) rate: Option<f64>,
}

#[derive(Clone, Debug, Args)]
pub(crate) struct JsonArg {
    /// Print the report as JSON to stdout
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ZeroArg {
    /// Zero of the sensor: that of the model (none), or one constant for each file (per-record)
    #[arg(long, value_enum, default_value_t = ZeroMode::None, hide_possible_values = true, value_name = "none|per-record")]
    zero: ZeroMode,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ZeroMode {
    None,
    PerRecord,
}

impl ZeroArg {
    pub(crate) fn get(&self) -> Zero {
        match self.zero {
            ZeroMode::None => Zero::None,
            ZeroMode::PerRecord => Zero::PerRecord,
        }
    }
}
