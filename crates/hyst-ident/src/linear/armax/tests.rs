//! Tests of the models against structures with known modes.

use hyst_core::{Build, Env, Resonance, ResonanceParams, Sampling, Stage};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::Samples;
use crate::linear::{LinearError, WelchOptions, band_of, decimate, response};

const MODES: [(f64, f64); 3] = [(20.0, 0.02), (55.0, 0.015), (130.0, 0.03)];

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// A sum of three modes with a band-limited random drive that is linear between rows; sensor noise in percent of the
/// standard deviation of the output.
fn structure(rate: f64, rows: usize, noise_percent: f64, delay: usize) -> Samples {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let cx = Sampling { period: 1.0 / rate };
    let modes =
        MODES.map(|(hz, damping)| -> Resonance<f64> { ResonanceParams { hz, damping, gain: 1.0 }.build(&cx).unwrap() });
    let mut states = modes.map(|mode| mode.state());
    // White at 1 kHz; at higher rates linear between the values, so the upper band is nearly empty.
    let every = (rate / 1000.0).round() as usize;
    let values: Vec<f64> = (0..rows / every + 2).map(|_| 10.0 * normal(&mut rng)).collect();
    let drive = |k: usize| {
        let (i, x) = (k / every, (k % every) as f64 / every as f64);
        values[i] * (1.0 - x) + values[i + 1] * x
    };
    let u: Vec<f64> = (0..rows).map(drive).collect();
    let e = Env::default();
    let clean: Vec<f64> = (0..rows)
        .map(|k| {
            let u = if k < delay { u[0] } else { u[k - delay] };
            modes
                .iter()
                .zip(&mut states)
                .map(|(mode, s)| if k == 0 { mode.reset(s, &e, u) } else { mode.step(s, &e, u) })
                .sum::<f64>()
                * 0.4
                + 7.0
        })
        .collect();
    let mean = clean.iter().sum::<f64>() / rows as f64;
    let deviation = (clean.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / rows as f64).sqrt();
    let y = clean.iter().map(|y| y + 0.01 * noise_percent * deviation * normal(&mut rng)).collect();
    Samples::of_columns(1.0 / rate, u, y)
}

fn assert_modes(model: &Armax) {
    let modes = model.modes().unwrap();
    for (hz, damping) in MODES {
        let found = modes.iter().min_by(|a, b| (a.hz - hz).abs().total_cmp(&(b.hz - hz).abs())).unwrap();
        assert!((found.hz / hz - 1.0).abs() < 0.01, "{hz}: {modes:?}");
        assert!((found.damping / damping - 1.0).abs() < 0.1, "{hz}: {modes:?}");
    }
}

#[test]
fn modes_of_a_noisy_structure_are_found_with_their_errors() {
    let record = structure(1000.0, 20_000, 5.0, 0);
    let model = fit_armax(&record, &ArmaxOptions { order: 6, delay: Delay::Rows(0) }).unwrap();
    assert_modes(&model);
    assert_eq!(model.modes().unwrap().len(), 3);
    // With white sensor noise C = A, and the standard errors match the scatter of the estimates.
    for (mode, (hz, damping)) in model.modes().unwrap().iter().zip(MODES) {
        assert!((mode.hz - hz).abs() < 4.0 * mode.hz_std_error && mode.hz_std_error < 0.003 * hz, "{mode:?}");
        assert!((mode.damping - damping).abs() < 4.0 * mode.damping_std_error, "{mode:?}");
        assert!(mode.damping_std_error < 0.1 * damping, "{mode:?}");
        // The peak of a mode is 1 / 2ζ of its static gain.
        assert!((mode.peak * 2.0 * damping / 0.4 - 1.0).abs() < 0.1, "{mode:?}");
    }
    assert!((model.response(0.0).re / 1.2 - 1.0).abs() < 0.02, "{:?}", model.response(0.0));
    let errors = model.prediction_errors(&record).unwrap();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    assert!((rms / model.noise - 1.0).abs() < 0.01, "{rms} {}", model.noise);
    let simulated = model.simulate(&record).unwrap();
    let residual = record.output.iter().zip(&simulated).map(|(y, s)| (y - s).powi(2)).sum::<f64>();
    let mean = record.output.iter().sum::<f64>() / record.len() as f64;
    let variation = record.output.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
    assert!((residual / variation).sqrt() < 0.055, "{}", (residual / variation).sqrt());
}

#[test]
fn standard_errors_are_the_scatter_of_repeated_fits() {
    // One mode, many seeds of noise on the same drive.
    let clean = structure(1000.0, 4000, 0.0, 0);
    let fitted: Vec<Mode> = (0..24)
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let output = clean.output.iter().map(|y| y + 2.0 * normal(&mut rng)).collect();
            let record = Samples::of_columns(clean.period, clean.input.clone(), output);
            fit_armax(&record, &ArmaxOptions { order: 6, delay: Delay::Rows(0) }).unwrap().modes().unwrap()[0]
        })
        .collect();
    let scatter = |of: fn(&Mode) -> f64| {
        let mean = fitted.iter().map(of).sum::<f64>() / 24.0;
        (fitted.iter().map(|m| (of(m) - mean).powi(2)).sum::<f64>() / 23.0).sqrt()
    };
    let stated = |of: fn(&Mode) -> f64| fitted.iter().map(of).sum::<f64>() / 24.0;
    for (found, claimed) in
        [(scatter(|m| m.hz), stated(|m| m.hz_std_error)), (scatter(|m| m.damping), stated(|m| m.damping_std_error))]
    {
        assert!((0.6..1.7).contains(&(found / claimed)), "{found} {claimed}");
    }
}

#[test]
fn a_high_rate_is_reduced_to_the_band() {
    let record = structure(20_000.0, 400_000, 3.0, 0);
    let welch = response(&record, &WelchOptions::default()).unwrap();
    let band = band_of(&welch).unwrap();
    assert!((130.0..1500.0).contains(&band), "{band}");
    let fewer = decimate(&record, 200.0);
    assert_eq!(fewer.factor, 31);
    assert_modes(&fit_armax(&fewer.samples, &ArmaxOptions { order: 8, delay: Delay::Rows(0) }).unwrap());
}

#[test]
fn the_order_of_the_structure_is_chosen() {
    let record = structure(1000.0, 20_000, 5.0, 3);
    let choice = choose_order(&record, &[2, 4, 6, 8, 10], Delay::Auto).unwrap();
    assert_eq!((choice.model.order(), choice.model.delay), (6, 3), "{:?}", choice.table);
    assert_eq!(choice.table.len(), 5);
    let row = |order: usize| choice.table.iter().find(|row| row.order == order).unwrap();
    assert!(row(4).simulation > 1.3 * row(6).simulation, "{:?}", choice.table);
    assert!(row(6).bic < row(4).bic && row(6).bic < row(10).bic, "{:?}", choice.table);
    assert_modes(&choice.model);
}

#[test]
fn a_coloured_disturbance_affects_c_and_not_the_modes() {
    // y = B/A u + C/A e with C far from A.
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (a, b, c) = ([-1.5, 0.9], [0.0, 0.5, 0.3], [0.7, 0.0]);
    let rows = 20_000;
    let u: Vec<f64> = (0..rows).map(|_| normal(&mut rng)).collect();
    let e: Vec<f64> = (0..rows).map(|_| 0.3 * normal(&mut rng)).collect();
    let mut y = vec![0.0; rows];
    for t in 2..rows {
        y[t] = -a[0] * y[t - 1] - a[1] * y[t - 2] + b[1] * u[t - 1] + b[2] * u[t - 2] + e[t] + c[0] * e[t - 1];
    }
    let model = fit_armax(&Samples::of_columns(0.01, u, y), &ArmaxOptions { order: 2, delay: Delay::Rows(0) }).unwrap();
    let near = |found: &[f64], wanted: &[f64], by: f64| found.iter().zip(wanted).all(|(f, w)| (f - w).abs() < by);
    assert!(near(&model.a, &a, 0.01) && near(&model.b, &b, 0.01) && near(&model.c, &c, 0.03), "{model:?}");
    assert!((model.noise / 0.3 - 1.0).abs() < 0.02, "{model:?}");
    // The zero at −0.6 is at half of the sample rate, with ln 0.6 as its real part.
    let wanted = f64::hypot(0.6_f64.ln(), std::f64::consts::PI) / 0.01 / std::f64::consts::TAU;
    assert!(model.zeros().unwrap().iter().any(|zero| (zero.hz / wanted - 1.0).abs() < 0.05), "{:?}", model.zeros());
}

#[test]
fn fits_that_are_impossible_are_errors() {
    let record = structure(1000.0, 300, 1.0, 0);
    let fit = |record: &Samples, order| fit_armax(record, &ArmaxOptions { order, delay: Delay::Rows(0) });
    assert!(matches!(fit(&record, 0), Err(LinearError::Field { field: "order", .. })));
    assert!(matches!(fit(&record, 12), Err(LinearError::TooShort { needed: 380, found: 300, .. })));
    let still = Samples::of_columns(1e-3, vec![3.0; 300], record.output.clone());
    assert!(matches!(fit(&still, 2), Err(LinearError::Constant { column: "input" })));
    let model = fit(&record, 2).unwrap();
    assert!(matches!(model.simulate(&Samples { period: 2e-3, ..record }), Err(LinearError::Field { .. })));
}
