//! Tests `run --adapt` on actuators that age: `cargo run --release -p hyst-tests --example adapt [SECONDS]`.
//!
//! Within an hour, or SECONDS, the gain of an actuator falls by 5 % and its loop widens by 20 %, for each of seven
//! hysteresis laws. The example prints the errors of the first model, of that model with `--adapt`, and of a refitted
//! model.

use hyst_tests::ageing::aged;
use hyst_tests::other_bench::Bench;
use hyst_tests::other_physics::Law;

fn main() {
    let seconds = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(3600.0);
    let mut ratios: Vec<f64> = Vec::new();
    for (seed, law) in (1..).zip(Law::ALL) {
        let bench = Bench {
            seed,
            law,
            rate_hz: 200.0,
            volts: 100.0,
            stroke_um: 12.0,
            noise_um: 0.005,
            delay_s: 0.0,
            lag_s: 0.0,
            creep: 0.0,
            mode: None,
        };
        let found = aged(bench, seconds);
        let ratio = found.adapted / found.refitted;
        println!(
            "{law:?}: first model {:.4} µm, adapted {:.4} µm, refitted {:.4} µm: ratio {ratio:.2}",
            found.initial, found.adapted, found.refitted
        );
        ratios.push(ratio);
    }
    let within = ratios.iter().filter(|ratio| **ratio <= 1.5).count();
    println!("{within} of {} within 1.5 times the error of a refitted model", ratios.len());
}
