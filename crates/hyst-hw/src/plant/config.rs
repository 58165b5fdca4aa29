//! The TOML file that describes a simulated actuator.

mod disturbance;
mod sections;

use serde::{Deserialize, Serialize};

pub use disturbance::Disturbance;
pub use sections::*;

/// Description of a simulated actuator.
///
/// Each effect is a section of the file; without its section it does not act.
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
    /// Seed of all random values: bed, profiles, noise. At most 2⁶³ − 1, because TOML integers are signed.
    pub seed: u64,
    /// Seed of the noise, for repeated measurements of the same actuator; by default `seed`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_seed: Option<u64>,
    /// The hysteretic element.
    pub actuator: Actuator,
    /// Position sensor and its converter.
    pub sensor: Sensor,
    /// Viscous drag on relays or play operators (rate dependence).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscosity: Option<Viscosity>,
    /// Dead time between drive and actuator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay: Option<Delay>,
    /// First-order lag of the amplifier.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag: Option<Lag>,
    /// Nonlinear curve after the hysteresis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asymmetry: Option<Asymmetry>,
    /// Temperature profile, its effect on the gain, and its measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Temperature>,
    /// Slow motion after a change of the drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub creep: Option<Creep>,
    /// External force, its effect on the displacement, and its measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load: Option<Load>,
    /// Structural modes, one section `[[mode]]` each. The rest of the gain acts without dynamics.
    #[serde(default, rename = "mode", skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<Mode>,
    /// Mechanical stops.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub saturation: Option<Saturation>,
    /// Drift of the sensor's zero with the lab clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<Drift>,
    /// Periodic disturbance of the sensor, on the lab clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interference: Option<Interference>,
    /// Disturbances that are not effects, one section `[[disturbance]]` each.
    #[serde(default, rename = "disturbance", skip_serializing_if = "Vec::is_empty")]
    pub disturbances: Vec<Disturbance>,
}

impl PlantConfig {
    /// Returns an actuator and its sensor without effects.
    #[must_use]
    pub const fn bare(seed: u64, actuator: Actuator, sensor: Sensor) -> Self {
        Self {
            seed,
            noise_seed: None,
            actuator,
            sensor,
            viscosity: None,
            delay: None,
            lag: None,
            asymmetry: None,
            temperature: None,
            creep: None,
            load: None,
            modes: Vec::new(),
            saturation: None,
            drift: None,
            interference: None,
            disturbances: Vec::new(),
        }
    }

    /// Returns the seed of the noise.
    pub(super) fn noise(&self) -> u64 {
        self.noise_seed.unwrap_or(self.seed)
    }

    /// Returns the names of the active effects, in the order of the chain.
    ///
    /// A recorded temperature without influence, the hysteresis itself and disturbances are not effects.
    #[must_use]
    pub fn effects(&self) -> Vec<&'static str> {
        let on = [
            ("delay", self.delay.is_some()),
            ("lag", self.lag.is_some()),
            ("asymmetry", self.asymmetry.is_some()),
            ("rate-dependence", self.viscosity.is_some()),
            ("temperature", self.temperature.as_ref().is_some_and(|t| t.per_k != 0.0)),
            ("creep", self.creep.is_some()),
            ("load", self.load.is_some()),
            ("resonance", !self.modes.is_empty()),
            ("saturation", self.saturation.is_some()),
            ("drift", self.drift.is_some()),
            ("interference", self.interference.is_some()),
        ];
        on.into_iter().filter(|&(_, on)| on).map(|(name, _)| name).collect()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A linear plant with 0.1 µm/V, without noise, and with a converter of negligible quantisation.
    pub(crate) fn clean() -> PlantConfig {
        let actuator = Actuator {
            min_v: 0.0,
            max_v: 100.0,
            rest_v: 0.0,
            gain_um_per_v: 0.1,
            loop_share: 0.0,
            bed: Bed::Relays,
            relays: 2000,
        };
        let sensor = Sensor { range_um: [-20.0, 40.0], bits: 48, noise_um: 0.0, offset_um: 0.0, max_rate_hz: 20_000.0 };
        PlantConfig::bare(1, actuator, sensor)
    }
}
