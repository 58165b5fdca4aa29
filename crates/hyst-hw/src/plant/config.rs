//! The TOML file that describes a simulated actuator.

use serde::{Deserialize, Serialize};

use super::error::ConfigError;
use super::validate;

/// A simulated actuator. Every effect is a section of the file; an absent section is an absent effect.
///
/// ```
/// let config = hyst_hw::PlantConfig::from_toml(r#"
///     seed = 7
///     [actuator]
///     max_v = 120
///     gain_um_per_v = 0.2
///     loop_share = 0.12
///     [sensor]
///     range_um = [-12, 43]
///     noise_um = 0.007
///     [delay]
///     seconds = 0.002
/// "#)?;
/// assert_eq!(config.effects(), ["delay"]);
/// # Ok::<(), hyst_hw::ConfigError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantConfig {
    /// Seed of everything random: relay bed, temperature phase, noise. At most 2⁶³ − 1, as TOML integers are signed.
    pub seed: u64,
    /// The hysteretic element.
    pub actuator: Actuator,
    /// Position sensor and its converter.
    pub sensor: Sensor,
    /// Drag on the relays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscosity: Option<Viscosity>,
    /// Dead time between drive and actuator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay: Option<Delay>,
    /// First-order lag of the amplifier.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag: Option<Lag>,
    /// Temperature, its effect on the gain and its measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Temperature>,
    /// Slow continued motion after a change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub creep: Option<Creep>,
    /// Structural modes, `[[mode]]` each; gain that they leave acts at once.
    #[serde(default, rename = "mode", skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<Mode>,
    /// Wandering of the sensor's zero with the lab's clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<Drift>,
    /// A periodic disturbance of the sensor, on the lab's clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interference: Option<Interference>,
}

/// Section `[actuator]`: a bed of relays and a reversible linear part.
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
    /// Number of relays; 15 000 unless given.
    #[serde(default = "default_relays")]
    pub relays: usize,
}

/// Section `[viscosity]`: relays take time to turn, `φ' = (u - threshold) / J` beyond a threshold, so that loops widen
/// with the drive's rate. Each relay has a `J` of its own, `volt_seconds` on average.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Viscosity {
    /// Mean of the overdrive over time that turns a relay (V·s).
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

impl PlantConfig {
    /// Reads and validates a description.
    ///
    /// # Errors
    /// When the text is not TOML, a field is unknown or missing, or a value makes no sense; the
    /// message names the field and says what to do.
    pub fn from_toml(text: &str) -> Result<Self, ConfigError> {
        let config: Self = toml::from_str(text).map_err(|e| ConfigError::Syntax(e.to_string()))?;
        config.validate()?;
        Ok(config)
    }

    /// Writes the description; reading it back gives the same values to the last bit.
    ///
    /// # Errors
    /// When a value is not valid (see [`validate`](Self::validate)), so that no file is written
    /// that could not be read.
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        self.validate()?;
        toml::to_string(self).map_err(|e| ConfigError::Syntax(e.to_string()))
    }

    /// Checks every value.
    ///
    /// # Errors
    /// On the first value that makes no sense, naming the field and saying what to do.
    pub fn validate(&self) -> Result<(), ConfigError> {
        validate::check(self)
    }

    /// Names of the effects that are switched on, in the chain's order. A temperature that is
    /// recorded but has no influence is no effect; neither is the hysteresis itself.
    #[must_use]
    pub fn effects(&self) -> Vec<&'static str> {
        let on = [
            ("delay", self.delay.is_some()),
            ("lag", self.lag.is_some()),
            ("rate-dependence", self.viscosity.is_some()),
            ("temperature", self.temperature.as_ref().is_some_and(|t| t.per_k != 0.0)),
            ("creep", self.creep.is_some()),
            ("resonance", !self.modes.is_empty()),
            ("drift", self.drift.is_some()),
            ("interference", self.interference.is_some()),
        ];
        on.into_iter().filter(|&(_, on)| on).map(|(name, _)| name).collect()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A linear, noiseless plant of 0.1 µm/V with a converter too fine to see: what a test adds is all there is.
    pub(crate) fn clean() -> PlantConfig {
        PlantConfig {
            seed: 1,
            actuator: Actuator {
                min_v: 0.0,
                max_v: 100.0,
                rest_v: 0.0,
                gain_um_per_v: 0.1,
                loop_share: 0.0,
                relays: 2000,
            },
            sensor: Sensor { range_um: [-20.0, 40.0], bits: 48, noise_um: 0.0, offset_um: 0.0, max_rate_hz: 20_000.0 },
            viscosity: None,
            delay: None,
            lag: None,
            temperature: None,
            creep: None,
            modes: Vec::new(),
            drift: None,
            interference: None,
        }
    }

    const FULL: &str = r#"
        seed = 11
        [actuator]
        min_v = -20
        max_v = 120.0
        rest_v = 0.0
        gain_um_per_v = 0.2
        loop_share = 0.13
        relays = 12000
        [sensor]
        range_um = [-20, 60]
        bits = 16
        noise_um = 0.007
        offset_um = 1.5
        max_rate_hz = 5000.0
        [viscosity]
        volt_seconds = 4e-4
        [delay]
        seconds = 0.002
        [lag]
        seconds = 0.003
        [temperature]
        per_k = 0.005
        reference_degc = 22.0
        mean_degc = 23.0
        swing_k = 10.0
        period_s = 45.0
        shape = "wander"
        recorded = true
        noise_k = 0.02
        [creep]
        strength = 0.08
        tau_min_s = 0.05
        tau_max_s = 80.0
        exponent = 0.1
        elements = 60
        [[mode]]
        hz = 100.0
        damping = 0.02
        gain = 0.9
        [[mode]]
        hz = 350.0
        damping = 0.015
        gain = 0.05
        [drift]
        um_per_s = 0.01
        [interference]
        amplitude_um = 0.1
        hz = 50.0
        phase_rad = 0.4
    "#;

    #[test]
    fn every_section_is_read_written_and_read_again_alike() {
        let config = PlantConfig::from_toml(FULL).unwrap();
        assert_eq!(
            config.effects(),
            ["delay", "lag", "rate-dependence", "temperature", "creep", "resonance", "drift", "interference"]
        );
        assert_eq!(config.modes[1].hz, 350.0);
        let again = PlantConfig::from_toml(&config.to_toml().unwrap()).unwrap();
        assert_eq!(config, again);
    }

    #[test]
    fn temperature_without_influence_is_no_effect() {
        let config = PlantConfig::from_toml(&FULL.replace("per_k = 0.005", "")).unwrap();
        assert!(!config.effects().contains(&"temperature"));
        assert!(config.temperature.unwrap().recorded);
    }

    #[test]
    fn unknown_and_missing_fields_are_named() {
        let unknown = PlantConfig::from_toml(&FULL.replace("per_k", "per_kelvin")).unwrap_err();
        assert!(unknown.to_string().contains("per_kelvin"), "{unknown}");
        let section = PlantConfig::from_toml(&FULL.replace("[drift]", "[drifting]")).unwrap_err();
        assert!(section.to_string().contains("drifting"), "{section}");
        let missing = PlantConfig::from_toml(&FULL.replace("loop_share = 0.13", "")).unwrap_err();
        assert!(missing.to_string().contains("loop_share"), "{missing}");
    }
}
