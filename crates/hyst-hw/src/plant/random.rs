//! Actuators of an ordinary kind, drawn from a seed.

use super::EFFECTS;
use super::config::{
    Actuator, Creep, Delay, Drift, Interference, Lag, Mode, PlantConfig, Sensor, Temperature, TemperatureShape,
};
use super::error::ConfigError;
use super::rng::{Draws, Purpose};

impl PlantConfig {
    /// An ordinary piezo actuator with one effect, or two in one case of five; seed by seed the same for ever.
    ///
    /// The number and kind of the effects come from a stream of their own; everything else is as
    /// in [`random_with`](Self::random_with).
    #[must_use]
    pub fn random(seed: u64) -> Self {
        let mut draws = Draws::new(plant_seed(seed), Purpose::Effects);
        let two = draws.unit() < 0.2;
        let first = draws.index(EFFECTS.len());
        // A step of 1 to 6 around the list of 7 is never the first again.
        let second = (first + 1 + draws.index(EFFECTS.len() - 1)) % EFFECTS.len();
        draw(seed, |name| name == EFFECTS[first] || (two && name == EFFECTS[second]))
    }

    /// An ordinary piezo actuator with the effects of the names given, in any order; none is allowed.
    ///
    /// 100 to 150 V, 10 to 40 µm, a loop that opens by 10 to 15 % of the span, noise of 0.03 % of
    /// the span at 16 bits. Strengths are ordinary and well above the noise. All values are drawn for every
    /// set, in a fixed order, and those of absent effects put aside: the same seed is the same actuator
    /// whatever its effects. The plant's seed is `seed` without its top bit, which TOML cannot hold.
    ///
    /// The temperature is recorded when it is among the effects, and in half of the other cases,
    /// where it wanders by a few kelvin without influence.
    ///
    /// # Errors
    /// When a name is not in [`EFFECTS`].
    pub fn random_with(seed: u64, effects: &[&str]) -> Result<Self, ConfigError> {
        match effects.iter().find(|name| !EFFECTS.contains(name)) {
            Some(name) => Err(ConfigError::UnknownEffect { name: (*name).to_owned() }),
            None => Ok(draw(seed, |name| effects.contains(&name))),
        }
    }
}

fn plant_seed(seed: u64) -> u64 {
    seed & (u64::MAX >> 1)
}

/// Draws every parameter, in an order that is part of the promise "same seed, same plant": new
/// draws are added at the end only.
fn draw(seed: u64, has: impl Fn(&str) -> bool) -> PlantConfig {
    let seed = plant_seed(seed);
    let mut draws = Draws::new(seed, Purpose::Parameters);
    let max_v = [100.0, 120.0, 120.0, 150.0][draws.index(4)];
    let mut between = |low, high| rounded(draws.between(low, high));
    let span = between(10.0, 40.0);
    let actuator = Actuator {
        min_v: 0.0,
        max_v,
        rest_v: 0.0,
        gain_um_per_v: rounded(span / max_v),
        loop_share: between(0.10, 0.15),
        relays: between(12_000.0, 18_000.0) as usize,
    };
    let sensor = Sensor {
        // Room for overshoot and for minutes of drift either way.
        range_um: [rounded(-0.8 * span), rounded(1.8 * span)],
        bits: 16,
        noise_um: rounded(0.0003 * span),
        offset_um: rounded(span * between(-0.1, 0.1)),
        max_rate_hz: 20_000.0,
    };
    let delay = Delay { seconds: between(0.001, 0.004) };
    let lag = Lag { seconds: between(0.001, 0.005) };
    let creep = Creep {
        strength: between(0.06, 0.12),
        tau_min_s: 0.05,
        tau_max_s: 80.0,
        exponent: between(-0.15, 0.15),
        elements: 60,
    };
    let first_hz = between(60.0, 150.0);
    let modes = [
        Mode { hz: first_hz, damping: between(0.01, 0.06), gain: between(0.8, 0.95) },
        Mode { hz: rounded(first_hz * between(2.5, 4.0)), damping: between(0.01, 0.06), gain: between(0.01, 0.05) },
    ];
    let drift = Drift { um_per_s: rounded(span * between(0.01, 0.03) / 40.0 * sign(between(-1.0, 1.0))) };
    let interference = Interference {
        amplitude_um: rounded(span * between(0.003, 0.01)),
        hz: between(20.0, 120.0),
        phase_rad: between(0.0, std::f64::consts::TAU),
    };
    let reference_degc = between(20.0, 25.0);
    let temperature = Temperature {
        per_k: between(0.003, 0.008),
        reference_degc,
        mean_degc: rounded(reference_degc + between(-2.0, 2.0)),
        swing_k: between(8.0, 12.0),
        // Within a record of 40 s the temperature runs through most of its swing.
        period_s: Some(between(30.0, 60.0)),
        shape: if between(0.0, 1.0) < 0.5 { TemperatureShape::Sine } else { TemperatureShape::Wander },
        recorded: true,
        noise_k: between(0.01, 0.04),
    };
    let idle_swing_k = between(1.0, 4.0);
    let idle_period_s = between(60.0, 200.0);
    let recorded_without_effect = between(0.0, 1.0) < 0.5;
    let idle = Temperature {
        per_k: 0.0,
        swing_k: idle_swing_k,
        period_s: Some(idle_period_s),
        shape: TemperatureShape::Wander,
        ..temperature.clone()
    };
    PlantConfig {
        seed,
        actuator,
        sensor,
        viscosity: None,
        delay: has("delay").then_some(delay),
        lag: has("lag").then_some(lag),
        temperature: if has("temperature") { Some(temperature) } else { recorded_without_effect.then_some(idle) },
        creep: has("creep").then_some(creep),
        modes: if has("resonance") { modes.to_vec() } else { Vec::new() },
        drift: has("drift").then_some(drift),
        interference: has("interference").then_some(interference),
    }
}

/// Four significant digits, so that the file is pleasant to read; decimal text and back is exact.
fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

fn sign(x: f64) -> f64 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::Plant;
    use super::*;

    #[test]
    fn every_seed_is_a_valid_plant_that_its_file_reproduces() {
        for seed in (0..150).chain([u64::MAX]) {
            let config = PlantConfig::random(seed);
            Plant::new(config.clone()).unwrap();
            assert_eq!(PlantConfig::from_toml(&config.to_toml().unwrap()).unwrap(), config);
            assert!((1..=2).contains(&config.effects().len()), "{seed}: {:?}", config.effects());
        }
    }

    #[test]
    fn every_effect_and_pairs_come_up() {
        let drawn: Vec<_> = (0..300).map(|seed| PlantConfig::random(seed).effects()).collect();
        for name in EFFECTS {
            let count = drawn.iter().filter(|effects| effects.contains(&name)).count();
            assert!(count > 20, "{name}: {count}");
        }
        let pairs = drawn.iter().filter(|effects| effects.len() == 2).count();
        assert!((30..=90).contains(&pairs), "{pairs}");
    }

    #[test]
    fn effects_are_as_asked_and_change_nothing_else() {
        let bare = PlantConfig::random_with(12, &[]).unwrap();
        assert!(bare.effects().is_empty());
        let all = PlantConfig::random_with(12, &EFFECTS).unwrap();
        assert_eq!(all.effects(), EFFECTS);
        assert_eq!((&bare.actuator, &bare.sensor), (&all.actuator, &all.sensor));
        let some = PlantConfig::random_with(12, &["drift", "lag"]).unwrap();
        assert_eq!(some.effects(), ["lag", "drift"]);
        assert_eq!((some.lag, some.drift), (all.lag, all.drift));
    }

    #[test]
    fn unknown_effect_is_named_with_the_choice() {
        let error = PlantConfig::random_with(1, &["creep", "magic"]).unwrap_err().to_string();
        assert!(error.contains("magic") && error.contains("interference"), "{error}");
    }

    #[test]
    fn temperature_is_recorded_with_its_effect_and_in_half_of_the_other_cases() {
        let idle = (0..200).filter(|s| PlantConfig::random_with(*s, &["lag"]).unwrap().temperature.is_some());
        assert!((70..=130).contains(&idle.count()));
        assert!(
            (0..50).all(|s| { PlantConfig::random_with(s, &["temperature"]).unwrap().temperature.unwrap().recorded })
        );
    }
}
