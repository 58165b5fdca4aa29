//! Time per sample of every model of the core, in `f32` and `f64`, relative to a hand-written loop over 16 play
//! operators in the same run. `cargo bench -p hyst-benches --bench models` prints the table at its end.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use hyst_cases::{Case, Precision, SAMPLES, Visit, each, inputs};
use hyst_core::{Env, Everett, Grid, Invert, Stage};

/// Name of the hand-written loop in the table.
const BY_HAND: &str = "pi_16 by hand";

/// Nanoseconds per sample by model and precision: the fastest batch of a run.
type Times = RefCell<BTreeMap<(String, &'static str), f64>>;

fn record(c: &mut Criterion, times: &Times, name: &str, precision: &'static str, mut pass: impl FnMut(), rows: usize) {
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Elements(rows as u64));
    group.bench_function(precision, |b| {
        b.iter_custom(|passes| {
            let start = Instant::now();
            for _ in 0..passes {
                pass();
            }
            let elapsed = start.elapsed();
            let per_sample = elapsed.as_nanos() as f64 / (passes as f64 * rows as f64);
            let mut times = times.borrow_mut();
            let best = times.entry((name.to_owned(), precision)).or_insert(f64::INFINITY);
            *best = best.min(per_sample);
            elapsed
        });
    });
    group.finish();
}

fn stage<T: Precision, S: Stage<T>>(c: &mut Criterion, times: &Times, name: &str, stage: &S, env: &[Env<T>], u: &[T]) {
    let mut state = Box::new(stage.state());
    let mut y = vec![T::ZERO; u.len()];
    stage.reset(&mut state, &env[0], u[0]);
    record(c, times, name, T::NAME, || stage.block(&mut state, black_box(env), black_box(u), &mut y), u.len());
}

struct Bench<'a> {
    criterion: &'a mut Criterion,
    times: &'a Times,
}

impl Visit for Bench<'_> {
    fn visit<C: Case, T: Precision>(&mut self) {
        let (mut u, mut env) = ([T::ZERO; SAMPLES], [Env::default(); SAMPLES]);
        inputs::<C, T>(&mut u, &mut env);
        let model = Box::new(C::build::<T>().unwrap_or_else(|e| panic!("{}: {e}", C::NAME)));
        stage(self.criterion, self.times, C::NAME, &*model, &env, &u);
    }
}

/// Hand-written loop over 16 play operators, for the samples of the model `pi_16`.
macro_rules! by_hand {
    ($name:ident, $t:ty) => {
        fn $name(c: &mut Criterion, times: &Times) {
            let (mut u, mut env) = ([0.0; SAMPLES], [Env::default(); SAMPLES]);
            inputs::<hyst_cases::list::pi_16, $t>(&mut u, &mut env);
            let r: [$t; 16] = std::array::from_fn(|i| 50.0 * (i + 1) as $t / 16.0);
            let w: [$t; 16] = black_box([1.0 / 160.0; 16]);
            let (mut p, mut y) = ([0.0; 16], [0.0; SAMPLES]);
            let pass = || {
                for (y, u) in y.iter_mut().zip(black_box(&u)) {
                    let mut sum = 0.1 * u;
                    for i in 0..16 {
                        p[i] = <$t>::max(u - r[i], <$t>::min(u + r[i], p[i]));
                        sum += w[i] * p[i];
                    }
                    *y = sum;
                }
                black_box(&mut y);
            };
            record(c, times, BY_HAND, stringify!($t), pass, SAMPLES);
        }
    };
}
by_hand!(by_hand_f32, f32);
by_hand!(by_hand_f64, f64);

/// Measures a Preisach triangle of 50 × 50 cells with a random input, which changes the reversal stack at every sample.
fn everett<T: Precision>(c: &mut Criterion, times: &Times) {
    let grid = Grid { low: 0.0, high: 120.0, cells: 50 };
    let density = |a, b| if a == b { 0.1 } else { 0.002 };
    let map = Box::new(Everett::<T, 51>::new(grid, 0.0, density, |_| 0.01).expect("a valid map"));
    let mut seed = 1u32;
    let u: Vec<T> = (0..4096)
        .map(|_| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            T::from_f64(120.0 * f64::from(seed) / f64::from(u32::MAX))
        })
        .collect();
    let env = vec![Env::default(); u.len()];
    stage(c, times, "everett_50, random reversals", &*map, &env, &u);
    let inverse = Box::new(map.invert().expect("the map is rising"));
    let reach: Vec<T> = u.iter().map(|u| *u * T::from_f64(0.05)).collect();
    stage(c, times, "everett_50_inverse, random reversals", &*inverse, &env, &reach);
}

fn table(times: &BTreeMap<(String, &'static str), f64>) {
    let of = |name: &str, precision| times.get(&(name.to_owned(), precision)).copied();
    let (Some(single), Some(double)) = (of(BY_HAND, "f32"), of(BY_HAND, "f64")) else { return };
    println!(
        "\nns per sample, and the ratio to the hand-written loop of 16 plays ({single:.1} ns f32, {double:.1} ns f64)\n"
    );
    println!("| model | f32 | × | f64 | × |\n|---|---:|---:|---:|---:|");
    let names: std::collections::BTreeSet<&String> = times.keys().map(|(name, _)| name).collect();
    for name in names {
        let (Some(a), Some(b)) = (of(name, "f32"), of(name, "f64")) else { continue };
        println!("| {name} | {a:.1} | {:.2} | {b:.1} | {:.2} |", a / single, b / double);
    }
}

fn main() {
    // 140 benches: one second each is enough for the minimum of many passes.
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800))
        .sample_size(20)
        .configure_from_args();
    let times = Times::default();
    by_hand_f32(&mut criterion, &times);
    by_hand_f64(&mut criterion, &times);
    everett::<f32>(&mut criterion, &times);
    everett::<f64>(&mut criterion, &times);
    each(&mut Bench { criterion: &mut criterion, times: &times });
    criterion.final_summary();
    table(&times.borrow());
}
