//! Tests of the whole actuator: clock, reproducibility, order of the effects.

use super::*;
use config::tests::clean;
use config::{Bed, Disturbance};

fn everything() -> PlantConfig {
    PlantConfig::random_with(5, &EFFECTS).unwrap()
}

/// All effects on a bed of play operators, and the disturbances within the first second.
fn disturbed() -> PlantConfig {
    let mut config = PlantConfig::random_on(Bed::Plays, 5, &EFFECTS).unwrap();
    let slip = Disturbance::Slip { um: 0.3, at_v: 40.0 };
    config.disturbances = vec![
        Disturbance::Jump { um: 0.2, at_s: 0.3 },
        Disturbance::GainStep { share: 0.02, at_s: 0.5 },
        Disturbance::Bursts { um: 0.1, seconds: 0.05, every_s: 0.2 },
        Disturbance::Wander { um: 0.2, period_s: 0.8 },
        slip.clone(),
        slip,
    ];
    config
}

/// Returns a hash of all values of samples.
fn digest(samples: &[Sample]) -> u64 {
    let values = samples.iter().flat_map(|s| [Some(s.output), s.temperature_degc, s.load_n]).flatten();
    values.map(f64::to_bits).fold(0, |sum: u64, word| sum.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ word)
}

fn triangle(n: usize, top: f64) -> Vec<f64> {
    (0..n).map(|k| top * (1.0 - (1.0 - (k % 400) as f64 / 200.0).abs())).collect()
}

fn play(plant: &mut Plant, drive: &[f64], block: usize) -> Vec<Sample> {
    let mut samples = Vec::new();
    for part in drive.chunks(block) {
        assert_eq!(plant.exchange(part, &mut samples).unwrap(), part.len());
    }
    samples
}

#[test]
fn the_noise_seed_changes_only_the_noise() {
    let quiet = |mut config: PlantConfig| {
        config.sensor.noise_um = 0.0;
        config.temperature.iter_mut().for_each(|t| t.noise_k = 0.0);
        config.load.iter_mut().for_each(|l| l.noise_n = 0.0);
        config
    };
    let run = |config: PlantConfig| {
        let drive = triangle(400, config.actuator.max_v);
        let mut plant = Plant::new(config).unwrap();
        plant.start(1000.0).unwrap();
        play(&mut plant, &drive, 400)
    };
    let noisy = everything();
    let [one, other] = [None, Some(9)].map(|noise_seed| run(PlantConfig { noise_seed, ..noisy.clone() }));
    assert!(one.iter().zip(&other).all(|(a, b)| a.temperature_degc != b.temperature_degc && a.load_n != b.load_n));
    assert!(one.iter().zip(&other).filter(|(a, b)| a.output != b.output).count() > 300);
    let [one, other] = [None, Some(9)].map(|noise_seed| run(quiet(PlantConfig { noise_seed, ..noisy.clone() })));
    assert_eq!(one, other);
    // Among the disturbances, only the noise of bursts changes.
    let without_bursts = |mut config: PlantConfig| {
        config.disturbances.retain(|d| !matches!(d, Disturbance::Bursts { .. }));
        config
    };
    let noisy = quiet(disturbed());
    let [one, other] = [None, Some(9)].map(|noise_seed| run(PlantConfig { noise_seed, ..noisy.clone() }));
    assert_ne!(one, other);
    let [one, other] =
        [None, Some(9)].map(|noise_seed| run(without_bursts(PlantConfig { noise_seed, ..noisy.clone() })));
    assert_eq!(one, other);
}

#[test]
fn a_seed_gives_the_same_bits_in_any_block_size() {
    let mut slow = everything();
    slow.disturbances = vec![Disturbance::SlewLimit { v_per_s: 300.0 }];
    for config in [everything(), disturbed(), slow] {
        let drive = triangle(1500, config.actuator.max_v);
        let run = |block| {
            let mut plant = Plant::new(config.clone()).unwrap();
            plant.start(1000.0).unwrap();
            let mut samples = play(&mut plant, &drive, block);
            plant.rest(2.5).unwrap();
            samples.extend(play(&mut plant, &drive[..300], block));
            samples
        };
        let whole = run(1000);
        assert_eq!(whole, run(1));
        assert_eq!(whole, run(7));
        assert!(whole.iter().all(|s| s.temperature_degc.is_some() && s.load_n.is_some()));
        let other = Plant::new(PlantConfig { seed: 6, ..config }).map(|mut plant| {
            plant.start(1000.0).unwrap();
            play(&mut plant, &drive, 100)
        });
        assert_ne!(other.unwrap(), whole[..1500]);
    }
}

#[test]
fn samples_of_seeds_do_not_change() {
    // A change of these numbers changes all simulated records of all users.
    let sampled = |config| {
        let mut plant = Plant::new(config).unwrap();
        plant.start(1000.0).unwrap();
        digest(&play(&mut plant, &triangle(700, 100.0), 700))
    };
    assert_eq!(sampled(PlantConfig::random_with(5, &random::RANDOM_EFFECTS).unwrap()), 15_705_684_028_673_275_075);
    assert_eq!(sampled(everything()), 7_009_439_930_234_241_464);
    assert_eq!(sampled(disturbed()), 6_038_666_987_784_956_480);
    assert_eq!(sampled(PlantConfig::random_on(Bed::Plays, 5, &[]).unwrap()), 17_178_083_900_747_677_374);
}

#[test]
fn a_rest_resets_the_actuator_but_not_the_clock() {
    let mut config = clean();
    config.actuator.loop_share = 0.13;
    config.lag = Some(config::Lag { seconds: 0.004 });
    config.creep = Some(config::Creep { strength: 0.1, tau_min_s: 0.05, tau_max_s: 5.0, exponent: 0.0, elements: 20 });
    config.modes = vec![config::Mode { hz: 60.0, damping: 0.01, gain: 0.9 }];
    let mut plant = Plant::new(config).unwrap();
    plant.start(500.0).unwrap();
    let drive = triangle(700, 100.0);
    let first = play(&mut plant, &drive, 64);
    plant.rest(10.0).unwrap();
    assert_eq!(plant.present_v(), 0.0);
    let second = play(&mut plant, &drive, 64);
    assert!(first.iter().zip(&second).all(|(a, b)| a.output == b.output));
    assert!((first[0].time_s - 0.002).abs() < 1e-15);
    assert!((second[0].time_s - (1.4 + 10.0 + 0.002)).abs() < 1e-12);
    plant.stop().unwrap();
    plant.start(500.0).unwrap();
    let third = play(&mut plant, &drive, 64);
    assert!(first.iter().zip(&third).all(|(a, b)| a.output == b.output));
    assert!((third[0].time_s - second[699].time_s - 0.002).abs() < 1e-12);
}

#[test]
fn a_refused_drive_changes_nothing() {
    let drive = triangle(300, everything().actuator.max_v);
    let mut plant = Plant::new(everything()).unwrap();
    let mut calm = plant.clone();
    let mut none = Vec::new();
    assert_eq!(plant.exchange(&[0.0], &mut none), Err(PlantError::NotRunning));
    plant.start(1000.0).unwrap();
    calm.start(1000.0).unwrap();
    let mut samples = play(&mut plant, &drive[..100], 50);
    let top = plant.capabilities().voltage.max_v;
    let refused = plant.exchange(&[1.0, 2.0, top + 0.001, 3.0], &mut none);
    assert!(matches!(refused, Err(PlantError::OutOfRange { index: 2, .. })), "{refused:?}");
    let refused = plant.exchange(&[1.0, f64::NAN], &mut none);
    assert!(matches!(refused, Err(PlantError::NonFinite { index: 1, .. })), "{refused:?}");
    assert!(matches!(plant.rest(-1.0), Err(PlantError::Rest { .. })));
    assert_eq!(plant.start(10.0), Err(PlantError::Running));
    assert!(none.is_empty());
    samples.extend(play(&mut plant, &drive[100..], 50));
    assert_eq!(samples, play(&mut calm, &drive, 300));
}

#[test]
fn rates_outside_the_capabilities_are_refused() {
    let mut plant = Plant::new(clean()).unwrap();
    for rate in [0.0, -5.0, 0.5, 1e9, f64::NAN] {
        assert!(matches!(plant.start(rate), Err(PlantError::Rate { .. })), "{rate}");
    }
    assert_eq!(plant.start(20_000.0), Ok(20_000.0));
}

#[test]
fn a_delay_of_whole_samples_shifts_the_record() {
    let mut config = clean();
    config.actuator.loop_share = 0.12;
    let drive = triangle(900, 90.0);
    let mut prompt = Plant::new(config.clone()).unwrap();
    config.delay = Some(config::Delay { seconds: 0.003 });
    let mut late = Plant::new(config).unwrap();
    prompt.start(1000.0).unwrap();
    late.start(1000.0).unwrap();
    let (prompt, late) = (play(&mut prompt, &drive, 900), play(&mut late, &drive, 900));
    assert!(late[..3].iter().all(|s| s.output.abs() < 1e-9));
    for (a, b) in prompt.iter().zip(&late[3..]) {
        assert_eq!(a.output, b.output);
    }
}

/// 1 % per kelvin above 20 °C, at a constant temperature \[°C\].
fn steady(degc: f64) -> config::Temperature {
    config::Temperature {
        per_k: 0.01,
        reference_degc: 20.0,
        mean_degc: degc,
        swing_k: 0.0,
        period_s: None,
        shape: config::TemperatureShape::Sine,
        recorded: false,
        noise_k: 0.0,
    }
}

#[test]
fn asymmetry_acts_before_the_temperature() {
    let mut config = clean();
    config.actuator.rest_v = 20.0;
    config.asymmetry = Some(config::Asymmetry { bend: 0.08, hook: 0.0 });
    config.temperature = Some(steady(30.0));
    let mut plant = Plant::new(config).unwrap();
    plant.start(100.0).unwrap();
    let [rest, low, middle, high] =
        play(&mut plant, &[20.0, 0.0, 50.0, 100.0], 4).try_into().map(|s: [Sample; 4]| s.map(|s| s.output)).unwrap();
    assert!(rest.abs() < 1e-9);
    assert!((high - low - 10.0 * 1.1).abs() < 1e-9, "{low} {high}");
    // The displacement at half voltage is bend/8 of the stroke of 10 µm lower.
    let sag = 0.5 * (low + high) - middle;
    assert!((sag / (10.0 * 1.1 * 0.08 / 8.0) - 1.0).abs() < 1e-3, "{sag}");
}

#[test]
fn temperature_scales_the_displacement() {
    let mut config = clean();
    config.temperature = Some(steady(25.0));
    let mut plant = Plant::new(config).unwrap();
    assert!(!plant.capabilities().temperature);
    plant.start(100.0).unwrap();
    let samples = play(&mut plant, &[50.0], 1);
    assert!((samples[0].output - 5.0 * 1.05).abs() < 1e-9);
    assert_eq!(samples[0].temperature_degc, None);
}

fn loaded(shape: config::LoadShape, recorded: bool) -> PlantConfig {
    let load = config::Load { newtons: 4.0, um_per_n: 0.1, period_s: 3.0, shape, recorded, noise_n: 0.0 };
    PlantConfig { load: Some(load), ..clean() }
}

#[test]
fn a_load_adds_its_deflection_and_is_recorded() {
    for shape in [config::LoadShape::Sine, config::LoadShape::Wander, config::LoadShape::Steps] {
        let mut plant = Plant::new(loaded(shape, true)).unwrap();
        assert!(plant.capabilities().load);
        plant.start(200.0).unwrap();
        let drive = triangle(2000, 80.0);
        let samples = play(&mut plant, &drive, 100);
        let loads: Vec<f64> = samples.iter().map(|s| s.load_n.unwrap()).collect();
        for (sample, load) in samples.iter().zip(&loads) {
            assert!((sample.output - 0.1 * sample.drive_v - 0.1 * load).abs() < 1e-9, "{sample:?}");
        }
        let (low, high) = loads.iter().fold((f64::MAX, f64::MIN), |(l, h), f| (l.min(*f), h.max(*f)));
        assert!(high - low > 1.0, "{low} {high}");
        let mut hidden = Plant::new(loaded(shape, false)).unwrap();
        assert!(!hidden.capabilities().load);
        hidden.start(200.0).unwrap();
        let unseen = play(&mut hidden, &drive, 100);
        assert!(unseen.iter().zip(&samples).all(|(a, b)| a.load_n.is_none() && a.output == b.output));
    }
}

#[test]
fn a_rest_begins_in_equilibrium_with_the_present_load() {
    let mut config = loaded(config::LoadShape::Sine, true);
    config.modes = vec![config::Mode { hz: 50.0, damping: 0.01, gain: 1.0 }];
    let mut plant = Plant::new(config).unwrap();
    plant.start(1000.0).unwrap();
    for seconds in [0.0, 0.4, 1.0] {
        plant.rest(seconds).unwrap();
        for sample in play(&mut plant, &[0.0; 200], 200) {
            // A load step would excite the mode to twice its deflection.
            assert!((sample.output - 0.1 * sample.load_n.unwrap()).abs() < 0.003, "{sample:?}");
        }
    }
}

#[test]
fn stops_limit_the_motion_but_not_the_drift_of_the_sensor() {
    let mut config = clean();
    config.saturation = Some(config::Saturation { low_um: Some(1.0), high_um: Some(8.0), ..Default::default() });
    config.drift = Some(config::Drift { um_per_s: 0.5 });
    config.sensor.offset_um = -2.0;
    let mut plant = Plant::new(config).unwrap();
    plant.start(10.0).unwrap();
    for sample in play(&mut plant, &triangle(400, 100.0), 400) {
        let expected = (0.1 * sample.drive_v).clamp(1.0, 8.0) + 0.5 * sample.time_s - 2.0;
        assert!((sample.output - expected).abs() < 1e-9, "{sample:?}");
    }
}

#[test]
fn the_motion_ends_where_the_amplifier_does() {
    let mut config = clean();
    config.saturation = Some(config::Saturation { high_v: Some(70.0), ..Default::default() });
    let mut plant = Plant::new(config).unwrap();
    plant.start(10.0).unwrap();
    for sample in play(&mut plant, &triangle(400, 100.0), 400) {
        let expected = 0.1 * sample.drive_v.min(70.0);
        assert!((sample.output - expected).abs() < 1e-9, "{sample:?}");
    }
}

#[test]
fn disturbances_follow_the_lab_clock() {
    let mut config = clean();
    config.disturbances = vec![
        Disturbance::GainStep { share: 0.1, at_s: 2.05 },
        Disturbance::Jump { um: 0.5, at_s: 4.05 },
        Disturbance::GainStep { share: -0.5, at_s: 6.05 },
    ];
    assert!(config.effects().is_empty());
    let mut plant = Plant::new(config).unwrap();
    plant.start(10.0).unwrap();
    let mut samples = play(&mut plant, &[50.0; 30], 7);
    plant.rest(2.0).unwrap();
    samples.extend(play(&mut plant, &[50.0; 30], 7));
    for Sample { time_s, output, .. } in samples {
        let gain = [1.0, 1.1, 1.1, 0.55][((time_s - 0.05) / 2.0) as usize];
        let jump = if time_s > 4.0 { 0.5 } else { 0.0 };
        assert!((output - 5.0 * gain - jump).abs() < 1e-9, "{time_s}: {output}");
    }
}

#[test]
fn the_smallest_slew_limit_of_the_amplifier_applies() {
    let mut config = clean();
    config.disturbances = [400.0, 250.0].map(|v_per_s| Disturbance::SlewLimit { v_per_s }).to_vec();
    let mut plant = Plant::new(config).unwrap();
    plant.start(100.0).unwrap();
    for (k, sample) in (1..).zip(play(&mut plant, &[50.0; 40], 7)) {
        let expected = 0.1 * f64::min(2.5 * f64::from(k), 50.0);
        assert!((sample.output - expected).abs() < 1e-9, "{k}: {}", sample.output);
    }
}

#[test]
fn a_displacement_outside_the_converters_range_is_an_error() {
    let mut config = clean();
    config.sensor.range_um = [-1.0, 5.0];
    let mut plant = Plant::new(config).unwrap();
    plant.start(100.0).unwrap();
    let mut samples = Vec::new();
    let error = plant.exchange(&[10.0, 80.0], &mut samples).unwrap_err();
    assert!(error.to_string().contains("sensor.range_um"), "{error}");
    // The sample before the error is kept.
    assert_eq!(samples.len(), 1);
}
