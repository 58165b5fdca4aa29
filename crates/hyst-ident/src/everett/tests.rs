//! Surfaces of a known operator, from drives with noise.

use hyst_core::{Env, Everett, Grid, Stage};
use rand::{Rng, SeedableRng};

use super::*;
use crate::excite::{Drive, Forc, Identification, Limits, Peak, Shape};
use crate::record::{Columns, OutputUnit, Record};
use crate::samples::Samples;

const HIGH: f64 = 100.0;
const CELLS: usize = 20;
const LIMITS: Limits = Limits { rate_hz: 1000.0, lo_v: 0.0, hi_v: HIGH, slew_v_per_s: None };

/// About 0.2 µm/V with relays concentrated in the middle, and some that switch only once, on the first rise.
fn operator() -> Box<Everett<f64, 65>> {
    let grid = Grid { low: 0.0, high: HIGH, cells: CELLS };
    let density = |a: usize, b: usize| {
        let (a, b) = (a as f64 / CELLS as f64, b as f64 / CELLS as f64);
        if a == b { 0.6 } else { 0.04 * (-4.0 * (a - 0.6).powi(2) - 4.0 * (b - 0.4).powi(2)).exp() }
    };
    Box::new(Everett::new(grid, 0.0, density, |_| 0.05).unwrap())
}

fn peaks(peak: Peak, durations: &[f64]) -> Vec<Shape> {
    let curves = CELLS as u32;
    durations.iter().map(|s| Shape::Forc(Forc { curves, peak_s: *s, rest_s: 0.1, peak })).collect()
}

/// Output of the operator over a drive, with a sensor that reads `zero` at rest and has white noise.
fn record(shapes: &[Shape], zero: f64, noise: f64) -> Record {
    let drive = Drive::new(shapes, &LIMITS, 1.0).unwrap();
    let map = operator();
    let (mut state, env) = (map.state(), Env::default());
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let mut output = Vec::new();
    for rows in drive.segments() {
        map.reset(&mut state, &env, 0.0);
        output.extend(
            drive.voltage()[rows.clone()].iter().map(|u| zero + map.step(&mut state, &env, *u) + noise * normal()),
        );
    }
    let labels = (0..).zip(drive.segments()).flat_map(|(k, rows)| std::iter::repeat_n(k, rows.len())).collect();
    with_output(&drive, labels, output)
}

fn with_output(drive: &Drive, labels: Vec<i64>, output: Vec<f64>) -> Record {
    Record::from_samples(Columns {
        name: "fod.csv".into(),
        segment: Some(labels),
        time: drive.time().to_vec(),
        input: Some(drive.voltage().to_vec()),
        output: Some((OutputUnit::Micrometre, output)),
        ..Columns::default()
    })
    .unwrap()
}

fn measured(record: &Record) -> Surface {
    Surface::measure("fod.csv", &Samples::from_record(record), None).unwrap()
}

/// Returns the maximum and RMS difference from the surface of the operator.
fn surface_errors(surface: &Surface) -> (f64, f64) {
    let map = operator();
    let (mut largest, mut squares, mut n) = (0.0f64, 0.0, 0.0);
    for i in 1..=surface.grid().cells {
        for j in 0..i {
            let miss = surface.value(i, j) - map.value(surface.at(i), surface.at(j));
            (largest, squares, n) = (largest.max(miss.abs()), squares + miss * miss, n + 1.0);
        }
    }
    (largest, (squares / n).sqrt())
}

#[test]
fn the_surface_is_recovered_from_both_forms_and_several_durations() {
    for (peak, shape) in [(Peak::Triangle, PeakShape::Triangle), (Peak::HalfSine, PeakShape::HalfSine)] {
        let surface = measured(&record(&peaks(peak, &[0.7, 1.0, 1.6]), 7.0, 0.0));
        let span = surface.value(CELLS, 0);
        let families = surface.families();
        assert_eq!(families.iter().map(|f| f.curves).collect::<Vec<_>>(), [CELLS; 3], "{families:?}");
        for family in families {
            assert_eq!(family.shape, shape);
            assert!([0.7, 1.0, 1.6].iter().any(|s| (family.peak_s / s - 1.0).abs() < 0.03), "{families:?}");
        }
        let (largest, _) = surface_errors(&surface);
        assert!(largest < 3e-3 * span, "{shape:?}: {largest} of {span}");
        // The virgin curve contains the relays that switch once, but not the sensor zero.
        let map = operator();
        for i in 1..=CELLS {
            assert!((surface.virgin(i) - map.virgin(surface.at(i))).abs() < 4e-3 * span, "{i}");
        }
        assert!((surface.zero - 7.0).abs() < 1e-3 * span, "{}", surface.zero);
        assert_eq!(surface.steps_back(), 0);
    }
}

#[test]
fn durations_in_one_segment_are_separated() {
    let whole = record(&peaks(Peak::HalfSine, &[0.7, 1.6]), 0.0, 0.0);
    let (n, t) = (whole.rows(), whole.sample_period());
    let one = Record::from_samples(Columns {
        name: "fod.csv".into(),
        time: (0..n).map(|k| k as f64 * t).collect(),
        input: Some(whole.input().to_vec()),
        output: whole.output().map(|y| (OutputUnit::Micrometre, y.to_vec())),
        ..Columns::default()
    })
    .unwrap();
    assert_eq!(measured(&one).families().len(), 2);
}

#[test]
fn heights_between_the_nodes_are_interpolated() {
    // 20 heights on 13 and on 33 cells: only the last one is on a node.
    for cells in [13, 33] {
        let record = record(&peaks(Peak::HalfSine, &[1.0]), 0.0, 0.0);
        let surface = Surface::measure("fod.csv", &Samples::from_record(&record), Some(cells)).unwrap();
        let map = operator();
        let span = surface.value(cells, 0);
        for i in 1..=cells {
            for j in 0..i {
                let miss = surface.value(i, j) - map.value(surface.at(i), surface.at(j));
                assert!(miss.abs() < 0.01 * span, "{cells}: ({i}, {j}) {miss} of {span}");
            }
        }
    }
}

#[test]
fn a_measured_drive_with_noise_is_read() {
    let clean = record(&peaks(Peak::HalfSine, &[0.8, 1.2]), 0.0, 0.005);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let input = clean.input().iter().map(|u| u + 0.1 * (rng.random::<f64>() - 0.5)).collect();
    let labels = (0..).zip(clean.segments()).flat_map(|(k, rows)| std::iter::repeat_n(k, rows.len())).collect();
    let noisy = Record::from_samples(Columns {
        name: "fod.csv".into(),
        segment: Some(labels),
        time: clean.time().to_vec(),
        input: Some(input),
        output: clean.output().map(|y| (OutputUnit::Micrometre, y.to_vec())),
        ..Columns::default()
    })
    .unwrap();
    let surface = measured(&noisy);
    assert_eq!(surface.families().iter().map(|f| f.curves).collect::<Vec<_>>(), [CELLS; 2]);
    let (largest, _) = surface_errors(&surface);
    assert!(largest < 0.01 * surface.value(surface.grid().cells, 0), "{largest}");
}

#[test]
fn noise_and_standard_errors_are_correct() {
    let noise = 0.03;
    let surface = measured(&record(&peaks(Peak::HalfSine, &[0.7, 1.0]), -2.0, noise));
    assert!((surface.noise() / noise - 1.0).abs() < 0.05, "{}", surface.noise());
    let map = operator();
    let mut squares = Vec::new();
    for i in 2..=CELLS {
        for j in 0..i {
            let miss = surface.value(i, j) - map.value(surface.at(i), surface.at(j));
            squares.push((miss / surface.std_error(i, j)).powi(2));
        }
    }
    let ratio = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((0.8..1.3).contains(&ratio), "{ratio}");
    assert!(surface.breaches().is_empty(), "{:?}", surface.breaches());
}

#[test]
fn noise_alone_causes_no_breach_on_a_flat_surface() {
    // The output is only noise: neighbours differ at random, half of them in the wrong direction.
    let clean = record(&peaks(Peak::HalfSine, &[1.0]), 0.0, 0.0);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let drive = Drive::new(&peaks(Peak::HalfSine, &[1.0]), &LIMITS, 1.0).unwrap();
    let output = (0..clean.rows()).map(|_| 0.1 * normal()).collect();
    let surface = measured(&with_output(&drive, vec![0; clean.rows()], output));
    let rules = 3 * CELLS * (CELLS + 1) / 2;
    assert!(surface.steps_back() > rules / 5, "{}", surface.steps_back());
    assert!(surface.breaches().len() <= rules / 100, "{:?}", surface.breaches());
}

/// A record in which the output is raised by `by` around β = 40 on the fall from α = 75.
fn dented(by: f64) -> Record {
    let shapes = peaks(Peak::HalfSine, &[1.0]);
    let drive = Drive::new(&shapes, &LIMITS, 1.0).unwrap();
    let clean = record(&shapes, 0.0, 0.01);
    let mut output = clean.output().unwrap().to_vec();
    // Peak 15 of 20, its falling half.
    let begin = (14.0 * 1100.0) as usize;
    for (y, u) in output.iter_mut().zip(drive.voltage()).skip(begin + 500).take(500) {
        *y += by * (-((u - 40.0) / 4.0).powi(2)).exp();
    }
    with_output(&drive, vec![0; clean.rows()], output)
}

#[test]
fn a_dent_is_located_and_corrected_there() {
    let surface = measured(&dented(2.5));
    let breaches = surface.breaches();
    assert!(!breaches.is_empty());
    for b in &breaches {
        assert!((70.0..=80.0).contains(&b.alpha) && (30.0..=45.0).contains(&b.beta), "{b:?}");
        assert!(b.by > 0.0 && b.sigmas > 3.0);
    }
    let (valid, moved) = surface.nearest_valid().unwrap();
    assert_eq!(valid.steps_back(), 0);
    assert!(moved.largest > 0.5 && moved.largest < 2.5, "{moved:?}");
    let (before, after) = (surface_errors(&surface), surface_errors(&valid));
    assert!(after.1 < 0.85 * before.1, "{before:?} {after:?}");
    // Far from the dent nothing changes.
    for (i, j) in [(5, 2), (10, 0), (20, 15), (20, 0)] {
        assert!((valid.value(i, j) - surface.value(i, j)).abs() < 0.02, "{i} {j}");
    }
}

#[test]
fn as_measured_accepts_only_a_valid_surface() {
    let options = FodOptions { as_measured: true, ..FodOptions::default() };
    let error = fit_fod(&dented(2.5), &options).unwrap_err();
    assert!(error.to_string().contains("as-measured"), "{error}");
    let corrected = fit_fod(&dented(2.5), &FodOptions::default()).unwrap();
    assert!(corrected.report.moved.is_some() && !corrected.report.breaches.is_empty());
    let whole = fit_fod(&dented(0.0), &options).unwrap();
    assert_eq!((whole.report.moved, whole.report.breaches.len()), (None, 0));
}

#[test]
fn the_model_predicts_loops_that_were_not_fitted() {
    let fit = fit_fod(&record(&peaks(Peak::HalfSine, &[0.8, 1.1]), 1.0, 0.005), &FodOptions::default()).unwrap();
    let test =
        record(&[Shape::DecayingSine(crate::excite::DecayingSine { frequency_hz: 2.0, duration_s: 6.0 })], 1.0, 0.0);
    let simulated = crate::simulate::simulate(&fit.model, &test, crate::simulate::Zero::None).unwrap();
    let errors = simulated.errors.unwrap();
    assert!(errors.nrmse_percent < 0.2, "{errors:?}");
}

#[test]
fn excursions_that_are_not_curves_are_reported() {
    let identification = Identification::at_rate(1000.0, 1);
    let other = record(&identification.shapes().unwrap(), 0.0, 0.0);
    assert!(!shows_only_curves(&other));
    assert!(shows_only_curves(&record(&peaks(Peak::Triangle, &[1.0]), 0.0, 0.01)));
    let few = Shape::Forc(Forc { curves: 3, peak_s: 1.0, rest_s: 0.1, peak: Peak::HalfSine });
    let error = fit_fod(&record(&[few], 0.0, 0.0), &FodOptions::default()).unwrap_err();
    assert!(error.to_string().contains("fod.csv: 3 of the 4"), "{error}");
    // Curves among other excursions are measured; the others are counted.
    let mut shapes = peaks(Peak::HalfSine, &[1.0]);
    shapes.extend(identification.shapes().unwrap());
    let mixed = record(&shapes, 0.0, 0.0);
    let fit = fit_fod(&mixed, &FodOptions::default()).unwrap();
    assert!(fit.report.passed_over > 10 && fit.report.families.iter().any(|f| f.curves == CELLS), "{:?}", fit.report);
}
