//! Compares the errors of many candidates: eight in parallel (SIMD) against one at a time through the core, on one
//! thread.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hyst_core::{Build, Env, Pi, Real, Stage, TdPi, TdPiParams};
use hyst_ident::batch::{Errors, Kernel, PiKernel, Row, Rows, TdPiKernel};
use hyst_ident::optimize::Cost;
use std::hint::black_box;
use std::time::Instant;

/// Rows per temperature and number of candidates, as in the paper on temperature-dependent models.
const ROWS: usize = 5000;
const CANDIDATES: usize = 96;

/// Minimum speed-up of eight in parallel.
const MIN_SPEED_UP: f64 = 4.0;

struct Data {
    rows: Vec<Row>,
    output: Vec<f64>,
}

fn data() -> Data {
    let input = |k: usize| 200.0 * (std::f64::consts::TAU * 2.0 * k as f64 / ROWS as f64).sin();
    let rows: Vec<Row> = (0..ROWS).map(|k| Row { input: input(k), rate: 0.0, temperature: 33.0 }).collect();
    let output = rows.iter().map(|r| 0.15 * r.input).collect();
    Data { rows, output }
}

/// Computes the error of one candidate through the core.
fn alone<S: Stage<f64>>(stage: &S, data: &Data) -> f64 {
    let e = Env { temperature: 33.0, ..Env::default() };
    let mut s = stage.state();
    let (mut sum, mut first) = (0.0, true);
    for (row, y) in data.rows.iter().zip(&data.output) {
        let out = if first { stage.reset(&mut s, &e, row.input) } else { stage.step(&mut s, &e, row.input) };
        first = false;
        sum += (out - y) * (out - y);
    }
    (sum / ROWS as f64).sqrt()
}

/// Returns a random number from 0 to 1.
fn draw(seed: &mut u32) -> f64 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    f64::from(*seed >> 8) / f64::from(1u32 << 24)
}

/// Returns candidates of PI-16: gain, rising thresholds, weights.
fn pi_points() -> Vec<f64> {
    let mut seed = 1;
    let one = |seed: &mut u32| {
        let mut p = vec![0.05 + 0.1 * draw(seed)];
        p.extend((1..=16).map(|i| 10.0 * (f64::from(i) - 0.5 * draw(seed))));
        p.extend((1..=16).map(|_| 0.01 * draw(seed)));
        p
    };
    (0..CANDIDATES).flat_map(|_| one(&mut seed)).collect()
}

fn td_pi_points() -> Vec<f64> {
    let p = TdPiParams::PRINTED;
    let mut seed = 2;
    let printed = [p.alpha, p.epsilon, p.tau, p.eta, p.a0, p.a1, p.b0, p.b1];
    (0..CANDIDATES).flat_map(|_| printed.map(|x| x * (0.9 + 0.2 * draw(&mut seed)))).collect()
}

fn pi(p: &[f64]) -> Pi<f64, 16> {
    Pi::new(p[0], &p[1..17], &p[17..33]).unwrap()
}

fn td_pi(p: &[f64]) -> TdPi<f64, 9> {
    let [alpha, epsilon, tau, eta, a0, a1, b0, b1] = p.try_into().unwrap();
    TdPiParams { alpha, epsilon, tau, eta, a0, a1, b0, b1, plays: 9, reference_degc: 23.0 }.build(&()).unwrap()
}

/// Returns the shortest time of 15 runs \[ns per candidate and sample\].
fn fastest(mut run: impl FnMut()) -> f64 {
    let once = |run: &mut dyn FnMut()| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    (0..15).map(|_| once(&mut run)).fold(f64::INFINITY, Real::at_most) * 1e9 / (ROWS * CANDIDATES) as f64
}

fn candidates(c: &mut Criterion) {
    let data = data();
    let (counts, segments) = (vec![true; ROWS], std::slice::from_ref(&(0..ROWS)).to_vec());
    let rows = Rows { rows: &data.rows, output: &data.output, counts: &counts, segments: &segments };
    let mut costs = vec![0.0; CANDIDATES];
    let never = vec![f64::INFINITY; CANDIDATES];
    let mut group = c.benchmark_group("candidates");
    group.throughput(Throughput::Elements((ROWS * CANDIDATES) as u64)).sample_size(10);
    let mut report = Vec::new();

    fn batch<K: Kernel>(kernel: K, rows: Rows<'_>) -> Errors<'_, K> {
        Errors::new(kernel, rows).unwrap_or_else(|e| panic!("{e}"))
    }
    let (errors, points) = (batch(PiKernel::<16>, rows), pi_points());
    group.bench_function("PI-16, eight in parallel", |b| {
        b.iter(|| errors.costs(black_box(&points), &never, &mut costs));
    });
    let parallel = fastest(|| errors.costs(black_box(&points), &never, &mut costs));
    let single = fastest(|| {
        points.chunks_exact(33).for_each(|p| {
            black_box(alone(&pi(p), &data));
        });
    });
    report.push(("PI-16", single, parallel));

    let (errors, points) = (batch(TdPiKernel::<9> { reference_degc: 23.0 }, rows), td_pi_points());
    group.bench_function("TD-PI (n = 9), eight in parallel", |b| {
        b.iter(|| errors.costs(black_box(&points), &never, &mut costs));
    });
    let parallel = fastest(|| errors.costs(black_box(&points), &never, &mut costs));
    let single = fastest(|| {
        points.chunks_exact(8).for_each(|p| {
            black_box(alone(&td_pi(p), &data));
        });
    });
    report.push(("TD-PI", single, parallel));
    group.finish();

    println!("\n| model | one at a time [ns] | eight in parallel [ns] | ratio |\n|---|---|---|---|");
    for (name, single, parallel) in &report {
        println!("| {name} | {single:.2} | {parallel:.2} | {:.1} |", single / parallel);
    }
    let slowest = report.iter().map(|(_, single, parallel)| single / parallel).fold(f64::INFINITY, Real::at_most);
    assert!(slowest >= MIN_SPEED_UP, "eight in parallel must be at least {MIN_SPEED_UP} times as fast");
}

criterion_group!(benches, candidates);
criterion_main!(benches);
