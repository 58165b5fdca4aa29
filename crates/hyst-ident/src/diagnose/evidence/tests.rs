//! Evidence on records with a known truth: the prediction of a model with one more effect and noise.

use crate::stop::Stop;
use hyst_core::{
    AsymmetryParams, CreepParams, DelayParams, DriftParams, InterferenceParams, LagParams, LoadParams, PiParams,
    ResonanceParams, SaturationParams, TemperatureParams, ViscousPiParams,
};
use rand::{Rng, SeedableRng};

use super::*;
use crate::excite::{Identification, Limits};
use crate::model::{Base, Channel, Effect, Effects, Model};
use crate::record::{Columns, Record};
use crate::simulate::{Simulation, Zero};

/// Columns of a drive in segments, one second apart.
pub(super) fn samples_of(period: f64, segments: &[Vec<f64>]) -> Samples {
    let mut samples = Samples {
        period,
        periods: Vec::new(),
        time: Vec::new(),
        input: Vec::new(),
        output: Vec::new(),
        temperature: None,
        load: None,
        segments: Vec::new(),
        pasts: Vec::new(),
        file_of_segment: vec![0; segments.len()],
        settling: Vec::new(),
        falls: false,
        blind: Vec::new(),
        stop: Stop::default(),
    };
    let mut start = 0.0;
    for segment in segments {
        let first = samples.input.len();
        samples.input.extend(segment);
        samples.time.extend((0..segment.len()).map(|k| start + k as f64 * period));
        samples.segments.push(first..first + segment.len());
        start += segment.len() as f64 * period + 1.0;
    }
    samples.output = vec![0.0; samples.input.len()];
    samples.settling = vec![false; samples.input.len()];
    samples.blind = samples.settling.clone();
    samples
}

/// White noise with standard deviation 1.
pub(super) fn noise(seed: u64) -> impl Iterator<Item = f64> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    std::iter::repeat_with(move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)
}

const NOISE: f64 = 0.005;

fn pi() -> PiParams<Vec<f64>> {
    PiParams { gain: 0.15, thresholds: vec![5.0, 15.0, 30.0], weights: vec![0.02, 0.015, 0.01] }
}

/// Returns a model with this base and these effects.
fn actuator(base: Base, effects: Effects) -> Model {
    let channel =
        |column: &str, unit: &str| Channel { column: column.into(), unit: unit.into(), low: 0.0, high: 120.0 };
    Model {
        between_samples: crate::BetweenSamples::Linear,
        input: channel("voltage_v", "V"),
        output: channel("displacement_um", "um"),
        falls: false,
        zero: 0.4,
        base,
        effects,
        std_errors: Default::default(),
        undetermined: Default::default(),
        recorded_at_hz: 1000.0,
        rmse: None,
        fitted_on: Vec::new(),
        seed: 1,
        version: String::new(),
    }
}

/// Collects the evidence for one effect on the model's own prediction for the identification drive.
fn evidence(model: &Model, effect: Effect) -> Evidence {
    let limits = Limits { rate_hz: 1000.0, lo_v: 0.0, hi_v: 120.0, slew_v_per_s: None };
    let drive = Identification::at_rate(1000.0, 3).drive(&limits).unwrap();
    let n = drive.voltage().len();
    let labels: Vec<i64> = (0..).zip(drive.segments()).flat_map(|(i, s)| std::iter::repeat_n(i, s.len())).collect();
    let time: Vec<f64> = (0..n).map(|k| 1e-3 * k as f64 + labels[k] as f64).collect();
    let slow = |k: usize, hz: f64| (std::f64::consts::TAU * hz * time[k]).sin();
    let columns = |output: Vec<f64>| Columns {
        name: "train".into(),
        segment: Some(labels.clone()),
        input: Some(drive.voltage().to_vec()),
        output: Some((OutputUnit::Micrometre, output)),
        temperature: Some((0..n).map(|k| 24.0 + 3.0 * slow(k, 0.03)).collect()),
        load: Some((0..n).map(|k| 2.0 + 2.0 * slow(k, 0.11)).collect()),
        time: time.clone(),
        ..Columns::default()
    };
    let blank = Record::from_samples(columns(vec![0.0; n])).unwrap();
    let clean = simulate(model, &blank, Zero::None).unwrap().predicted;
    let train =
        Record::from_samples(columns(clean.iter().zip(noise(7)).map(|(y, e)| y + NOISE * e).collect())).unwrap();
    let before = simulate(&effects::of(effect).without(model), &train, Zero::None).unwrap();
    let after = simulate(model, &train, Zero::None).unwrap();
    let material = Material {
        extended: model,
        named: &[effect],
        train: &train,
        test: Some(&train),
        before: &before,
        after: &after,
        tests: Some(&(before.clone(), after.clone())),
        zero: Zero::None,
        noise: NOISE,
    };
    collect(&material).unwrap()
}

/// Returns the curves (x, y) of the effect's picture with this title, the one without the effect first.
fn curves(evidence: &Evidence, effect: Effect, title: &str) -> Vec<Vec<(f64, f64)>> {
    let found = evidence.pictures.iter().find(|p| p.effect == Some(effect) && p.title == title);
    let picture = found.unwrap_or_else(|| panic!("no {title:?} among {:?}", titles(evidence)));
    assert!(!picture.caption.is_empty() && picture.curves.iter().all(|c| c.x.len() <= MOST_POINTS));
    picture.curves.iter().map(|c| c.x.iter().copied().zip(c.y.iter().copied()).collect()).collect()
}

fn titles(evidence: &Evidence) -> Vec<&str> {
    evidence.pictures.iter().map(|p| p.title.as_str()).collect()
}

/// Returns the least-squares slope of y over x.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0 / n, s.1 + p.1 / n));
    let (xy, xx) = points.iter().fold((0.0, 0.0), |s, p| (s.0 + (p.0 - x) * (p.1 - y), s.1 + (p.0 - x).powi(2)));
    xy / xx
}

fn close(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{found}, expected {expected}");
}

/// Asserts that every point is within `room` of zero.
fn level(points: &[(f64, f64)], room: f64) {
    assert!(!points.is_empty() && points.iter().all(|p| p.1.abs() < room), "{points:?}");
}

/// Asserts that the points of a curve are within `room` of those of another at the same positions.
fn along(points: &[(f64, f64)], other: &[(f64, f64)], room: f64) {
    assert_eq!(points.len(), other.len());
    assert!(points.iter().zip(other).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < room), "{points:?} {other:?}");
}

#[test]
fn a_delay_shifts_the_phase_and_not_the_gain() {
    let effects = Effects { delay: Some(DelayParams { seconds: 0.004 }), ..Effects::default() };
    let found = evidence(&actuator(Base::Pi(pi()), effects), Effect::Delay);
    let phase = curves(&found, Effect::Delay, "Phase over frequency");
    let high: Vec<(f64, f64)> = phase[0].iter().copied().filter(|p| p.0 > 5.0 && p.0 < 45.0).collect();
    assert!(high.len() > 5, "{phase:?}");
    close(slope(&high), -360.0 * 0.004, 0.05);
    level(&phase[1], 1.5);
    along(&phase[0], &phase[2], 3.0);
    let gain = curves(&found, Effect::Delay, "Gain over frequency");
    level(&gain[0].iter().filter(|p| p.0 < 45.0).map(|p| (p.0, p.1 - 1.0)).collect::<Vec<_>>(), 0.05);
}

#[test]
fn a_lag_lowers_the_gain() {
    let effects = Effects { lag: Some(LagParams { seconds: 0.008 }), ..Effects::default() };
    let found = evidence(&actuator(Base::Pi(pi()), effects), Effect::Lag);
    let at_corner = |points: &[(f64, f64)]| {
        points.iter().min_by(|a, b| (a.0 - 20.0).abs().total_cmp(&(b.0 - 20.0).abs())).copied().unwrap()
    };
    // 1/(2π 8 ms) = 19.9 Hz.
    let (_, phase) = at_corner(&curves(&found, Effect::Lag, "Phase over frequency")[0]);
    close(phase, -45.0, 0.1);
    let phases = curves(&found, Effect::Lag, "Phase over frequency");
    along(&phases[0], &phases[2], 3.0);
    let (_, gain) = at_corner(&curves(&found, Effect::Lag, "Gain over frequency")[0]);
    close(gain, 0.5f64.sqrt(), 0.1);
}

#[test]
fn rate_dependent_loops_lag_more_at_higher_rates() {
    let base = Base::ViscousPi(ViscousPiParams { pi: pi(), seconds: 0.002, volt_seconds: 0.0 });
    let found = evidence(&actuator(base, Effects::default()), Effect::RateDependence);
    let trailing = curves(&found, Effect::RateDependence, "Width of loops over rate");
    let (slow, fast) = (trailing[0][0].1, trailing[0].last().unwrap().1);
    assert!(fast > 0.1 && fast > 20.0 * slow.abs(), "{slow} {fast}");
    level(&trailing[1], NOISE);
}

#[test]
fn gain_follows_temperature() {
    let per_kelvin = 0.006;
    let temperature = Some(TemperatureParams { per_kelvin, reference_degc: 23.0, ..TemperatureParams::default() });
    let found = evidence(&actuator(Base::Pi(pi()), Effects { temperature, ..Effects::default() }), Effect::Temperature);
    let gain = curves(&found, Effect::Temperature, "Gain over temperature");
    close(slope(&gain[0]), 100.0 * per_kelvin, 0.03);
    along(&gain[0], &gain[2], 0.15);
    level(&gain[1], 0.05);
}

#[test]
fn creep_continues_in_the_direction_of_the_step() {
    let creep = Some(CreepParams { seconds: vec![0.3, 3.0], shares: vec![0.03, 0.04] });
    let found = evidence(&actuator(Base::Pi(pi()), Effects { creep, ..Effects::default() }), Effect::Creep);
    let after = curves(&found, Effect::Creep, "After the drive has stopped");
    let (seconds, percent) = *after[0].last().unwrap();
    // Minus the creep during the ramp, plus the remaining creep of earlier steps.
    let expected = 100.0 * (0.03 + 0.04 * (1.0 - (-seconds / 3.0f64).exp()));
    assert!(seconds > 1.5 && percent > 0.7 * expected && percent < 1.5 * expected, "{seconds} {percent} {expected}");
    assert!(after[0].windows(2).filter(|w| w[1].1 > w[0].1).count() > after[0].len() * 4 / 5, "{:?}", after[0]);
    level(&after[1], 0.2);
}

#[test]
fn a_load_bends_the_actuator() {
    let load = Some(LoadParams { per_newton: 0.05, ..LoadParams::default() });
    let found = evidence(&actuator(Base::Pi(pi()), Effects { load, ..Effects::default() }), Effect::Load);
    let over = curves(&found, Effect::Load, "Deflection over load");
    close(slope(&over[0]), 0.05, 0.02);
    level(&over[1], NOISE);
    along(&over[0], &over[2], NOISE);
}

#[test]
fn a_mode_peaks_and_rings() {
    let mode = ResonanceParams { hz: 60.0, damping: 0.02, gain: 1.0 };
    let found = evidence(
        &actuator(Base::Pi(pi()), Effects { resonances: vec![mode], ..Effects::default() }),
        Effect::Resonance,
    );
    let spectrum = curves(&found, Effect::Resonance, "Spectrum of the residual");
    // The drive ends at 50 Hz: above it only the free oscillation of the mode remains.
    let peak = |curve: &[(f64, f64)]| {
        let beyond = curve.iter().copied().filter(|p| p.0 > 53.0 && p.0 < 120.0);
        beyond.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
    };
    let (without, with) = (peak(&spectrum[0]), peak(&spectrum[1]));
    assert!((without.0 - 60.0).abs() < 2.0 && without.1 > 20.0 * with.1, "{without:?} {with:?}");
    let gain = curves(&found, Effect::Resonance, "Gain over frequency");
    let (hz, at_40) = *gain[0].iter().min_by(|a, b| (a.0 - 40.0).abs().total_cmp(&(b.0 - 40.0).abs())).unwrap();
    close(at_40, 1.0 / (1.0 - (hz / 60.0).powi(2)), 0.1);
    along(&gain[0], &gain[2], 0.2);
    let marks = found.pictures.iter().find(|p| !p.marks.is_empty()).map(|p| (p.effect, p.marks[0].at));
    assert_eq!(marks, Some((Some(Effect::Resonance), 60.0)));
    let ring = curves(&found, Effect::Resonance, "Ring-down after a stop");
    let first: Vec<(f64, f64)> = ring[0].iter().copied().filter(|p| p.0 < 120.0).collect();
    let crossings = first.windows(2).filter(|w| w[0].1 * w[1].1 < 0.0).count() as f64;
    assert!((0.5 * crossings / 0.12 - 60.0).abs() < 6.0, "{crossings} crossings: {first:?}");
    level(&ring[1], 3.0 * NOISE);
    along(&ring[0], &ring[2], 3.0 * NOISE);
}

#[test]
fn a_saturation_limit_stops_the_measured_output() {
    let saturation = Some(SaturationParams::behind(-100.0, 18.0, 0.01));
    let found = evidence(&actuator(Base::Pi(pi()), Effects { saturation, ..Effects::default() }), Effect::Saturation);
    let motion = curves(&found, Effect::Saturation, "Where the motion stops");
    let beyond: Vec<_> = motion[2].iter().filter(|p| p.0 > 19.5).collect();
    assert!(beyond.len() > 3 && beyond.iter().all(|p| (p.1 - 18.4).abs() < 0.1), "{beyond:?}");
    let residual = curves(&found, Effect::Saturation, "Residual over the output");
    let end = residual[0].last().unwrap();
    close(end.1, 18.4 - end.0, 0.05);
    level(&residual[1], NOISE);
}

#[test]
fn a_curve_bends_both_branches_alike() {
    let asymmetry = Some(AsymmetryParams::behind(vec![10.0], vec![0.08]));
    let found = evidence(&actuator(Base::Pi(pi()), Effects { asymmetry, ..Effects::default() }), Effect::Asymmetry);
    let over = curves(&found, Effect::Asymmetry, "Residual over the output");
    for branch in &over[..2] {
        let upper: Vec<(f64, f64)> = branch.iter().copied().filter(|p| p.0 > 12.0).collect();
        close(slope(&upper), 0.08, 0.05);
        level(&branch.iter().copied().filter(|p| p.0 < 9.5).collect::<Vec<_>>(), 3.0 * NOISE);
    }
    for branch in &over[2..] {
        level(branch, 3.0 * NOISE);
    }
}

#[test]
fn drift_and_tone_show_on_the_clock() {
    let drift = Some(DriftParams { per_second: 0.01, ..DriftParams::default() });
    let found = evidence(&actuator(Base::Pi(pi()), Effects { drift, ..Effects::default() }), Effect::Drift);
    let mean = curves(&found, Effect::Drift, "Mean over time");
    close(slope(&mean[0]), 0.01, 0.02);
    level(&mean[1], NOISE);
    along(&mean[0], &mean[2], NOISE);

    let interference = Some(InterferenceParams { hz: 49.9, amplitude: 0.05, phase: 1.0, ..Default::default() });
    let found =
        evidence(&actuator(Base::Pi(pi()), Effects { interference, ..Effects::default() }), Effect::Interference);
    let spectrum = curves(&found, Effect::Interference, "Spectrum of the residual");
    let peak = spectrum[0].iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    assert!((peak.0 - 49.9).abs() < 0.2, "{peak:?}");
    let folded = curves(&found, Effect::Interference, "Folded on the tone");
    let most = folded[0].iter().fold(0.0, |m: f64, p| m.max(p.1));
    close(most, 0.05, 0.05);
    level(&folded[1], NOISE);
    let sine = |degrees: f64| 0.05 * (degrees.to_radians() + 1.0).sin();
    assert!(folded[0].iter().chain(&folded[2]).all(|p| (p.1 - sine(p.0)).abs() < NOISE), "{folded:?}");
}

#[test]
fn pictures_and_breakdowns_of_the_whole_model() {
    let drift = Some(DriftParams { per_second: 0.01, ..DriftParams::default() });
    let found = evidence(&actuator(Base::Pi(pi()), Effects { drift, ..Effects::default() }), Effect::Drift);
    let general: Vec<&str> = found.pictures.iter().filter(|p| p.effect.is_none()).map(|p| p.title.as_str()).collect();
    assert_eq!(
        general,
        [
            "Loops",
            "Residual over the drive",
            "Residual over time, training record",
            "Residual over time, test record",
            "Spectrum of the residual, training record"
        ]
    );
    // Noise is everywhere, so there is no sentence about its location.
    assert_eq!(found.places, Vec::<String>::new());
    for breakdown in &found.breakdowns {
        let whole: f64 = breakdown.parts.iter().map(|p| p.share).sum();
        assert!((whole - 1.0).abs() < 0.02, "{breakdown:?}");
    }
    let by: Vec<&str> = found.breakdowns.iter().map(|b| b.by.as_str()).collect();
    assert_eq!(by, ["time", "drive", "branch", "frequency"]);
}

#[test]
fn the_remainder_is_located_in_time_and_frequency() {
    let mut samples = samples_of(1e-3, &[vec![0.0; 4000], (0..4000).map(|k| (0.003 * f64::from(k)).sin()).collect()]);
    samples.output = samples.time.iter().zip(noise(2)).map(|(t, e)| 0.01 * e + 0.1 * (60.0 * t).sin()).collect();
    let flat = Simulation {
        predicted: vec![0.0; samples.len()],
        settling: vec![false; samples.len()],
        zeros: Vec::new(),
        errors: None,
        extrapolated: Default::default(),
        tone_ahead: Vec::new(),
        creep_away: Vec::new(),
        in_mid_cycle: Vec::new(),
    };
    // The first segment, at rest, contains only noise.
    samples.output[..4000].iter_mut().for_each(|y| *y *= 0.05);
    let mut scene = Scene {
        with: View::of(&samples, &flat),
        without: View::of(&samples, &flat),
        samples,
        unit: "µm",
        drive_unit: "V",
        noise: 0.01,
    };
    let places = residual_parts::places(&scene, &residual_parts::breakdowns(&scene));
    assert!(places[0].starts_with("it is largest in segment 2, 5.0 to 9.0 s: 0.07"), "{places:?}");
    assert!(places.iter().any(|p| p.ends_with("% of its power is between 3 and 10 Hz")), "{places:?}");
    assert!(!places.iter().any(|p| p.contains("rests") || p.contains("jumps")), "{places:?}");

    // A jump of the zero is reported, a slope is not.
    let mut places_of = |zero: &dyn Fn(f64) -> f64| {
        scene.with.residual = scene.samples.time.iter().zip(noise(3)).map(|(t, e)| 0.01 * e + zero(*t)).collect();
        residual_parts::places(&scene, &residual_parts::breakdowns(&scene))
    };
    let jumps = places_of(&|t| if t < 6.0 { 0.1 } else { -0.2 });
    assert!(jumps.iter().any(|p| p.starts_with("its mean jumps by -0.29") && p.ends_with("6.0 s")), "{jumps:?}");
    let slopes = places_of(&|t| 0.05 * t);
    assert!(!slopes.iter().any(|p| p.contains("jumps")), "{slopes:?}");
}
