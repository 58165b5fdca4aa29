//! Sections of a plant's file.

use serde::{Deserialize, Serialize};

/// Section `[actuator]`: a bed of relays or play operators, and a reversible linear part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Actuator {
    /// Lowest voltage (V); default 0.
    #[serde(default)]
    pub min_v: f64,
    /// Highest voltage (V).
    pub max_v: f64,
    /// Voltage at rest (V); default 0. The displacement is counted from the virgin state at this voltage.
    #[serde(default)]
    pub rest_v: f64,
    /// Displacement span of the major loop divided by its voltage span (µm/V).
    pub gain_um_per_v: f64,
    /// Largest opening of the major loop, as a share of its displacement span; 0 = no hysteresis.
    pub loop_share: f64,
    /// Elements of the bed; default: relays.
    #[serde(default, skip_serializing_if = "Bed::is_relays")]
    pub bed: Bed,
    /// Number of relays or play operators; default 15 000.
    #[serde(default = "default_relays")]
    pub relays: usize,
}

/// Elements of the hysteresis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bed {
    /// Relays with equal weights and random thresholds: asymmetric loops.
    #[default]
    Relays,
    /// Play operators with random thresholds and weights: loops that are symmetric about their centre.
    ///
    /// Prandtl-Ishlinskii models have the same elements, but only a few and on a grid.
    Plays,
    /// Relays, most of them with thresholds in two clusters.
    ///
    /// The loop bends at each cluster, unlike a smooth curve.
    Clumps,
}

impl Bed {
    /// Returns whether the value is the default.
    fn is_relays(&self) -> bool {
        *self == Self::Relays
    }
}

/// Section `[viscosity]`: relays and play operators respond slowly, which widens the loop with rate.
///
/// Beyond its threshold a relay switches with `φ' = (u - threshold) / J`. A play operator follows with `p' = o² / J`,
/// where `o = |u - p| - threshold` is its overdrive. The loop widens approximately with the root of the drive's rate.
/// Each relay or play operator has its own `J`, with the mean `volt_seconds`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Viscosity {
    /// Mean of `J`: for relays, the time integral of the overdrive that switches one (V·s).
    pub volt_seconds: f64,
}

/// Section `[sensor]`: zero, noise and converter of the position sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Range of the converter: lowest and highest displacement (µm).
    pub range_um: [f64; 2],
    /// Resolution of the converter over `range_um` (bit); default 16.
    #[serde(default = "default_bits")]
    pub bits: u32,
    /// Standard deviation of the Gaussian noise (µm); default 0.
    #[serde(default)]
    pub noise_um: f64,
    /// Reading at rest (µm); default 0.
    #[serde(default)]
    pub offset_um: f64,
    /// Fastest sample clock (Hz); default 20 000.
    #[serde(default = "default_max_rate_hz")]
    pub max_rate_hz: f64,
}

/// Section `[delay]`: the actuator receives `u(t - seconds)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delay {
    /// Dead time (s).
    pub seconds: f64,
}

/// Section `[lag]`: a first-order lag between drive and hysteresis, `seconds · x' = u - x`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lag {
    /// Time constant (s).
    pub seconds: f64,
}

/// Section `[asymmetry]`: a smooth curve applied to the displacement of the hysteresis.
///
/// It is 0 at rest and has a mean slope of 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asymmetry {
    /// Slope at the upper end of the stroke minus that at the lower end, relative to the mean slope.
    ///
    /// From −1 to 1, default 0.
    #[serde(default)]
    pub bend: f64,
    /// Mean slope at the two ends minus that in the middle, relative to the mean slope.
    ///
    /// From −0.5 to 0.5, default 0.
    #[serde(default)]
    pub hook: f64,
}

/// Section `[temperature]`: the displacement is multiplied by `1 + per_k · (T - reference_degc)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    /// Relative change of the displacement (1/K); default 0: recorded, but without effect.
    #[serde(default)]
    pub per_k: f64,
    /// Temperature at which the factor is 1 (°C).
    pub reference_degc: f64,
    /// Mean temperature (°C).
    pub mean_degc: f64,
    /// Largest difference between highest and lowest temperature (K); default 0: constant.
    #[serde(default)]
    pub swing_k: f64,
    /// Period of the swing (s); required if `swing_k` is not 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// Profile of the temperature; default: a sine.
    #[serde(default)]
    pub shape: TemperatureShape,
    /// Whether samples contain the measured temperature; default true.
    #[serde(default = "default_recorded")]
    pub recorded: bool,
    /// Standard deviation of the thermometer's noise (K); default 0.
    #[serde(default)]
    pub noise_k: f64,
}

/// Profile of the temperature around its mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TemperatureShape {
    /// One sine with period `period_s` and a phase from the seed.
    #[default]
    Sine,
    /// Several incommensurate sines, the slowest with period `period_s`.
    ///
    /// Amplitudes and phases come from the seed.
    Wander,
}

/// Section `[creep]`: `y = x + Σ wᵢ zᵢ` with `τᵢ zᵢ' = x - zᵢ`.
///
/// The `τᵢ` are spaced evenly on a logarithmic scale, and `wᵢ ∝ τᵢ^exponent` with `Σ wᵢ = strength`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Creep {
    /// Creep after infinite time, relative to the displacement that causes it.
    pub strength: f64,
    /// Shortest time constant (s).
    pub tau_min_s: f64,
    /// Longest time constant (s).
    pub tau_max_s: f64,
    /// Exponent of the weights; default 0: the same creep in every decade.
    #[serde(default)]
    pub exponent: f64,
    /// Number of time constants; default 60.
    #[serde(default = "default_elements")]
    pub elements: usize,
}

/// Section `[load]`: an external force, which moves the actuator by `um_per_n` times the force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Amplitude: the force stays between this value and its negative (N).
    pub newtons: f64,
    /// Compliance of the actuator (µm/N); negative if a positive force reduces the displacement.
    pub um_per_n: f64,
    /// Period of the profile (s); for steps, the duration of a level.
    pub period_s: f64,
    /// Profile of the force on the lab clock; default: a sine.
    #[serde(default)]
    pub shape: LoadShape,
    /// Whether samples contain the measured force; default true.
    #[serde(default = "default_recorded")]
    pub recorded: bool,
    /// Standard deviation of the force sensor's noise (N); default 0.
    #[serde(default)]
    pub noise_n: f64,
}

/// Profile of the load around zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoadShape {
    /// One sine with period `period_s` and a phase from the seed.
    #[default]
    Sine,
    /// Several incommensurate sines, the slowest with period `period_s`.
    ///
    /// Amplitudes and phases come from the seed.
    Wander,
    /// Levels from the seed, each held for `period_s`.
    Steps,
}

/// Section `[[mode]]`: a structural mode, which adds `gain · q` to the displacement.
///
/// `q'' + 2 damping ω q' + ω² q = ω² x` with `ω = 2π hz`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mode {
    /// Undamped natural frequency (Hz).
    pub hz: f64,
    /// Damping ratio, 0 to 1 (both excluded).
    pub damping: f64,
    /// Share of the static displacement that passes through this mode.
    pub gain: f64,
}

/// Section `[saturation]`: mechanical stops, and limits of the amplifier.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saturation {
    /// Lower stop, counted from the rest position without load (µm); default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low_um: Option<f64>,
    /// Upper stop, counted from the rest position without load (µm); default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high_um: Option<f64>,
    /// Distance before a stop at which the motion begins to slow down (µm).
    ///
    /// An arc rounds the corner. Default 0: a hard stop.
    #[serde(default)]
    pub knee_um: f64,
    /// Lowest voltage that the amplifier gives (V); default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low_v: Option<f64>,
    /// Highest voltage that the amplifier gives (V); default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high_v: Option<f64>,
}

/// Section `[drift]`: adds `um_per_s` times the lab time to the reading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// Rate (µm/s).
    pub um_per_s: f64,
}

/// Section `[interference]`: adds `amplitude_um · sin(2π hz t + phase_rad)` to the reading.
///
/// `t` is the lab time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interference {
    /// Amplitude (µm).
    pub amplitude_um: f64,
    /// Frequency (Hz).
    pub hz: f64,
    /// Phase at lab time 0 (rad); default 0.
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
