//! Measures the identifications of the papers with their settings, and the speed-up of a second core.
//!
//! `cargo run --release -p hyst-benches --example papers`

use std::hint::black_box;
use std::ops::ControlFlow;

use hyst_benches::clock::{shortest, timed};
use hyst_benches::task::Task;
use hyst_core::Kind;
use hyst_ident::fit::{FitOptions, fit_with};
use hyst_ident::optimize::{Found, Method, Stop, minimize};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn search(task: &Task, name: &str, evaluations: u64, seed: u64) -> Found {
    let dimensions = task.space.dimensions();
    let method = Method::named(name, dimensions).expect("a search of that name");
    let mut search = method.build(dimensions, evaluations, seed).expect("valid settings");
    // Up to the last generation, as in the papers.
    let stop = Stop { tolerance: -1.0, ..Stop::after(evaluations) };
    minimize(&task.space, &*task.cost(), search.as_mut(), &stop, &mut |_| ControlFlow::Continue(())).expect("a search")
}

fn main() {
    let cores = rayon::current_num_threads();
    println!("{cores} threads; times are the minimum of several runs\n");
    activation();
    wolves(cores);
    second_core();
}

/// Measures Xie et al., table 7: 30 particles, 200 iterations, search of all four parameters.
fn activation() {
    let task = Task::tanh();
    let seconds = shortest(5, || {
        black_box(search(&task, "pso-xie", 6000, 1));
    });
    println!(
        "activation functions, tanh: 30 particles × 200 iterations × {} samples: {:.4} s (the paper: 52 … 84 s)",
        task.rows().rows.len(),
        seconds
    );
}

/// Measures the grey wolf optimizer of the paper on temperature-dependent models: 100 wolves, 3000 generations, three
/// temperatures.
fn wolves(cores: usize) {
    let task = Task::td_pi();
    let (wolves, generations, samples) = (100u64, 3000u64, task.rows().rows.len());
    let (found, spent) = timed(|| search(&task, "gwo-paper", wolves * generations, 1));
    println!(
        "TD-PI: {wolves} wolves × {generations} generations × {samples} samples: {:.1} s, \
         {} of CPU time; final error {:.3} noise floors",
        spent.wall,
        spent.cpu.map_or("unknown".into(), |s| format!("{s:.1} s")),
        found.cost / task.floor
    );
    // The search aborts hopeless candidates early; here every candidate is evaluated over the whole record.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let point = || task.truth.iter().map(|x| x * rng.random_range(0.9..1.1)).collect::<Vec<f64>>();
    let points: Vec<f64> = std::iter::repeat_with(point).take(96).flatten().collect();
    let (cost, never, mut costs) = (task.cost(), vec![f64::INFINITY; 96], vec![0.0; 96]);
    let each = 1e9 / (96 * samples) as f64;
    let whole = each * shortest(15, || cost.costs(black_box(&points), &never, &mut costs));
    let core = spent.cpu.unwrap_or(spent.wall * cores as f64) * 1e9 / (wolves * generations * samples as u64) as f64;
    println!(
        "    per candidate and sample: {core:.2} ns of CPU time in this search, {whole:.2} ns without early abort"
    );
}

/// Measures a Bouc-Wen fit of 50,000 samples on one thread and on two, in turn so that both have the same load of the
/// machine. Two such fits at once, each on its own thread, show the capacity of two threads.
fn second_core() {
    const RUNS: usize = 40;
    let record = Task::bouc_wen(50_000).record();
    let options = FitOptions { seed: 1, ..FitOptions::default() };
    let pool = |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
    let (one, other, both) = (pool(1), pool(1), pool(2));
    let fit = |pool: &rayon::ThreadPool| {
        pool.install(|| fit_with(&record, Kind::BoucWen, &options, &mut |_| ControlFlow::Continue(())).expect("a fit"))
    };
    let two_fits = || {
        std::thread::scope(|scope| {
            let second = scope.spawn(|| fit(&other));
            fit(&one);
            second.join().expect("a fit");
        });
    };
    let mut shortest = [f64::INFINITY; 3];
    for _ in 0..RUNS {
        // Measure the cases that need both cores first, one after the other: a core that was idle is slow for
        // about 0.1 s.
        let pair = timed(two_fits).1.wall;
        let shared = timed(|| fit(&both)).1.wall;
        let walls = [timed(|| fit(&one)).1.wall, shared, pair];
        shortest.iter_mut().zip(walls).for_each(|(shortest, wall)| *shortest = shortest.min(wall));
    }
    let [single, shared, pair] = shortest;
    println!(
        "Bouc-Wen fit of 50000 samples: {single:.2} s on one thread, {shared:.2} s on two, {:.2} times as fast; two fits at once: {pair:.2} s, so two threads of this machine have {:.2} times the capacity of one",
        single / shared,
        2.0 * single / pair
    );
}
