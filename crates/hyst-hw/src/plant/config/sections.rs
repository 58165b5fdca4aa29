//! The sections of a plant's file.

use serde::{Deserialize, Serialize};

/// Section `[actuator]`: a bed of relays, or of plays, and a reversible linear part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Actuator {
    /// Lowest voltage (V); 0 unless given.
    #[serde(default)]
    pub min_v: f64,
    /// Highest voltage (V).
    pub max_v: f64,
    /// Voltage at rest (V); 0 unless given. Displacement is counted from the virgin state there.
    #[serde(default)]
    pub rest_v: f64,
    /// Displacement span of the major loop over its voltage span (µm/V).
    pub gain_um_per_v: f64,
    /// Greatest opening of the major loop, as a share of its displacement span; 0 = no hysteresis.
    pub loop_share: f64,
    /// What the bed is made of; relays unless given.
    #[serde(default, skip_serializing_if = "Bed::is_relays")]
    pub bed: Bed,
    /// Number of relays, or of plays; 15 000 unless given.
    #[serde(default = "default_relays")]
    pub relays: usize,
}

/// What the hysteretic element is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bed {
    /// Relays of equal weights with random thresholds: loops of no symmetry.
    #[default]
    Relays,
    /// Plays with random thresholds and weights: loops that are symmetric about their centre. It is the element of
    /// Prandtl-Ishlinskii models too, which have few of them on a grid.
    Plays,
    /// Relays most of which stand in two clumps: loops that bend where these are passed, as smooth curves do not.
    Clumps,
}

impl Bed {
    /// What a file does not have to say.
    fn is_relays(&self) -> bool {
        *self == Self::Relays
    }
}

/// Section `[viscosity]`: relays take time to turn, `φ' = (u - threshold) / J` beyond a threshold, or plays to follow,
/// `p' = o² / J` where they are overdriven by `o = |u - p| - threshold`: loops widen with about the root of the drive's
/// rate. Each relay or play has a `J` of its own, `volt_seconds` on average.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Viscosity {
    /// Mean of the overdrive over time that turns a relay, and the like for plays (V·s).
    pub volt_seconds: f64,
}

/// Section `[sensor]`: zero, noise and converter of the position measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Lowest and highest displacement that the converter can show (µm).
    pub range_um: [f64; 2],
    /// Resolution of the converter over `range_um` (bit); 16 unless given.
    #[serde(default = "default_bits")]
    pub bits: u32,
    /// Standard deviation of the Gaussian noise (µm); 0 unless given.
    #[serde(default)]
    pub noise_um: f64,
    /// Reading for the device at rest (µm); 0 unless given.
    #[serde(default)]
    pub offset_um: f64,
    /// Fastest sample clock (Hz); 20 000 unless given.
    #[serde(default = "default_max_rate_hz")]
    pub max_rate_hz: f64,
}

/// Section `[delay]`: the actuator gets `u(t - seconds)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delay {
    /// Dead time (s).
    pub seconds: f64,
}

/// Section `[lag]`: `seconds · x' = u - x` between drive and hysteresis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lag {
    /// Time constant (s).
    pub seconds: f64,
}

/// Section `[asymmetry]`: a smooth curve of the hysteresis' displacement, zero where the device rests and as steep on average.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asymmetry {
    /// Slope at the upper end of the stroke less that at the lower end, over the mean slope; from −1 to 1.
    #[serde(default)]
    pub bend: f64,
    /// Mean slope at the two ends less that in the middle, over the mean slope; from −0.5 to 0.5, 0 unless given.
    #[serde(default)]
    pub hook: f64,
}

/// Section `[temperature]`: the displacement is multiplied by `1 + per_k · (T - reference_degc)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    /// Relative change of the displacement (1/K); 0 unless given: recorded, but without effect.
    #[serde(default)]
    pub per_k: f64,
    /// Temperature at which the factor is 1 (°C).
    pub reference_degc: f64,
    /// Mean of the profile (°C).
    pub mean_degc: f64,
    /// Greatest difference between the profile's highest and lowest value (K); 0 unless given: constant.
    #[serde(default)]
    pub swing_k: f64,
    /// Period of the swing (s); needed when `swing_k` is not 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// How the temperature moves; a sine unless given.
    #[serde(default)]
    pub shape: TemperatureShape,
    /// Whether samples hold the measured temperature; they do unless told otherwise.
    #[serde(default = "default_recorded")]
    pub recorded: bool,
    /// Standard deviation of the thermometer's noise (K); 0 unless given.
    #[serde(default)]
    pub noise_k: f64,
}

/// How the temperature moves around its mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TemperatureShape {
    /// One sine of `period_s`, its phase from the seed.
    #[default]
    Sine,
    /// Several incommensurate sines, the slowest of `period_s`, amplitudes and phases from the seed.
    Wander,
}

/// Section `[creep]`: `y = x + Σ wᵢ zᵢ`, `τᵢ zᵢ' = x - zᵢ`, with `τᵢ` spaced evenly in the logarithm
/// and `wᵢ ∝ τᵢ^exponent`, `Σ wᵢ = strength`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Creep {
    /// Creep after infinite time over the displacement that caused it.
    pub strength: f64,
    /// Shortest time constant (s).
    pub tau_min_s: f64,
    /// Longest time constant (s).
    pub tau_max_s: f64,
    /// Power of the weights' law; 0 unless given: as much creep in every decade.
    #[serde(default)]
    pub exponent: f64,
    /// Number of time constants; 60 unless given.
    #[serde(default = "default_elements")]
    pub elements: usize,
}

/// Section `[load]`: an external force on the actuator, which yields by `um_per_n` times the force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Amplitude: the force stays between this and its negative (N).
    pub newtons: f64,
    /// Compliance of the actuator (µm/N); negative if a positive force pushes it back.
    pub um_per_n: f64,
    /// Period of the profile (s); of steps, how long a level is held.
    pub period_s: f64,
    /// How the force moves on the lab's clock; a sine unless given.
    #[serde(default)]
    pub shape: LoadShape,
    /// Whether samples hold the measured force; they do unless told otherwise.
    #[serde(default = "default_recorded")]
    pub recorded: bool,
    /// Standard deviation of the force sensor's noise (N); 0 unless given.
    #[serde(default)]
    pub noise_n: f64,
}

/// How a load moves around zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoadShape {
    /// One sine of `period_s`, its phase from the seed.
    #[default]
    Sine,
    /// Several incommensurate sines, the slowest of `period_s`, amplitudes and phases from the seed.
    Wander,
    /// Levels from the seed, each held for `period_s`.
    Steps,
}

/// A section `[[mode]]`: `q'' + 2 damping ω q' + ω² q = ω² x`, `ω = 2π hz`; adds `gain · q`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mode {
    /// Undamped natural frequency (Hz).
    pub hz: f64,
    /// Damping ratio, 0 to 1 (both excluded).
    pub damping: f64,
    /// Share of the static displacement that goes through this mode.
    pub gain: f64,
}

/// Section `[saturation]`: the motion ends at two stops, or at one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saturation {
    /// Lower stop, counted from where the device rests without load (µm); none unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low_um: Option<f64>,
    /// Upper stop, counted alike (µm); none unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high_um: Option<f64>,
    /// How far before a stop the motion begins to slow down (µm): the corner is rounded by an arc; 0, a hard stop,
    /// unless given.
    #[serde(default)]
    pub knee_um: f64,
}

/// Section `[drift]`: the reading moves by `um_per_s` times the lab's time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// Rate (µm/s).
    pub um_per_s: f64,
}

/// Section `[interference]`: adds `amplitude_um · sin(2π hz t + phase_rad)`, `t` the lab's time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interference {
    /// Amplitude (µm).
    pub amplitude_um: f64,
    /// Frequency (Hz).
    pub hz: f64,
    /// Phase at lab time 0 (rad); 0 unless given.
    #[serde(default)]
    pub phase_rad: f64,
}

const fn default_relays() -> usize {
    15_000
}
const fn default_bits() -> u32 {
    16
}
const fn default_max_rate_hz() -> f64 {
    20_000.0
}
const fn default_recorded() -> bool {
    true
}
const fn default_elements() -> usize {
    60
}
