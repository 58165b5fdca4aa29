//! Random actuators with a disturbance that is not an effect.

use super::config::{Disturbance, Load, LoadShape, PlantConfig, Temperature, TemperatureShape};
use super::error::ConfigError;
use super::random::{rounded, sign};
use super::rng::{Draws, Purpose};

impl PlantConfig {
    /// Returns the actuator of [`random_with`](Self::random_with) with one disturbance and no effects.
    ///
    /// # Errors
    /// If the kind is not in [`DISTURBANCES`](crate::DISTURBANCES).
    pub fn disturbed(seed: u64, kind: &str) -> Result<Self, ConfigError> {
        Self::random_with(seed, &[])?.with_disturbance(kind)
    }

    /// Adds a disturbance of typical strength, well above the noise: 0.5 to 3 % of the span.
    ///
    /// A jump and a step of the gain occur 8 to 28 s after lab time 0. A slew limit is 12 to 40 voltage spans per
    /// second. The values come from the plant's seed and are drawn for every kind, so a jump and a step of the gain
    /// have the same time. A hidden load or temperature replaces that of the plant.
    ///
    /// # Errors
    /// If the kind is not in [`DISTURBANCES`](crate::DISTURBANCES).
    pub fn with_disturbance(mut self, kind: &str) -> Result<Self, ConfigError> {
        let mut draws = Draws::new(self.seed, Purpose::Disturbance);
        let mut between = |low, high| draws.between(low, high);
        let (min_v, stroke_v) = (self.actuator.min_v, self.actuator.max_v - self.actuator.min_v);
        let span = self.actuator.gain_um_per_v * stroke_v;
        let um = rounded(span * between(0.005, 0.03));
        let way = sign(between(-1.0, 1.0));
        let at_s = rounded(between(8.0, 28.0));
        let share = rounded(way * between(0.01, 0.03));
        let (seconds, every_s) = (rounded(between(0.05, 0.3)), rounded(between(1.5, 5.0)));
        let wander_s = rounded(between(6.0, 15.0));
        let at_v = rounded(min_v + stroke_v * between(0.3, 0.7));
        let (newtons, period_s) = (rounded(between(1.0, 5.0)), rounded(between(3.0, 20.0)));
        let (swing_k, swing_s) = (rounded(between(3.0, 6.0)), rounded(between(15.0, 40.0)));
        let v_per_s = rounded(stroke_v * between(12.0, 40.0));
        let disturbance = match kind {
            "jump" => Disturbance::Jump { um: way * um, at_s },
            "gain-step" => Disturbance::GainStep { share, at_s },
            // Noise reaches about three times its standard deviation.
            "bursts" => Disturbance::Bursts { um: rounded(0.5 * um), seconds, every_s },
            "wander" => Disturbance::Wander { um, period_s: wander_s },
            "slip" => Disturbance::Slip { um, at_v },
            "slew-limit" => Disturbance::SlewLimit { v_per_s },
            "hidden-load" => {
                let shape = LoadShape::Wander;
                let um_per_n = rounded(um / newtons);
                self.load = Some(Load { newtons, um_per_n, period_s, shape, recorded: false, noise_n: 0.0 });
                return Ok(self);
            }
            "hidden-temperature" => {
                let mean = self.temperature.map_or(22.0, |temperature| temperature.mean_degc);
                self.temperature = Some(Temperature {
                    // The whole swing changes the displacement at the top of the stroke by twice `um`.
                    per_k: rounded(2.0 * um / (span * swing_k)),
                    reference_degc: mean,
                    mean_degc: mean,
                    swing_k,
                    period_s: Some(swing_s),
                    shape: TemperatureShape::Wander,
                    recorded: false,
                    noise_k: 0.0,
                });
                return Ok(self);
            }
            _ => return Err(ConfigError::UnknownDisturbance { kind: kind.to_owned() }),
        };
        self.disturbances.push(disturbance);
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DISTURBANCES, Plant};
    use super::*;
    use crate::{Daq, Sample};

    /// Returns a record at 200 Hz: 36 s of a sine of 1 Hz over the whole range, then 1 s of 20 Hz.
    fn record(config: &PlantConfig) -> Vec<Sample> {
        let mut plant = Plant::new(config.clone()).unwrap();
        plant.start(200.0).unwrap();
        let top = config.actuator.max_v;
        let volts: Vec<f64> = (1..=7200)
            .chain((0..4000).step_by(20))
            .map(|k| 0.5 * top * (1.0 - (0.01 * std::f64::consts::PI * f64::from(k)).cos()))
            .collect();
        let mut samples = Vec::new();
        plant.exchange(&volts, &mut samples).unwrap();
        samples
    }

    #[test]
    fn every_kind_exceeds_the_noise_and_is_not_an_effect() {
        for (seed, kind) in (0..6).flat_map(|seed| DISTURBANCES.map(|kind| (seed, kind))) {
            let disturbed = PlantConfig::disturbed(seed, kind).unwrap();
            assert_eq!(PlantConfig::from_toml(&disturbed.to_toml().unwrap()).unwrap(), disturbed);
            let calm = PlantConfig::random_with(seed, &[]).unwrap();
            assert_eq!((&disturbed.actuator, &disturbed.sensor), (&calm.actuator, &calm.sensor));
            let span = calm.actuator.gain_um_per_v * calm.actuator.max_v;
            let (with, without) = (record(&disturbed), record(&calm));
            let added: Vec<f64> = with.iter().zip(&without).map(|(a, b)| a.output - b.output).collect();
            // A fit removes a constant offset, so only changes count.
            let mean = added.iter().sum::<f64>() / added.len() as f64;
            let rms = (added.iter().map(|y| (y - mean) * (y - mean)).sum::<f64>() / added.len() as f64).sqrt();
            let most = added.iter().fold(0.0, |most: f64, y| most.max((y - mean).abs()));
            assert!(rms > 2.0 * calm.sensor.noise_um, "{kind}, seed {seed}: {} of the span", rms / span);
            // The error of a slew-limited amplifier may be larger, because it is far behind the drive.
            assert!(
                kind == "slew-limit" || (0.003..0.08).contains(&(most / span)),
                "{kind}, seed {seed}: {}",
                most / span
            );
            assert!(with.iter().all(|s| s.load_n.is_none()));
            assert!(kind != "hidden-temperature" || with.iter().all(|s| s.temperature_degc.is_none()));
            let hidden = kind.strip_prefix("hidden-");
            assert_eq!(disturbed.effects(), hidden.as_slice());
        }
    }

    #[test]
    fn a_plant_may_have_effects_and_several_disturbances() {
        let config = PlantConfig::random_with(4, &["creep", "load"]).unwrap();
        let config = config.with_disturbance("jump").unwrap().with_disturbance("wander").unwrap();
        assert_eq!((config.effects(), config.disturbances.len()), (vec!["creep", "load"], 2));
        assert!(config.load.as_ref().unwrap().recorded);
        assert!(!config.with_disturbance("hidden-load").unwrap().load.unwrap().recorded);
        let error = PlantConfig::disturbed(4, "ghost").unwrap_err().to_string();
        assert!(error.contains("ghost") && error.contains("hidden-temperature"), "{error}");
    }
}
