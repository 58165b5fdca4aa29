//! Arguments of `excite`.

use clap::{Args, Subcommand, ValueEnum};
use hyst_ident::model::Effect;

use super::shared::JsonArg;
use crate::output::Target;

const EXAMPLES: &str = "\
Examples:
  hystctl excite identification --rate 1000 --high 120 -o u.csv
  hystctl excite identification --rate 1000 --high 120 --test -o u-test.csv
  hystctl excite sine --frequency 2 --cycles 5 --low -20 --high 120 -o u.csv
  hystctl excite separate lag delay --high 120 -o u.csv
  hystctl excite --help; hystctl excite stairs --help

Each segment starts and ends at rest at the lowest voltage and stays within the limits.";

/// Make a drive to identify or test an actuator
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ExciteArgs {
    #[command(subcommand)]
    pub(crate) kind: ExciteKind,
}

/// Arguments of all drives.
#[derive(Debug, Args)]
pub(crate) struct Common {
    /// Drive file to write (CSV); - for stdout
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Target,
    /// Sample rate (rows per second)
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    pub(crate) rate: f64,
    /// Lowest voltage, at which the device rests
    #[arg(long, value_name = "V", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) low: f64,
    /// Highest voltage
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub(crate) high: f64,
    /// Maximum slope of the amplifier: a steeper drive is refused. `identification` chooses slower values for the
    /// options that are not given
    #[arg(long, value_name = "V_PER_S")]
    pub(crate) slew: Option<f64>,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// The kinds of drives.
#[derive(Debug, Subcommand)]
pub(crate) enum ExciteKind {
    /// Standard drive of an identification; it shows every effect that diagnose can name
    Identification {
        /// Duration, rests included
        #[arg(long, value_name = "S", default_value_t = 36.0)]
        seconds: f64,
        /// Rest between segments
        #[arg(long, value_name = "S", default_value_t = 1.0)]
        rest: f64,
        /// Frequency of the slow loops; from --rate and --slew if not given
        #[arg(long, value_name = "HZ")]
        slow: Option<f64>,
        /// Frequency of the fast loops; from --rate and --slew if not given
        #[arg(long, value_name = "HZ")]
        fast: Option<f64>,
        /// Highest frequency of the multisine; from --rate and --slew if not given
        #[arg(long, value_name = "HZ")]
        band: Option<f64>,
        /// Hold time of each level
        #[arg(long, value_name = "S", default_value_t = 2.0)]
        hold: f64,
        /// Duration of the ramps between levels; from --rate and --slew if not given
        #[arg(long, value_name = "S")]
        ramp: Option<f64>,
        /// Make the drive for a test record: the same kind of drive with other frequencies, levels and phases
        #[arg(long)]
        test: bool,
        /// Seed of levels and phases
        #[arg(long, default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        common: Common,
    },
    /// Cosine waves over the whole span
    Sine {
        #[command(flatten)]
        periodic: Periodic,
        #[command(flatten)]
        common: Common,
    },
    /// Sine around mid-span whose amplitude decays to zero: nested loops
    DecayingSine {
        /// Frequency
        #[arg(long, value_name = "HZ", default_value_t = 2.0)]
        frequency: f64,
        /// Duration, at least three periods
        #[arg(long, value_name = "S", default_value_t = 10.0)]
        seconds: f64,
        #[command(flatten)]
        common: Common,
    },
    /// Ramps up and down over the whole span
    Triangle {
        #[command(flatten)]
        periodic: Periodic,
        #[command(flatten)]
        common: Common,
    },
    /// Random levels that are held, with smooth ramps between them
    Stairs {
        /// Number of levels
        #[arg(long, value_name = "N", default_value_t = 8)]
        levels: u32,
        /// Hold time of each level
        #[arg(long, value_name = "S", default_value_t = 2.0)]
        hold: f64,
        /// Duration of each ramp
        #[arg(long, value_name = "S", default_value_t = 0.08)]
        ramp: f64,
        /// Seed of the levels
        #[arg(long, default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        common: Common,
    },
    /// Sum of sines around mid-span
    Multisine {
        /// Lowest frequency
        #[arg(long, value_name = "HZ", default_value_t = 1.0)]
        from: f64,
        /// Highest frequency
        #[arg(long, value_name = "HZ", default_value_t = 50.0)]
        to: f64,
        /// Number of sines
        #[arg(long, value_name = "N", default_value_t = 40)]
        lines: u32,
        /// Duration, fade-in and fade-out included
        #[arg(long, value_name = "S", default_value_t = 5.0)]
        seconds: f64,
        /// Duration of each fade; a tenth of --seconds if not given
        #[arg(long, value_name = "S")]
        fade: Option<f64>,
        /// Number of periods of the sum, for averages over periods (response --period)
        #[arg(long, value_name = "N", default_value_t = 1)]
        periods: u32,
        /// Seed of random phases; phases with a low crest factor if not given
        #[arg(long)]
        seed: Option<u64>,
        #[command(flatten)]
        common: Common,
    },
    /// Cosine wave over the whole span with rising frequency
    Sweep {
        /// Frequency at the start
        #[arg(long, value_name = "HZ", default_value_t = 1.0)]
        from: f64,
        /// Frequency at the end
        #[arg(long, value_name = "HZ", default_value_t = 50.0)]
        to: f64,
        /// Duration; adjusted to whole cycles
        #[arg(long, value_name = "S", default_value_t = 5.0)]
        seconds: f64,
        #[command(flatten)]
        common: Common,
    },
    /// Peaks of growing height: first-order reversal curves
    Forc {
        /// Number of peaks
        #[arg(long, value_name = "N", default_value_t = 10)]
        curves: u32,
        /// Duration of a peak; each further duration adds a segment, and the Everett surface is averaged over the
        /// segments
        #[arg(long, value_name = "S,…", value_delimiter = ',', default_value = "1")]
        seconds: Vec<f64>,
        /// Rest after each peak
        #[arg(long, value_name = "S", default_value_t = 0.5)]
        rest: f64,
        /// Shape of the peaks
        #[arg(long, value_enum, default_value_t = PeakForm::HalfSine)]
        peak: PeakForm,
        #[command(flatten)]
        common: Common,
    },
    /// Lines of a raster scan: constant speed in both directions, with rounded turning points
    Raster {
        /// Share of the time spent in turning points; 0 = a triangle
        #[arg(long, value_name = "SHARE", default_value_t = 0.2)]
        turning: f64,
        #[command(flatten)]
        periodic: Periodic,
        #[command(flatten)]
        common: Common,
    },
    /// One axis of a spiral scan: a sine around mid-span whose amplitude grows to the whole span
    Spiral {
        /// Start angle; the other axis starts at 90 degrees more
        #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
        phase: f64,
        #[command(flatten)]
        periodic: Periodic,
        #[command(flatten)]
        common: Common,
    },
    /// Amplitude-modulated sine around mid-span: all amplitudes at one frequency
    AmSine {
        /// Frequency
        #[arg(long, value_name = "HZ", default_value_t = 10.0)]
        frequency: f64,
        /// Modulation frequency
        #[arg(long, value_name = "HZ", default_value_t = 0.2)]
        modulation: f64,
        /// Modulation depth; 1 = the amplitude falls to zero
        #[arg(long, value_name = "SHARE", default_value_t = 0.9)]
        depth: f64,
        /// Number of modulation periods
        #[arg(long, value_name = "N", default_value_t = 2)]
        cycles: u32,
        #[command(flatten)]
        common: Common,
    },
    /// Sines around mid-span, one segment for each amplitude and frequency: for gain maps
    Tones {
        /// Frequencies
        #[arg(long, value_name = "HZ", value_delimiter = ',', default_value = "1,5,10,20")]
        frequencies: Vec<f64>,
        /// Amplitudes as shares of half the span
        #[arg(long, value_name = "SHARE", value_delimiter = ',', default_value = "0.25,0.5,0.75,1")]
        amplitudes: Vec<f64>,
        /// Cycles of each sine, without fades
        #[arg(long, value_name = "N", default_value_t = 10)]
        cycles: u32,
        /// Rest between segments
        #[arg(long, value_name = "S", default_value_t = 0.5)]
        rest: f64,
        #[command(flatten)]
        common: Common,
    },
    Separate(SeparateArgs),
    /// Small cosine waves at several levels: minor loops
    MinorLoops {
        /// Number of levels
        #[arg(long, value_name = "N", default_value_t = 5)]
        levels: u32,
        /// Height of the loops as a share of the span
        #[arg(long, value_name = "SHARE", default_value_t = 0.2)]
        share: f64,
        #[command(flatten)]
        periodic: Periodic,
        #[command(flatten)]
        common: Common,
    },
}

/// Make the drive that separates two effects best, and print why
///
/// Each candidate drive is simulated with a typical actuator. The residual of one effect after the best fit of the
/// other effect is computed, and the drive with the largest residual is written. Effects: delay, lag, asymmetry,
/// rate-dependence, temperature, creep, load, resonance, saturation, drift, interference.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl excite separate lag delay --high 120 --slew 20000 -o u.csv")]
pub(crate) struct SeparateArgs {
    /// First effect
    #[arg(value_name = "EFFECT")]
    pub(crate) first: Effect,
    /// Second effect
    #[arg(value_name = "OTHER")]
    pub(crate) second: Effect,
    /// Duration
    #[arg(long, value_name = "S", default_value_t = 30.0)]
    pub(crate) seconds: f64,
    /// Noise of the sensor as a share of the output's span
    #[arg(long, value_name = "SHARE", default_value_t = 0.001)]
    pub(crate) noise: f64,
    /// Temperature will be measured: the record will have temperature_degc
    #[arg(long)]
    pub(crate) thermometer: bool,
    /// Load will be measured: the record will have load_n
    #[arg(long)]
    pub(crate) load_cell: bool,
    #[command(flatten)]
    pub(crate) common: Common,
}

/// Arguments of periodic waves.
#[derive(Debug, Args)]
pub(crate) struct Periodic {
    /// Frequency
    #[arg(long, value_name = "HZ", default_value_t = 1.0)]
    pub(crate) frequency: f64,
    /// Number of cycles
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(crate) cycles: u32,
}

/// Shape of the peak of a reversal curve.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum PeakForm {
    /// Straight flanks; the corners excite modes of the structure
    Triangle,
    /// Half sine, smooth at the reversal
    HalfSine,
}
