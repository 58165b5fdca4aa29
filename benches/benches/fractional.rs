//! Compares the memory of the fractional models as a sum of exponentials with the full sum of Eq. 15.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hyst_core::{
    Build, Env, Exponentials, GlWeights, Ifm, IfmParams, Invert, Lfdm, LfdmParams, Real, Sampling, ShortMemory, Stage,
};
use hyst_ident::full_memory;
use std::hint::black_box;
use std::time::Instant;

const PERIOD: Sampling = Sampling { period: 1e-4 };
const ROWS: usize = 100_000;

fn printed() -> (LfdmParams, IfmParams) {
    (LfdmParams::PRINTED, IfmParams::PRINTED)
}

fn drive<T: Real>() -> Vec<T> {
    (0..ROWS).map(|k| T::from_f64(50.0 * (0.003 * k as f64).sin() + 5.0 * (0.019 * k as f64).sin())).collect()
}

fn run<T: Real, S: Stage<T>>(stage: &S, u: &[T]) -> Vec<T> {
    let (mut s, e) = (stage.state(), Env::default());
    let first = stage.reset(&mut s, &e, u[0]);
    std::iter::once(first).chain(u[1..].iter().map(|u| stage.step(&mut s, &e, *u))).collect()
}

/// Computes Eq. 15 directly, for an input that starts at 0.
fn direct(p: &LfdmParams, u: &[f64]) -> Vec<f64> {
    let weights = |mu| GlWeights::new(mu, p.order).take(u.len()).collect::<Vec<f64>>();
    let (wa, wb) = (weights(p.alpha), weights(p.beta));
    let (b, c) = (p.b * PERIOD.period.powf(-p.alpha), p.c * PERIOD.period.powf(-p.beta));
    let past = |w: &[f64], g: &[f64]| w.iter().zip(g.iter().rev()).map(|(w, g)| w * g).sum::<f64>();
    let mut x = Vec::with_capacity(u.len());
    for n in 0..u.len() {
        let driven = p.a * u[n] + b * past(&wa, &u[..=n]);
        x.push((driven - c * past(&wb[1..], &x)) / (1.0 + c * wb[0]));
    }
    x
}

fn steps(c: &mut Criterion) {
    let (lfdm, ifm) = printed();
    let mut group = c.benchmark_group("fractional");
    group.throughput(Throughput::Elements(ROWS as u64)).sample_size(10);
    let (u, narrow) = (drive::<f64>(), drive::<f32>());
    let model: Lfdm<f64, Exponentials<f64, 40>> = lfdm.build(&PERIOD).unwrap();
    group.bench_function("lfdm f64, 40 exponentials", |b| b.iter(|| run(&model, black_box(&u))));
    let inverse = model.invert().unwrap();
    group.bench_function("its inverse", |b| b.iter(|| run(&inverse, black_box(&u))));
    let model: Lfdm<f32, Exponentials<f32, 40>> = lfdm.build(&PERIOD).unwrap();
    group.bench_function("lfdm f32, 40 exponentials", |b| b.iter(|| run(&model, black_box(&narrow))));
    let model: Lfdm<f64, ShortMemory<f64, 1000>> = lfdm.build(&PERIOD).unwrap();
    group.bench_function("lfdm f64, short memory 1000", |b| b.iter(|| run(&model, black_box(&u))));
    let model: Ifm<f64, Exponentials<f64, 40>, 32> = ifm.build(&PERIOD).unwrap();
    group.bench_function("ifm f64, 40 exponentials", |b| b.iter(|| run(&model, black_box(&u))));
    let inverse = model.invert().unwrap();
    group.bench_function("its inverse (ifm)", |b| b.iter(|| run(&inverse, black_box(&u))));
    group.bench_function("lfdm f64, full memory by FFT", |b| {
        b.iter(|| full_memory::lfdm(&lfdm, &PERIOD, black_box(&u)));
    });
    group.finish();
    // The cost of the direct sum grows with the square of the rows: measure a tenth of the record here, and all of it
    // once below.
    let mut group = c.benchmark_group("fractional, a tenth of the record");
    group.throughput(Throughput::Elements(ROWS as u64 / 10)).sample_size(10);
    group.bench_function("lfdm f64, direct sum", |b| b.iter(|| direct(&lfdm, black_box(&u[..ROWS / 10]))));
    group.finish();
}

/// Prints the speed-up and the error of the exponentials over the whole record.
fn ratio(_: &mut Criterion) {
    // `cargo test` runs benches once as a check.
    if std::env::args().any(|a| a == "--test") {
        return;
    }
    let (lfdm, _) = printed();
    let u = drive::<f64>();
    let model: Lfdm<f64, Exponentials<f64, 40>> = lfdm.build(&PERIOD).unwrap();
    let start = Instant::now();
    let x = run(&model, black_box(&u));
    let fast = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let exact = direct(&lfdm, black_box(&u));
    let slow = start.elapsed().as_secs_f64();
    let span = exact.iter().fold(0.0, |m: f64, x| m.max(*x)) - exact.iter().fold(0.0, |m: f64, x| m.min(*x));
    let error = x.iter().zip(&exact).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / span;
    println!(
        "lfdm over {ROWS} samples: direct sum {slow:.2} s, 40 exponentials {:.1} ms: {:.0} times faster; \
         error {error:.1e} of the span",
        1e3 * fast,
        slow / fast
    );
}

criterion_group!(benches, steps, ratio);
criterion_main!(benches);
