//! Reading and writing the file of a plant.

use super::config::PlantConfig;
use super::error::ConfigError;

impl PlantConfig {
    /// Reads and validates a description.
    ///
    /// # Errors
    /// If the text is not TOML, a field is unknown or missing, or a value is invalid. The message
    /// names the field and states what to give instead.
    pub fn from_toml(text: &str) -> Result<Self, ConfigError> {
        let config: Self = toml::from_str(text).map_err(|error| {
            let compact = |line: &str| line.split_whitespace().collect::<String>();
            let single = |name: &&str| {
                let alone = |line: &str| {
                    [format!("[{name}]"), format!("{name}={{")].iter().any(|s| compact(line).starts_with(s))
                };
                text.lines().any(alone)
            };
            let several = ["mode", "disturbance"].iter().find(|name| single(name));
            let hint = several
                .map(|name| format!("a file may have several of these sections: write [[{name}]], not [{name}]"));
            ConfigError::Syntax(format!("{error}{}", hint.unwrap_or_default()))
        })?;
        config.validate()?;
        Ok(config)
    }

    /// Returns the description as TOML. Reading it back gives exactly the same values.
    ///
    /// # Errors
    /// If a value is invalid (see [`validate`](Self::validate)).
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        self.validate()?;
        toml::to_string(self).map_err(|e| ConfigError::Syntax(e.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::{Bed, Disturbance};
    use super::super::effects::EFFECTS;
    use super::*;

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
        [asymmetry]
        bend = 0.06
        hook = -0.01
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
        [load]
        newtons = 3.0
        um_per_n = 0.1
        period_s = 8.0
        shape = "steps"
        recorded = false
        noise_n = 0.01
        [[mode]]
        hz = 100.0
        damping = 0.02
        gain = 0.9
        [[mode]]
        hz = 350.0
        damping = 0.015
        gain = 0.05
        [saturation]
        low_um = -3.0
        high_um = 25
        knee_um = 0.5
        low_v = -20.0
        high_v = 110.0
        [drift]
        um_per_s = 0.01
        [interference]
        amplitude_um = 0.1
        hz = 50.0
        phase_rad = 0.4
        [[disturbance]]
        kind = "jump"
        um = -0.2
        at_s = 12
        [[disturbance]]
        kind = "gain-step"
        share = 0.02
        at_s = 14.5
        [[disturbance]]
        kind = "bursts"
        um = 0.1
        seconds = 0.2
        every_s = 3.0
        [[disturbance]]
        kind = "wander"
        um = 0.2
        period_s = 10.0
        [[disturbance]]
        kind = "slip"
        um = 0.1
        at_v = 60.0
    "#;

    #[test]
    fn all_sections_survive_writing_and_reading() {
        let config = PlantConfig::from_toml(FULL).unwrap();
        assert_eq!(config.effects(), EFFECTS);
        assert_eq!(config.modes[1].hz, 350.0);
        assert_eq!(config.disturbances[1], Disturbance::GainStep { share: 0.02, at_s: 14.5 });
        let again = PlantConfig::from_toml(&config.to_toml().unwrap()).unwrap();
        assert_eq!(config, again);
    }

    #[test]
    fn a_temperature_without_influence_is_not_an_effect() {
        let config = PlantConfig::from_toml(&FULL.replace("per_k = 0.005", "")).unwrap();
        assert!(!config.effects().contains(&"temperature"));
        assert!(config.temperature.unwrap().recorded);
    }

    #[test]
    fn the_default_bed_consists_of_relays() {
        let relays = PlantConfig::from_toml(FULL).unwrap();
        assert_eq!(relays.actuator.bed, Bed::Relays);
        assert!(!relays.to_toml().unwrap().contains("bed"));
        let plays = PlantConfig::from_toml(&FULL.replace("relays = 12000", "bed = \"plays\"")).unwrap();
        assert_eq!((plays.actuator.bed, plays.actuator.relays), (Bed::Plays, 15_000));
        assert_eq!(PlantConfig::from_toml(&plays.to_toml().unwrap()).unwrap(), plays);
        let unknown = PlantConfig::from_toml(&FULL.replace("relays = 12000", "bed = \"stops\"")).unwrap_err();
        assert!(unknown.to_string().contains("plays"), "{unknown}");
    }

    #[test]
    fn unknown_and_missing_fields_are_named() {
        let unknown = PlantConfig::from_toml(&FULL.replace("per_k", "per_kelvin")).unwrap_err();
        assert!(unknown.to_string().contains("per_kelvin"), "{unknown}");
        let section = PlantConfig::from_toml(&FULL.replace("[drift]", "[drifting]")).unwrap_err();
        assert!(section.to_string().contains("drifting"), "{section}");
        let kind = PlantConfig::from_toml(&FULL.replace("\"slip\"", "\"slide\"")).unwrap_err();
        assert!(kind.to_string().contains("slide") && kind.to_string().contains("wander"), "{kind}");
        let of_another = PlantConfig::from_toml(&FULL.replace("at_v = 60.0", "at_s = 60.0")).unwrap_err();
        assert!(of_another.to_string().contains("at_"), "{of_another}");
        let missing = PlantConfig::from_toml(&FULL.replace("loop_share = 0.13", "")).unwrap_err();
        assert!(missing.to_string().contains("loop_share"), "{missing}");
    }
}
