//! The Bouc-Wen oscillator with its nominal parameters on the public benchmark's records (`HYST_DATA`): skipped, with a
//! message, where they are not at hand.

use hyst_core::{BoucWenOscillator, BoucWenOscillatorParams, Build, Env, Sampling, Stage};
use hyst_tests::data;

/// Rows of force \[N\] and displacement \[m\].
fn read(path: &std::path::Path) -> Vec<(f64, f64)> {
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text.lines().skip(1).map(|line| {
        let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        (numbers[1], 1e-3 * numbers[2])
    });
    rows.collect()
}

/// Nothing is fitted: what is left is the records' 750 Hz (up to 150 Hz, the force is not linear between samples) and
/// their filter.
#[test]
fn nominal_parameters_give_the_benchmarks_records() {
    let Some(folder) = data().map(|d| d.join("measured")) else { return };
    let model: BoucWenOscillator<f64> =
        BoucWenOscillatorParams::BENCHMARK.build(&Sampling { period: 1.0 / 750.0 }).unwrap();
    for (name, periodic, percent) in [("train", true, 2.0), ("test-multisine", true, 1.5), ("test-sweep", false, 1.0)] {
        let rows = read(&folder.join(format!("bouc-wen-benchmark-{name}.csv")));
        let (mut s, e) = (model.state(), Env::default());
        model.reset(&mut s, &e, 0.0);
        // The multisines are recorded in their steady state: one period first.
        let period = if periodic { 8192 } else { 0 };
        for (u, _) in &rows[rows.len() - period..] {
            model.step(&mut s, &e, *u);
        }
        let (mut error, mut signal) = (0.0, 0.0);
        for (u, y) in &rows {
            error += (model.step(&mut s, &e, *u) - y).powi(2);
            signal += y.powi(2);
        }
        let share = 100.0 * (error / signal).sqrt();
        println!("{name}: RMSE {share:.2} % of the output's RMS");
        assert!(share < percent, "{name}: {share} %");
    }
}
