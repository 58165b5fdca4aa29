//! The Rust part of `benches/python/peers.py`: writes the records to a folder, runs the searches of this project and of
//! the crate `metaheuristics-nature`, and prints the results as JSON.
//!
//! `cargo run --release -p hyst-benches --example peers -- FOLDER`

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use hyst_benches::clock::{Spent, timed};
use hyst_benches::task::{Model, Task};
use hyst_core::{BoucWen, BoucWenParams, Build, Env, Kind, Stage, TdPi, TdPiParams};
use hyst_ident::fit::{FitOptions, fit_with};
use hyst_ident::optimize::{Method, Stop, minimize};
use metaheuristics_nature as mh;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];
/// Default of `fit`.
const EVALUATIONS_PER_VARIABLE: u64 = 1500;
/// Number of points at which the objectives of both languages are compared.
const PROBES: usize = 8;
/// Cost of invalid parameters for the other libraries.
const INVALID_COST: f64 = 1e6;

#[derive(Serialize)]
struct Report {
    tasks: Vec<TaskReport>,
}

#[derive(Serialize)]
struct TaskReport {
    name: &'static str,
    record: PathBuf,
    names: Vec<String>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    floor: f64,
    evaluations: u64,
    seeds: [u64; 5],
    no_model: f64,
    probes: Vec<Probe>,
    runs: Vec<Run>,
}

#[derive(Serialize)]
struct Probe {
    point: Vec<f64>,
    cost: f64,
}

/// Results of one tool with one setting and five seeds.
#[derive(Serialize)]
struct Run {
    tool: &'static str,
    setting: String,
    results: Vec<Outcome>,
}

#[derive(Serialize)]
struct Outcome {
    cost: f64,
    evaluations: u64,
    #[serde(flatten)]
    spent: Spent,
}

fn main() {
    let folder = PathBuf::from(std::env::args().nth(1).expect("give the folder for the records"));
    std::fs::create_dir_all(&folder).expect("the folder can be created");
    let tasks = [Task::td_pi(), Task::bouc_wen(5000)];
    let report = Report { tasks: tasks.iter().map(|task| report(task, &folder)).collect() };
    println!("{}", serde_json::to_string(&report).expect("numbers"));
}

fn report(task: &Task, folder: &Path) -> TaskReport {
    let record = folder.join(format!("{}.csv", task.name));
    std::fs::write(&record, task.csv()).expect("the record can be written");
    let evaluations = EVALUATIONS_PER_VARIABLE * task.space.dimensions() as u64;
    let of = |f: fn(&hyst_ident::optimize::Variable) -> f64| task.space.variables().iter().map(f).collect();
    let mut runs = vec![fitted(task)];
    let cores = rayon::current_num_threads();
    for threads in [cores, 1] {
        runs.push(ours(task, evaluations, threads));
    }
    runs.extend(nature(task, evaluations));
    TaskReport {
        name: task.name,
        record,
        names: task.space.variables().iter().map(|v| v.name.clone()).collect(),
        lower: of(|v| v.lower),
        upper: of(|v| v.upper),
        floor: task.floor,
        evaluations,
        seeds: SEEDS,
        no_model: INVALID_COST,
        probes: probes(task),
        runs,
    }
}

/// Returns the true point and random valid points of the box.
fn probes(task: &Task) -> Vec<Probe> {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut list = Vec::new();
    let mut add = |point: Vec<f64>| {
        let mut cost = [0.0];
        task.cost().costs(&point, &[f64::INFINITY], &mut cost);
        if cost[0].is_finite() {
            list.push(Probe { point, cost: cost[0] });
        }
        list.len() < PROBES
    };
    add(task.truth.clone());
    while add(task.space.values(&(0..task.space.dimensions()).map(|_| rng.random()).collect::<Vec<f64>>())) {}
    list
}

/// Runs L-SHADE over all parameters, with the same objective as the other libraries.
fn ours(task: &Task, evaluations: u64, threads: usize) -> Run {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let search = |seed: u64| {
        let (found, spent) = timed(|| {
            let method = Method::named("de", task.space.dimensions()).expect("the search de exists");
            let mut search = method.build(task.space.dimensions(), evaluations, seed).expect("valid settings");
            let on = &mut |_| ControlFlow::Continue(());
            pool.install(|| minimize(&task.space, &*task.cost(), search.as_mut(), &Stop::after(evaluations), on))
        });
        let found = found.expect("some parameters are valid");
        Outcome { cost: found.cost, evaluations: found.evaluations, spent }
    };
    let setting = format!("de, {threads} thread{}", if threads == 1 { "" } else { "s" });
    Run { tool: "hystctl", setting, results: SEEDS.map(search).into() }
}

/// Runs `hystctl fit`: a search of the nonlinear parameters, a linear solution for the others, and a local refinement.
fn fitted(task: &Task) -> Run {
    let record = task.record();
    let kind = match task.model {
        Model::TdPi => Kind::TdPi,
        Model::BoucWen => Kind::BoucWen,
        Model::Tanh => Kind::Tanh,
    };
    let fit = |seed: u64| {
        let options = FitOptions { seed, ..FitOptions::default() };
        let (fit, spent) = timed(|| fit_with(&record, kind, &options, &mut |_| ControlFlow::Continue(())));
        let fit = fit.expect("a fit");
        let cost = fit.estimate.map_or(f64::NAN, |e| e.left);
        Outcome { cost, evaluations: fit.evaluations, spent }
    };
    Run {
        tool: "hystctl fit",
        setting: "variable projection, then Levenberg-Marquardt".into(),
        results: SEEDS.map(fit).into(),
    }
}

/// Objective for a library: one candidate at a time through the model of the core.
struct SingleCandidate<'a> {
    task: &'a Task,
    bounds: Vec<[f64; 2]>,
}

impl SingleCandidate<'_> {
    fn error<S: Stage<f64>>(&self, stage: &S) -> f64 {
        let data = self.task.rows();
        let (mut state, mut sum) = (stage.state(), 0.0);
        for segment in data.segments {
            for k in segment.clone() {
                let row = &data.rows[k];
                let e = Env { temperature: row.temperature, ..Env::default() };
                let first = k == segment.start;
                let y =
                    if first { stage.reset(&mut state, &e, row.input) } else { stage.step(&mut state, &e, row.input) };
                sum += (y - data.output[k]) * (y - data.output[k]);
            }
        }
        (sum / data.rows.len() as f64).sqrt()
    }
}

impl mh::Bounded for SingleCandidate<'_> {
    fn bound(&self) -> &[[f64; 2]] {
        &self.bounds
    }
}

impl mh::ObjFunc for SingleCandidate<'_> {
    type Ys = f64;

    fn fitness(&self, x: &[f64]) -> f64 {
        let cost = match (self.task.model, x) {
            (Model::TdPi, &[alpha, epsilon, tau, eta, a0, a1, b0, b1]) => {
                let p = TdPiParams { alpha, epsilon, tau, eta, a0, a1, b0, b1, ..TdPiParams::PRINTED };
                p.build(&()).map(|m: TdPi<f64, 9>| self.error(&m)).ok()
            }
            (Model::BoucWen, &[k0, alpha, beta, gamma]) => {
                BoucWenParams { k0, alpha, beta, gamma, n: 1.0 }.build(&()).map(|m: BoucWen<f64>| self.error(&m)).ok()
            }
            _ => None,
        };
        cost.filter(|c| c.is_finite()).unwrap_or(INVALID_COST)
    }
}

/// Runs the differential evolution of `metaheuristics-nature` on all cores, with its default and with common settings.
fn nature(task: &Task, evaluations: u64) -> Vec<Run> {
    use mh::methods::de::Strategy::{C1F1, C2F1, C2F2, C2F3};
    let bounds: Vec<[f64; 2]> = task.space.variables().iter().map(|v| [v.lower, v.upper]).collect();
    let settings = [
        ("defaults", C1F1, 400),
        ("best/1/exp", C1F1, 80),
        ("best/1/bin", C2F1, 80),
        ("rand/1/bin", C2F2, 80),
        ("current-to-best/1/bin", C2F3, 80),
    ];
    let run = |(name, strategy, population): (&str, mh::methods::de::Strategy, usize)| {
        let search = |seed: u64| {
            let generations = evaluations / population as u64 - 1;
            let objective = SingleCandidate { task, bounds: bounds.clone() };
            let (solved, spent) = timed(|| {
                mh::Solver::build(mh::De::default().strategy(strategy), objective)
                    .seed(seed)
                    .pop_num(population)
                    .task(|ctx| ctx.r#gen >= generations)
                    .solve()
            });
            Outcome { cost: *solved.as_best_fit(), evaluations: population as u64 * (generations + 1), spent }
        };
        let setting = format!("DE {name}, population {population}");
        Run { tool: "metaheuristics-nature", setting, results: SEEDS.map(search).into() }
    };
    settings.map(run).into()
}
