//! `cargo run --release -p hyst-tests --example adapt [SECONDS]`: an hour of work, or so many seconds, in which an actuator of each of seven hysteresis laws
//! loses 5 % of its gain and its loop becomes a fifth wider: the error of its first model, of that model with `run --adapt`, and of one that is fitted anew.

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
        let ratio = found.adapted / found.anew;
        println!(
            "{law:?}: first model {:.4} µm, adapted {:.4} µm, fitted anew {:.4} µm: {ratio:.2} times",
            found.kept, found.adapted, found.anew
        );
        ratios.push(ratio);
    }
    let within = ratios.iter().filter(|ratio| **ratio <= 1.5).count();
    println!("{within} of {} within 1.5 times the error of a model that is fitted anew", ratios.len());
}
