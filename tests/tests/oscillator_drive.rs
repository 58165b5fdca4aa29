//! The Bouc-Wen oscillator with a drive that is linear or band-limited between its samples.

use hyst_core::{BoucWenOscillator, BoucWenOscillatorParams, Build, Env, Sampling, Stage};
use hyst_ident::BetweenSamples;
use hyst_ident::diagnose::{DiagnoseOptions, diagnose};
use hyst_ident::fit::{Fit, FitOptions, fit_with};
use hyst_ident::model::{Base, Kind, Model};
use hyst_ident::record::{Columns, OutputUnit, Record};
use hyst_ident::simulate::{SimulateOptions, simulate_with};
use hyst_tests::{Lab, root};
use rayon::prelude::*;

const RATE: f64 = 750.0;
/// Rows of one period.
const PERIOD: usize = 2048;

/// Returns a multisine from 5 to 150 Hz at a time in rows: 40 N RMS, periodic in [`PERIOD`].
fn force(row: f64) -> f64 {
    let line = |i: u32| {
        let cycles = f64::from(14 + 9 * i);
        (std::f64::consts::TAU * cycles * row / PERIOD as f64 + f64::from(i * i)).sin()
    };
    (0..44).map(line).sum::<f64>() * 40.0 / 22.0f64.sqrt()
}

/// Simulates the benchmark's oscillator from rest with `parts` steps per row. Returns force and output \[mm\] of `rows`
/// rows.
fn simulated(parts: usize, rows: usize) -> (Vec<f64>, Vec<f64>) {
    let model: BoucWenOscillator<f64> =
        BoucWenOscillatorParams::BENCHMARK.build(&Sampling { period: 1.0 / RATE / parts as f64 }).unwrap();
    let (mut s, e) = (model.state(), Env::default());
    let mut y = vec![1e3 * model.reset(&mut s, &e, force(0.0))];
    for k in 1..rows {
        let end = (1..=parts).map(|j| model.step(&mut s, &e, force((k - 1) as f64 + j as f64 / parts as f64))).last();
        y.push(1e3 * end.unwrap());
    }
    ((0..rows).map(|k| force(k as f64)).collect(), y)
}

fn record(u: &[f64], y: &[f64]) -> Record {
    Record::from_samples(Columns {
        name: "record".into(),
        time: (0..u.len()).map(|k| k as f64 / RATE).collect(),
        input_column: "force_in_n".into(),
        input: Some(u.to_vec()),
        output: Some((OutputUnit::Millimetre, y.to_vec())),
        segment: None,
        temperature: None,
        load: None,
    })
    .unwrap()
}

/// Adds uniformly distributed noise of 0.1 % of the RMS of `y`.
fn noisy(y: &[f64]) -> Vec<f64> {
    let rms = (y.iter().map(|y| y * y).sum::<f64>() / y.len() as f64).sqrt();
    let mut word = 1u64;
    let mut noise = || {
        word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (word >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    y.iter().map(|y| y + 12f64.sqrt() * 1e-3 * rms * noise()).collect()
}

fn fitted(parts: usize) -> Fit {
    let (u, y) = simulated(parts, 2 * PERIOD);
    let options = FitOptions { seed: 1, ..FitOptions::default() };
    fit_with(&record(&u, &noisy(&y)), Kind::BoucWenOscillator, &options, &mut |_| std::ops::ControlFlow::Continue(()))
        .unwrap()
}

/// Asserts that the parameters are those of the benchmark within three standard errors, in N and mm and with the β of
/// the model.
fn assert_benchmark_parameters(fit: &Fit) {
    let Base::BoucWenOscillator(found) = &fit.model.base else { panic!("{:?}", fit.model.base) };
    let truth = BoucWenOscillatorParams::BENCHMARK;
    let bend = 1e-3 * truth.beta / found.beta;
    for (name, expected) in [
        ("mass", 1e-3 * truth.mass),
        ("damping", 1e-3 * truth.damping),
        ("stiffness", 1e-3 * truth.stiffness),
        ("alpha", 1e-3 * truth.alpha),
        ("gamma", bend * truth.gamma),
        ("delta", bend * truth.delta),
    ] {
        let p = fit.estimate.as_ref().unwrap().parameter(name).unwrap();
        let error = 3.0 * p.std_error;
        assert!((p.value - expected).abs() < error && error < 0.2 * expected.abs(), "{p:?}, {expected} expected");
    }
    // Its true value is its lower bound. If it is held there, it has no standard error.
    assert!((found.nu - truth.nu).abs() < 0.01, "{}", found.nu);
    let estimate = fit.estimate.as_ref().unwrap();
    assert_eq!(estimate.held.contains(&"nu".into()), found.nu == 1.0, "{estimate:?}");
    assert_eq!(fit.how.contains("nu ended at its bound 1"), found.nu == 1.0, "{}", fit.how);
}

#[test]
fn the_interpolation_of_the_drive_is_found_from_the_record() {
    let found: Vec<Fit> = [1, 64].par_iter().map(|parts| fitted(*parts)).collect();
    for (fit, expected) in found.iter().zip([BetweenSamples::Linear, BetweenSamples::BandLimited]) {
        assert_eq!(fit.model.between_samples, expected, "{:?}", fit.between_samples);
        assert_benchmark_parameters(fit);
        let error = |between| fit.between_samples.iter().find(|(tried, _)| *tried == between).unwrap().1;
        let other =
            if expected == BetweenSamples::Linear { BetweenSamples::BandLimited } else { BetweenSamples::Linear };
        assert!(error(other) > 3.0 * error(expected), "{:?}", fit.between_samples);
        // The file stores it.
        assert_eq!(Model::parse("text", &fit.model.to_json()).unwrap(), fit.model);
    }
}

/// A diagnosis that does not refit the operator keeps its standard errors and the interpolation of the drive.
#[test]
fn a_diagnosis_keeps_the_oscillator_and_the_interpolation_of_its_drive() {
    let (u, y) = simulated(64, 2 * PERIOD);
    let hum = |k: usize| (std::f64::consts::TAU * 33.0 * k as f64 / RATE).sin();
    let largest = y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
    let with_hum: Vec<f64> = noisy(&y).iter().enumerate().map(|(k, y)| y + 0.05 * largest * hum(k)).collect();
    let record = record(&u, &with_hum);
    let mut model = Model::read(&root().join("docs/models/bouc-wen-oscillator.json")).unwrap();
    model.between_samples = BetweenSamples::BandLimited;
    model.std_errors.insert("bouc-wen-oscillator.mass".into(), 1e-4);
    let found = diagnose(&record, None, &model, &DiagnoseOptions::default(), &|_| {}).unwrap();
    let names: Vec<&str> = found.findings.effects.iter().map(|e| e.name.name()).collect();
    assert_eq!(names, ["interference"], "{:#?}", found.findings);
    assert_eq!(found.extended.between_samples, BetweenSamples::BandLimited);
    assert_eq!(found.extended.std_errors["bouc-wen-oscillator.mass"], 1e-4);
    let (before, after) = (found.findings.before.train.unwrap().rmse, found.findings.after.train.unwrap().rmse);
    assert!(after < 0.1 * before, "{before} {after}");
}

#[test]
fn one_period_of_a_steady_state_is_predicted() {
    let mut model = Model::read(&root().join("docs/models/bouc-wen-oscillator.json")).unwrap();
    let (u, y) = simulated(64, 4 * PERIOD);
    let last = record(&u[3 * PERIOD..], &y[3 * PERIOD..]);
    let mut errors = |between_samples, periodic| {
        model.between_samples = between_samples;
        let options = SimulateOptions { periodic, ..SimulateOptions::default() };
        let simulated = simulate_with(&model, &last, &options).unwrap();
        let errors = simulated.errors.unwrap();
        (errors.nrmse_percent, errors.rmse_all_rows / errors.rmse)
    };
    let (exact, all) = errors(BetweenSamples::BandLimited, true);
    assert!(exact < 0.01 && all == 1.0, "{exact} % {all}");
    assert!(errors(BetweenSamples::Linear, true).0 > 0.1);
    // From rest the first rows are wrong.
    let (_, all) = errors(BetweenSamples::BandLimited, false);
    assert!(all > 5.0, "{all}");
}

#[test]
fn files_options_and_exports_state_the_interpolation() {
    let lab = Lab::new();
    let mut file: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(root().join("docs/models/bouc-wen-oscillator.json")).unwrap())
            .unwrap();
    assert!(file["input"].get("between_samples").is_none());
    lab.write("linear.json", file.to_string());
    file["input"]["between_samples"] = "band-limited".into();
    lab.write("band.json", file.to_string());
    for format in ["c", "rust", "postcard"] {
        let note_of = |model: &str| lab.ok(&format!("export {model} --format {format} -o {format}.out")).stderr;
        assert_eq!(note_of("linear.json"), "");
        let note = note_of("band.json");
        assert!(note.contains("a board interpolates it linearly"), "{note}");
    }
    for written in ["c.out", "rust.out"] {
        assert!(lab.read(written).contains("a board interpolates it linearly"), "{written}");
    }
    file["input"]["between_samples"] = "cubic".into();
    lab.write("cubic.json", file.to_string());
    let message = lab.fails("export cubic.json --format c", 2);
    assert!(message.contains("band-limited") && message.contains("linear"), "{message}");
    let pi = std::fs::read_to_string(root().join("docs/models/pi.json")).unwrap();
    let mut pi: serde_json::Value = serde_json::from_str(&pi).unwrap();
    pi["input"]["between_samples"] = "band-limited".into();
    lab.write("pi.json", pi.to_string());
    let message = lab.fails("export pi.json --format c", 2);
    assert!(message.contains("input.between_samples") && message.contains("bouc-wen-oscillator"), "{message}");

    let lab = Lab::with_train("");
    for kind in ["pi", "tanh"] {
        let message = lab.fails(&format!("fit train.csv --model {kind} --between-samples band-limited -o m.json"), 2);
        assert!(message.contains(kind) && message.contains("bouc-wen-oscillator"), "{message}");
        lab.ok(&format!("fit train.csv --model {kind} --between-samples linear -o m.json"));
    }
}
