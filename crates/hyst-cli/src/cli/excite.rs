//! Arguments of `excite`.

use clap::{Args, Subcommand, ValueEnum};
use hyst_ident::model::Effect;

use super::JsonArg;
use crate::output::Target;

const EXAMPLES: &str = "\
Examples:
  hystctl excite identification --rate 1000 --high 120 -o u.csv
  hystctl excite identification --rate 1000 --high 120 --test -o u-test.csv
  hystctl excite sine --frequency 2 --cycles 5 --low -20 --high 120 -o u.csv
  hystctl excite separate lag delay --high 120 -o u.csv
  hystctl excite --help; hystctl excite stairs --help

Every segment starts and ends at rest at the lowest voltage and stays within the limits.";

/// Make a drive with which to identify or test an actuator
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ExciteArgs {
    #[command(subcommand)]
    pub(crate) kind: ExciteKind,
}

/// What all drives need.
#[derive(Debug, Args)]
pub(crate) struct Common {
    /// Drive file to write (CSV); - for stdout
    #[arg(short, long, value_name = "CSV")]
    pub(crate) output: Target,
    /// Rows per second
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    pub(crate) rate: f64,
    /// Lowest voltage, at which the device rests
    #[arg(long, value_name = "V", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) low: f64,
    /// Highest voltage
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub(crate) high: f64,
    /// Steepest slope that the amplifier stands; a steeper drive is refused, but what an identification is free in is slowed down
    #[arg(long, value_name = "V_PER_S")]
    pub(crate) slew: Option<f64>,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

/// The kinds of drives.
#[derive(Debug, Subcommand)]
pub(crate) enum ExciteKind {
    /// The standard drive of an identification: it shows every effect that diagnose can name
    Identification {
        /// Duration, rests included
        #[arg(long, value_name = "S", default_value_t = 36.0)]
        seconds: f64,
        /// Rest between segments
        #[arg(long, value_name = "S", default_value_t = 1.0)]
        rest: f64,
        /// Frequency of the slow loops; chosen by the rate and --slew if not given
        #[arg(long, value_name = "HZ")]
        slow: Option<f64>,
        /// Frequency of the fast loops; chosen by the rate and --slew if not given
        #[arg(long, value_name = "HZ")]
        fast: Option<f64>,
        /// Highest frequency of the multisine; chosen by the rate and --slew if not given
        #[arg(long, value_name = "HZ")]
        band: Option<f64>,
        /// How long levels are held
        #[arg(long, value_name = "S", default_value_t = 2.0)]
        hold: f64,
        /// How long the ramps between levels take; chosen by the rate and --slew if not given
        #[arg(long, value_name = "S")]
        ramp: Option<f64>,
        /// The drive for a test record: as the one without this option, but with other frequencies, levels and phases
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
    /// Sine around mid-span whose amplitude falls to nothing: nested loops
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
    /// Random levels, held, with smooth ramps in between
    Stairs {
        /// How many levels
        #[arg(long, value_name = "N", default_value_t = 8)]
        levels: u32,
        /// How long each is held
        #[arg(long, value_name = "S", default_value_t = 2.0)]
        hold: f64,
        /// How long each ramp takes
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
        /// Lowest line
        #[arg(long, value_name = "HZ", default_value_t = 1.0)]
        from: f64,
        /// Highest line
        #[arg(long, value_name = "HZ", default_value_t = 50.0)]
        to: f64,
        /// How many lines
        #[arg(long, value_name = "N", default_value_t = 40)]
        lines: u32,
        /// Duration, fades included
        #[arg(long, value_name = "S", default_value_t = 5.0)]
        seconds: f64,
        /// Duration of each fade; a tenth of the whole if not given
        #[arg(long, value_name = "S")]
        fade: Option<f64>,
        /// How often the sum repeats, for averages over periods (response --period)
        #[arg(long, value_name = "N", default_value_t = 1)]
        periods: u32,
        /// Seed of random phases; phases of low crest factor if not given
        #[arg(long)]
        seed: Option<u64>,
        #[command(flatten)]
        common: Common,
    },
    /// Cosine wave of rising frequency over the whole span
    Sweep {
        /// Frequency at the start
        #[arg(long, value_name = "HZ", default_value_t = 1.0)]
        from: f64,
        /// Frequency at the end
        #[arg(long, value_name = "HZ", default_value_t = 50.0)]
        to: f64,
        /// Duration, adjusted to whole cycles
        #[arg(long, value_name = "S", default_value_t = 5.0)]
        seconds: f64,
        #[command(flatten)]
        common: Common,
    },
    /// Peaks of growing height: first-order reversal curves
    Forc {
        /// How many peaks
        #[arg(long, value_name = "N", default_value_t = 10)]
        curves: u32,
        /// Duration of a peak; several make as many segments, over which an Everett surface is averaged
        #[arg(long, value_name = "S,…", value_delimiter = ',', default_value = "1")]
        seconds: Vec<f64>,
        /// Rest after each peak
        #[arg(long, value_name = "S", default_value_t = 0.5)]
        rest: f64,
        /// Form of the peaks
        #[arg(long, value_enum, default_value_t = PeakForm::HalfSine)]
        peak: PeakForm,
        #[command(flatten)]
        common: Common,
    },
    /// Lines of a raster scan: constant speed there and back, with rounded turnings
    Raster {
        /// Share of the time that the turnings take; 0 = a triangle
        #[arg(long, value_name = "SHARE", default_value_t = 0.2)]
        turning: f64,
        #[command(flatten)]
        periodic: Periodic,
        #[command(flatten)]
        common: Common,
    },
    /// One axis of a spiral scan: a sine around mid-span whose amplitude grows to the whole span
    Spiral {
        /// Angle at which it begins, in degrees; the other axis has 90 more
        #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
        phase: f64,
        #[command(flatten)]
        periodic: Periodic,
        #[command(flatten)]
        common: Common,
    },
    /// Sine around mid-span whose amplitude swings: every amplitude at one frequency
    AmSine {
        /// Frequency
        #[arg(long, value_name = "HZ", default_value_t = 10.0)]
        frequency: f64,
        /// Frequency at which the amplitude swings
        #[arg(long, value_name = "HZ", default_value_t = 0.2)]
        modulation: f64,
        /// How far the amplitude swings; 1 = down to nothing
        #[arg(long, value_name = "SHARE", default_value_t = 0.9)]
        depth: f64,
        /// Whole swings of the amplitude
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
        /// Cycles of each, without fades
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
        /// How many levels
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

/// The drive that tells two effects apart, and why
///
/// For each drive of a family it is computed, with a typical actuator, how much of what one effect does the best-fitting other
/// one cannot imitate; the drive that leaves most is written. Effects: delay, lag, asymmetry, rate-dependence, temperature,
/// creep, load, resonance, saturation, drift, interference.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl excite separate lag delay --high 120 --slew 20000 -o u.csv")]
pub(crate) struct SeparateArgs {
    /// One effect
    #[arg(value_name = "EFFECT")]
    pub(crate) first: Effect,
    /// The other
    #[arg(value_name = "OTHER")]
    pub(crate) second: Effect,
    /// Duration
    #[arg(long, value_name = "S", default_value_t = 30.0)]
    pub(crate) seconds: f64,
    /// Noise of the sensor as a share of the output's span
    #[arg(long, value_name = "SHARE", default_value_t = 0.001)]
    pub(crate) noise: f64,
    /// The record will have temperature_degc
    #[arg(long)]
    pub(crate) thermometer: bool,
    /// The record will have load_n
    #[arg(long)]
    pub(crate) load_cell: bool,
    #[command(flatten)]
    pub(crate) common: Common,
}

/// Waves that repeat.
#[derive(Debug, Args)]
pub(crate) struct Periodic {
    /// Frequency
    #[arg(long, value_name = "HZ", default_value_t = 1.0)]
    pub(crate) frequency: f64,
    /// How many cycles
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(crate) cycles: u32,
}

/// Form of a reversal curve's peak.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum PeakForm {
    /// Straight flanks; they excite the modes of a structure
    Triangle,
    /// Smooth at the reversal
    HalfSine,
}
