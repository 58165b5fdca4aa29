//! Time of a million samples through PI-16, against which `benches/python/simulate.py` measures Python.
//!
//! Prints the seconds of one run for every line that it reads, so that both can take turns. The output's memory is there before the
//! clock starts.

use hyst_core::{Env, Pi, Stage};
use std::hint::black_box;
use std::time::Instant;

const ROWS: usize = 1_000_000;

fn main() -> std::io::Result<()> {
    let thresholds: Vec<f64> = (1..=16).map(|i| 3.5 * f64::from(i)).collect();
    // Room for as many plays as the Python class has.
    let Ok(pi) = Pi::<f64, 64>::new(0.1, &thresholds, &[0.01; 16]) else { return Ok(()) };
    // As in Python: how many plays there are is not known when this is compiled.
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
