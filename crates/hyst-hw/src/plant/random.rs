//! Random actuators with typical parameters.

use super::asymmetry::Curve;
use super::config::{
    Actuator, Asymmetry, Bed, Creep, Delay, Drift, Interference, Lag, Load, LoadShape, Mode, PlantConfig, Saturation,
    Sensor, Temperature, TemperatureShape, Viscosity,
};
use super::effects::EFFECTS;
use super::error::ConfigError;
use super::hysteresis::Hysteresis;
use super::rng::{Draws, Purpose};

/// The effects among which [`PlantConfig::random`] chooses.
///
/// A change of this list would change the plants of all seeds.
pub(super) const RANDOM_EFFECTS: [&str; 7] =
    ["delay", "lag", "temperature", "creep", "resonance", "drift", "interference"];

impl PlantConfig {
    /// Returns a typical piezo actuator with one effect (in 80 % of the cases) or two.
    ///
    /// A seed always gives the same actuator.
    ///
    /// Asymmetry, rate dependence, load and saturation are not among the effects. Number and kind of the effects have
    /// their own random stream; all other values are as in [`random_with`](Self::random_with).
    #[must_use]
    pub fn random(seed: u64) -> Self {
        let mut draws = Draws::new(plant_seed(seed), Purpose::Effects);
        let two = draws.unit() < 0.2;
        let first = draws.index(RANDOM_EFFECTS.len());
        // A step of 1 to 6 in the list of 7 never returns to the first effect.
        let second = (first + 1 + draws.index(RANDOM_EFFECTS.len() - 1)) % RANDOM_EFFECTS.len();
        draw(Bed::Relays, seed, |name| name == RANDOM_EFFECTS[first] || (two && name == RANDOM_EFFECTS[second]))
    }

    /// Returns a typical piezo actuator with the named effects, in any order; the list may be empty.
    ///
    /// The actuator has 100 to 150 V, 10 to 40 µm, a loop with an opening of 10 to 15 % of the span, and noise of
    /// 0.03 % of the span at 16 bits. The effects have typical strengths, well above the noise. All values are always
    /// drawn in the same order, and those of absent effects are discarded. So a seed gives the same actuator for every
    /// list of effects. The plant's seed is `seed` without its highest bit, because TOML integers are signed.
    ///
    /// The temperature is recorded if it is among the effects, and in half of the other cases. There it varies by a few
    /// kelvin without influence.
    ///
    /// # Errors
    /// If a name is not in [`EFFECTS`].
    pub fn random_with(seed: u64, effects: &[&str]) -> Result<Self, ConfigError> {
        Self::random_on(Bed::Relays, seed, effects)
    }

    /// Returns the actuator of [`random_with`](Self::random_with) with another bed.
    ///
    /// A bed of play operators has a tenth as many elements as one of relays.
    ///
    /// # Errors
    /// If a name is not in [`EFFECTS`].
    pub fn random_on(bed: Bed, seed: u64, effects: &[&str]) -> Result<Self, ConfigError> {
        match effects.iter().find(|name| !EFFECTS.contains(name)) {
            Some(name) => Err(ConfigError::UnknownEffect { name: (*name).to_owned() }),
            None => Ok(draw(bed, seed, |name| effects.contains(&name))),
        }
    }
}

fn plant_seed(seed: u64) -> u64 {
    seed & (u64::MAX >> 1)
}

/// Draws all parameters.
///
/// The order of the draws must not change, so that a seed always gives the same plant. Add new draws only at the end.
fn draw(bed: Bed, seed: u64, has: impl Fn(&str) -> bool) -> PlantConfig {
    let seed = plant_seed(seed);
    let mut draws = Draws::new(seed, Purpose::Parameters);
    let max_v = [100.0, 120.0, 120.0, 150.0][draws.index(4)];
    let mut between = |low, high| rounded(draws.between(low, high));
    let span = between(10.0, 40.0);
    let loop_share = between(0.10, 0.15);
    let relays = between(12_000.0, 18_000.0) as usize;
    let actuator = Actuator {
        min_v: 0.0,
        max_v,
        rest_v: 0.0,
        gain_um_per_v: rounded(span / max_v),
        loop_share,
        bed,
        relays: if bed == Bed::Plays { relays / 10 } else { relays },
    };
    let sensor = Sensor {
        // Room for overshoot, and for some minutes of drift in both directions.
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
        // Within a record of 40 s, the temperature covers most of its swing.
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
    let bend = between(0.03, 0.08) * sign(between(-1.0, 1.0));
    let hook = between(-0.03, 0.03);
    let hooked = between(0.0, 1.0) < 0.5;
    let asymmetry = Asymmetry { bend, hook: if hooked { hook } else { 0.0 } };
    // As a share of the voltage span at 20 Hz: the major loop opens 20 to 60 % wider than at low rates.
    let drag = between(0.0265, 0.05);
    let viscosity = Viscosity { volt_seconds: rounded(max_v / 20.0 * drag * drag) };
    let newtons = between(1.0, 5.0);
    let load = Load {
        newtons,
        // At least 0.5 % of the span, which is above the noise.
        um_per_n: f64::max(between(0.02, 0.2), rounded(0.005 * span / newtons)),
        period_s: between(3.0, 20.0),
        shape: [LoadShape::Sine, LoadShape::Wander, LoadShape::Steps][between(0.0, 3.0) as usize % 3],
        recorded: true,
        noise_n: rounded(newtons * between(0.002, 0.01)),
    };
    let cut = span * between(0.03, 0.12);
    let from_the_top = between(0.0, 1.0) < 0.5;
    let knee = span * between(0.01, 0.04);
    let soft = between(0.0, 1.0) < 0.5;
    let asymmetry = has("asymmetry").then_some(asymmetry);
    let saturation = has("saturation").then(|| {
        let (bottom, top) = stroke(seed, &actuator, asymmetry.as_ref());
        Saturation {
            low_um: (!from_the_top).then(|| rounded(bottom + cut)),
            high_um: from_the_top.then(|| rounded(top - cut)),
            knee_um: if soft { rounded(knee) } else { 0.0 },
            ..Saturation::default()
        }
    });
    PlantConfig {
        viscosity: has("rate-dependence").then_some(viscosity),
        asymmetry,
        load: has("load").then_some(load),
        saturation,
        delay: has("delay").then_some(delay),
        lag: has("lag").then_some(lag),
        temperature: if has("temperature") { Some(temperature) } else { recorded_without_effect.then_some(idle) },
        creep: has("creep").then_some(creep),
        modes: if has("resonance") { modes.to_vec() } else { Vec::new() },
        drift: has("drift").then_some(drift),
        interference: has("interference").then_some(interference),
        ..PlantConfig::bare(seed, actuator, sensor)
    }
}

/// Returns the lower and upper end of the slow major loop (µm).
fn stroke(seed: u64, actuator: &Actuator, asymmetry: Option<&Asymmetry>) -> (f64, f64) {
    let end = |v| asymmetry.map_or(v, |asymmetry| Curve::new(asymmetry, actuator).at(v));
    // `Plant::new` reports a bed that cannot be built.
    Hysteresis::new(seed, actuator, None).map_or((0.0, 0.0), |mut hysteresis| {
        let top = hysteresis.move_to(actuator.max_v);
        (end(hysteresis.move_to(actuator.min_v)), end(top))
    })
}

/// Rounds to four significant digits, so that the file is short.
///
/// Reading the decimal text gives exactly the same value.
pub(super) fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

pub(super) fn sign(x: f64) -> f64 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::Plant;
    use super::*;

    #[test]
    fn every_seed_gives_a_valid_plant_that_its_file_reproduces() {
        for seed in (0..150).chain([u64::MAX]) {
            let config = PlantConfig::random(seed);
            Plant::new(config.clone()).unwrap();
            assert_eq!(PlantConfig::from_toml(&config.to_toml().unwrap()).unwrap(), config);
            assert!((1..=2).contains(&config.effects().len()), "{seed}: {:?}", config.effects());
        }
    }

    #[test]
    fn every_effect_and_pairs_occur() {
        let drawn: Vec<_> = (0..300).map(|seed| PlantConfig::random(seed).effects()).collect();
        for name in RANDOM_EFFECTS {
            let count = drawn.iter().filter(|effects| effects.contains(&name)).count();
            assert!(count > 20, "{name}: {count}");
        }
        let pairs = drawn.iter().filter(|effects| effects.len() == 2).count();
        assert!((30..=90).contains(&pairs), "{pairs}");
    }

    #[test]
    fn the_requested_effects_are_active_and_change_nothing_else() {
        let bare = PlantConfig::random_with(12, &[]).unwrap();
        assert!(bare.effects().is_empty());
        let all = PlantConfig::random_with(12, &EFFECTS).unwrap();
        assert_eq!(all.effects(), EFFECTS);
        assert_eq!((&bare.actuator, &bare.sensor), (&all.actuator, &all.sensor));
        let some = PlantConfig::random_with(12, &["drift", "lag"]).unwrap();
        assert_eq!(some.effects(), ["lag", "drift"]);
        assert_eq!((some.lag, some.drift), (all.lag, all.drift));
        let plays = PlantConfig::random_on(Bed::Plays, 12, &EFFECTS).unwrap();
        assert_eq!(plays.effects(), EFFECTS);
        assert_eq!((plays.actuator.bed, plays.actuator.loop_share), (Bed::Plays, all.actuator.loop_share));
        assert_eq!((plays.load, plays.asymmetry, plays.sensor), (all.load, all.asymmetry, all.sensor));
    }

    #[test]
    fn strengths_are_typical_and_all_kinds_occur() {
        let drawn: Vec<_> = (0..200).map(|seed| PlantConfig::random_with(seed, &EFFECTS).unwrap()).collect();
        for config in &drawn {
            config.validate().unwrap();
            let span = config.actuator.gain_um_per_v * config.actuator.max_v;
            let asymmetry = config.asymmetry.as_ref().unwrap();
            assert!((0.03..=0.08).contains(&asymmetry.bend.abs()) && asymmetry.hook.abs() <= 0.03);
            let load = config.load.as_ref().unwrap();
            assert!(load.recorded && (1.0..=5.0).contains(&load.newtons) && (0.02..=0.2).contains(&load.um_per_n));
            assert!(load.newtons * load.um_per_n > 0.0049 * span && (3.0..=20.0).contains(&load.period_s));
            let stops = config.saturation.as_ref().unwrap();
            assert!(stops.low_um.is_some() != stops.high_um.is_some());
        }
        let count = |has: fn(&PlantConfig) -> bool| drawn.iter().filter(|config| has(config)).count();
        for shape in [LoadShape::Sine, LoadShape::Wander, LoadShape::Steps] {
            let count = drawn.iter().filter(|c| c.load.as_ref().unwrap().shape == shape).count();
            assert!((40..=95).contains(&count), "{shape:?}: {count}");
        }
        for halves in [
            count(|c| c.saturation.as_ref().unwrap().knee_um == 0.0),
            count(|c| c.saturation.as_ref().unwrap().high_um.is_some()),
            count(|c| c.asymmetry.as_ref().unwrap().hook == 0.0),
            count(|c| c.asymmetry.as_ref().unwrap().bend > 0.0),
        ] {
            assert!((70..=130).contains(&halves), "{halves}");
        }
    }

    /// Returns the rising and the falling branch of the major loop at a frequency (Hz).
    ///
    /// The loop is the second period of a sine.
    fn full_loop(config: &PlantConfig, hz: f64) -> (Vec<f64>, Vec<f64>) {
        let mut h = Hysteresis::new(config.seed, &config.actuator, config.viscosity.as_ref()).unwrap();
        let steps = 2000;
        h.set_step(1.0 / (hz * f64::from(steps)));
        let volts = |k: i32| {
            0.5 * config.actuator.max_v * (1.0 - (std::f64::consts::TAU * f64::from(k) / f64::from(steps)).cos())
        };
        let moved: Vec<f64> = (1..=2 * steps).map(|k| h.move_to(volts(k))).collect();
        let half = steps as usize / 2;
        (moved[2 * half - 1..3 * half].to_vec(), moved[3 * half - 1..].iter().rev().copied().collect())
    }

    #[test]
    fn loops_at_20_hz_are_20_to_60_percent_wider() {
        for (seed, bed) in (0..15).flat_map(|seed| [(seed, Bed::Relays), (seed, Bed::Plays)]) {
            let config = PlantConfig::random_on(bed, seed, &["rate-dependence"]).unwrap();
            let opening = |hz| {
                let (rising, falling) = full_loop(&config, hz);
                rising.iter().zip(&falling).map(|(r, f)| f - r).fold(0.0, f64::max)
            };
            let wider = opening(20.0) / opening(0.01) - 1.0;
            assert!((0.15..=0.65).contains(&wider), "{bed:?}, seed {seed}: {wider}");
        }
    }

    #[test]
    fn stops_limit_a_part_of_the_stroke() {
        for (seed, bed) in (0..30).flat_map(|seed| [(seed, Bed::Relays), (seed, Bed::Plays)]) {
            let config = PlantConfig::random_on(bed, seed, &["asymmetry", "saturation"]).unwrap();
            let stops = config.saturation.as_ref().unwrap();
            let (rising, falling) = full_loop(&config, 1.0);
            let curve = Curve::new(config.asymmetry.as_ref().unwrap(), &config.actuator);
            let (bottom, top) = (curve.at(rising[0]), curve.at(falling[falling.len() - 1]));
            let cut = stops.low_um.map_or_else(|| top - stops.high_um.unwrap(), |low| low - bottom) / (top - bottom);
            assert!((0.028..=0.123).contains(&cut), "{bed:?}, seed {seed}: {cut}");
        }
    }

    /// Returns a hash of the files of plants of many seeds.
    fn digest(plant: impl Fn(u64) -> PlantConfig) -> u64 {
        let texts = (0..60).map(|seed| plant(seed).to_toml().unwrap());
        texts
            .flat_map(String::into_bytes)
            .fold(0, |sum: u64, byte| sum.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ u64::from(byte))
    }

    #[test]
    fn the_plants_of_seeds_do_not_change() {
        // The plants of earlier versions must not change: `demo --seed` and every study with a seed depend on them.
        assert_eq!(digest(PlantConfig::random), 4_215_076_879_974_643_906);
        assert_eq!(digest(|seed| PlantConfig::random_with(seed, &RANDOM_EFFECTS).unwrap()), 17_307_077_536_925_047_092);
    }

    #[test]
    fn an_unknown_effect_is_reported_with_the_valid_names() {
        let error = PlantConfig::random_with(1, &["creep", "magic"]).unwrap_err().to_string();
        assert!(error.contains("magic") && error.contains("interference"), "{error}");
    }

    #[test]
    fn the_temperature_is_recorded_with_its_effect_and_in_half_of_the_other_cases() {
        let idle = (0..200).filter(|s| PlantConfig::random_with(*s, &["lag"]).unwrap().temperature.is_some());
        assert!((70..=130).contains(&idle.count()));
        assert!(
            (0..50).all(|s| { PlantConfig::random_with(s, &["temperature"]).unwrap().temperature.unwrap().recorded })
        );
    }
}
