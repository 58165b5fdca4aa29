//! Time of one sample through every stage and operator, and its ratio to a straight loop written by hand.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hyst_core::{
    Build, Chain, CompensatorOptions, CreepParams, Dpm, Env, Everett, Grid, Invert, LagParams, MirrorParams, Pi, Real,
    ResonanceParams, Sampling, Search, Stage, TemperatureParams,
};
use std::hint::black_box;

const ROWS: usize = 4096;
const PERIOD: Sampling = Sampling { period: 1e-3 };

fn drive<T: Real>() -> Vec<T> {
    (0..ROWS)
        .map(|k| T::from_f64(60.0 * (1.0 - (0.01 * k as f64).cos()) * (0.5 + 0.5 * (0.0013 * k as f64).sin())))
        .collect()
}

fn run<T: Real, S: Stage<T>>(c: &mut Criterion, name: &str, stage: &S) {
    run_on(c, name, stage, &drive::<T>());
}

fn run_on<T: Real, S: Stage<T>>(c: &mut Criterion, name: &str, stage: &S, u: &[T]) {
    let env = vec![Env::<T>::default(); ROWS];
    let mut y = vec![T::ZERO; ROWS];
    let mut state = stage.state();
    stage.reset(&mut state, &env[0], u[0]);
    let mut group = c.benchmark_group("step");
    group.throughput(Throughput::Elements(ROWS as u64));
    group.bench_function(name, |b| b.iter(|| stage.block(&mut state, black_box(&env), black_box(u), &mut y)));
    group.finish();
}

fn thresholds() -> (Vec<f64>, Vec<f64>) {
    ((1..=16).map(|i| 3.5 * f64::from(i)).collect(), vec![0.01; 16])
}

/// PI-16 as one would write it by hand, against which the operator is measured.
fn by_hand(c: &mut Criterion) {
    let (r, w) = thresholds();
    let u = drive::<f64>();
    let (mut p, mut y) = (vec![0.0; 16], vec![0.0; ROWS]);
    let mut group = c.benchmark_group("step");
    group.throughput(Throughput::Elements(ROWS as u64));
    group.bench_function("pi-16 f64, straight loop by hand", |b| {
        b.iter(|| {
            for (y, u) in y.iter_mut().zip(black_box(&u)) {
                let mut sum = 0.1 * u;
                for i in 0..16 {
                    p[i] = f64::max(u - r[i], f64::min(u + r[i], p[i]));
                    sum += w[i] * p[i];
                }
                *y = sum;
            }
        });
    });
    group.finish();
}

fn stages(c: &mut Criterion) {
    let (r, w) = thresholds();
    by_hand(c);
    run::<f64, _>(c, "pi-16 f64", &Pi::<f64, 16>::new(0.1, &r, &w).unwrap());
    run::<f32, _>(c, "pi-16 f32", &Pi::<f32, 16>::new(0.1, &r, &w).unwrap());
    run::<f64, _>(c, "pi-16 inverse f64", &Pi::<f64, 16>::new(0.1, &r, &w).unwrap().invert().unwrap());
    let grid = Grid { low: 0.0, high: 120.0, cells: 50 };
    let everett =
        Box::new(Everett::<f64, 51>::new(grid, 0.0, |a, b| if a == b { 0.1 } else { 0.002 }, |_| 0.01).unwrap());
    run::<f64, _>(c, "preisach 50x50 f64", &*everett);
    run::<f64, _>(c, "preisach 50x50 inverse f64", &everett.invert().unwrap());
    // A turn at nearly every sample.
    let jagged: Vec<f64> = (0..ROWS).map(|k| 60.0 + 59.0 * (2.4 * k as f64 + 0.3 * (k as f64).sin()).sin()).collect();
    run_on(c, "preisach 50x50 f64, jagged drive", &*everett, &jagged);
    let mirror = MirrorParams {
        rate_low: 2e3,
        rate_high: 16e3,
        rates: 8,
        change_low: -80.0,
        change_high: 80.0,
        changes: 9,
        weights: [0.9; 72],
    };
    let dpm = Box::new(Dpm::new(*everett.clone(), mirror.build(&()).unwrap(), 20.0, &PERIOD).unwrap());
    run::<f64, Dpm<f64, 51, 8, 9>>(c, "dpm 50x50 f64", &dpm);
    run_on(c, "dpm 50x50 f64, jagged drive", &*dpm, &jagged);
    run::<f64, _>(c, "dpm 50x50 inverse by search f64", &Search::new(*dpm, 0.0, 120.0, 1e-9).unwrap());
    let lag: hyst_core::Lag<f64> = LagParams { seconds: 3e-3 }.build(&PERIOD).unwrap();
    run::<f64, _>(c, "lag f64", &lag);
    let mode = ResonanceParams { hz: 90.0, damping: 0.03, gain: 1.0 };
    let resonance: hyst_core::Resonance<f64> = mode.build(&PERIOD).unwrap();
    run::<f64, _>(c, "resonance f64", &resonance);
    let bank = CreepParams { seconds: [0.05, 0.16, 0.5, 1.6, 5.0, 16.0, 50.0], shares: [0.01; 7] };
    let creep: hyst_core::Creep<f64, 8> = bank.build(&PERIOD).unwrap();
    run::<f64, _>(c, "creep-7 f64", &creep);
    let chain: Chain<f64, _, 8, 8> = Chain::new(Pi::<f64, 16>::new(0.1, &r, &w).unwrap())
        .with_lag(&LagParams { seconds: 3e-3 }, &PERIOD)
        .and_then(|c| c.with_temperature(&TemperatureParams { per_kelvin: 0.005, reference_degc: 0.0 }))
        .and_then(|c| c.with_creep(&bank, &PERIOD))
        .and_then(|c| c.with_resonance(&mode, &PERIOD))
        .unwrap();
    run::<f64, _>(c, "chain f64: lag, pi-16, temperature, creep-7, resonance", &chain);
    let inverse = Box::new(chain.compensator::<255>(&PERIOD, &CompensatorOptions::default()).unwrap());
    run::<f64, _>(c, "its compensator f64", &*inverse);
}

criterion_group!(benches, stages);
criterion_main!(benches);
