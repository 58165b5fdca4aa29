//! Measures a million samples through PI-16, for comparison with Python in `benches/python/simulate.py`.
//!
//! Prints the seconds of one run for every line that it reads, so that both run in turn. The memory of the output is
//! allocated before the clock starts.

use hyst_core::{Env, Pi, Stage};
use std::hint::black_box;
use std::time::Instant;

const ROWS: usize = 1_000_000;

fn main() -> std::io::Result<()> {
    let thresholds: Vec<f64> = (1..=16).map(|i| 3.5 * f64::from(i)).collect();
    // Same capacity as the Python class.
    let Ok(pi) = Pi::<f64, 64>::new(0.1, &thresholds, &[0.01; 16]) else { return Ok(()) };
    // As in Python, the number of play operators is not known at compile time.
    let pi = black_box(pi);
    let u: Vec<f64> =
        (0..ROWS).map(|k| 60.0 * (1.0 - (0.01 * k as f64).cos()) * (0.5 + 0.5 * (0.0013 * k as f64).sin())).collect();
    let (mut y, env) = (vec![0.0; ROWS], Env::default());
    for line in std::io::stdin().lines() {
        line?;
        let start = Instant::now();
        let mut state = pi.state();
        let u = black_box(&u);
        y[0] = pi.reset(&mut state, &env, u[0]);
        for (y, u) in y.iter_mut().zip(u).skip(1) {
            *y = pi.step(&mut state, &env, *u);
        }
        black_box(&y);
        println!("{}", start.elapsed().as_secs_f64());
    }
    Ok(())
}
