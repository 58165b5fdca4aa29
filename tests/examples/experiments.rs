//! Compares planned experiments with the standard one: simulated actuators with one or two effects are diagnosed after
//! the standard identification experiment, and after experiments that are planned one by one:
//! `cargo run --release -p hyst-tests --example experiments [COUNT] [SEED]`.

use std::collections::BTreeMap;

use hyst_hw::{Daq, Plant};
use hyst_ident::diagnose::{DiagnoseOptions, Diagnosis, RemainderKind, diagnose};
use hyst_ident::excite::{Identification, Limits};
use hyst_ident::experiment::{Aim, Next, Planner};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::{Effect, Kind};
use hyst_ident::record::{OutputUnit, Record};
use hyst_tests::calibration::{Case, draw};
use hyst_tests::played;
use rayon::prelude::*;

/// Sample rate \[Hz\].
const RATE: f64 = 500.0;
/// Time limit of the planned experiments \[s\], and their aim.
const TIME_LIMIT_S: f64 = 36.0;
const AIM: Aim = Aim { probability: 0.95, precision: 0.1 };
/// Number of actuators that are computed in parallel.
const PARALLEL: usize = 2;

/// Result of a diagnosis.
struct Outcome {
    named: Vec<Effect>,
    seconds: f64,
    experiments: usize,
    /// Relative standard errors by parameter.
    errors: BTreeMap<String, f64>,
}

fn main() {
    let argument = |i: usize| std::env::args().nth(i).and_then(|s| s.parse::<u64>().ok());
    let (count, seed) = (argument(1).unwrap_or(40) as usize, argument(2).unwrap_or(1));
    // One or two effects of the list.
    let numbers: Vec<u64> = (0..).filter(|i| (5..18).contains(&(i % 20))).take(count).collect();
    let (mut shares, mut ratios) = (Vec::new(), Vec::new());
    let (mut same, mut right_standard, mut right_planned) = (0, 0, 0);
    // The standard record alone takes about a minute.
    for chunk in numbers.chunks(PARALLEL) {
        let done: Vec<(Vec<Effect>, Outcome, Outcome)> = chunk.par_iter().map(|i| both(&draw(seed, *i))).collect();
        for (i, (truth, standard, planned)) in chunk.iter().zip(&done) {
            let share = planned.seconds / standard.seconds;
            println!(
                "{i:4} {:28} standard {:28} {:5.1} s   planned {:28} {:5.1} s in {}",
                names(truth),
                names(&standard.named),
                standard.seconds,
                names(&planned.named),
                planned.seconds,
                planned.experiments
            );
            shares.push(share);
            same += usize::from(standard.named == planned.named);
            right_standard += usize::from(standard.named == *truth);
            right_planned += usize::from(planned.named == *truth);
            let both = standard.errors.iter().filter_map(|(name, error)| Some(planned.errors.get(name)? / error));
            ratios.extend(both.filter(|ratio| ratio.is_finite()));
        }
    }
    println!(
        "drive time, planned / standard: median {:.2}, largest {:.2}",
        quantile(&shares, 0.5),
        quantile(&shares, 1.0)
    );
    println!("same names: {same} of {count}; right names: standard {right_standard}, planned {right_planned}");
    println!(
        "standard errors of parameters, planned / standard: median {:.2}, quartiles {:.2} and {:.2} ({} parameters)",
        quantile(&ratios, 0.5),
        quantile(&ratios, 0.25),
        quantile(&ratios, 0.75),
        ratios.len()
    );
}

fn names(list: &[Effect]) -> String {
    if list.is_empty() { "nothing".into() } else { list.iter().map(|e| e.name()).collect::<Vec<_>>().join("+") }
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get((share * (sorted.len().max(1) - 1) as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

/// Returns the actuator's effects, and the results of the standard and of the planned experiments.
fn both(case: &Case) -> (Vec<Effect>, Outcome, Outcome) {
    let plant = || Plant::new(case.plant.clone()).expect("the actuator is valid");
    let mut truth: Vec<Effect> = case.plant.effects().iter().filter_map(|name| name.parse().ok()).collect();
    truth.sort();
    let range = plant().capabilities().voltage;
    let limits = Limits { rate_hz: RATE, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: None };
    let drive = Identification::at_rate(RATE, case.seed).drive(&limits).expect("a drive");
    let train = played(&mut plant(), &drive, RATE, OutputUnit::Micrometre, "standard");
    let found = diagnosed(&train, case.kind);
    let time = drive.time();
    let standard = outcome(&found, time.last().unwrap_or(&0.0) - time[0], 1);
    (truth, standard, planned(&mut plant(), case, limits))
}

/// Runs the planned experiments as `close-loop --until` does. `close-loop` also handles a slow amplifier; these
/// actuators have no slow amplifier.
fn planned(plant: &mut Plant, case: &Case, limits: Limits) -> Outcome {
    let mut planner = Planner::new(limits, AIM, TIME_LIMIT_S, case.seed);
    let Next::Play(mut next) = planner.first().expect("a drive") else { panic!("no time for a first experiment") };
    let (mut records, mut kind) = (Vec::new(), case.kind);
    loop {
        records.push(played(plant, &next.drive, RATE, OutputUnit::Micrometre, "planned"));
        let train = Record::join(records.clone()).expect("records of one device");
        let mut found = diagnosed(&train, kind);
        if found.findings.remainder.kind == RemainderKind::BaseCapacity && kind == Kind::Pi {
            kind = Kind::Preisach;
            found = diagnosed(&train, kind);
        }
        match planner.next(&found.findings, &train).expect("a drive").1 {
            Next::Play(experiment) => next = experiment,
            Next::End(_) => return outcome(&found, planner.spent(), records.len()),
        }
    }
}

fn diagnosed(train: &Record, kind: Kind) -> Diagnosis {
    let model = fit(train, kind, &FitOptions::default()).expect("a fit");
    diagnose(train, None, &model, &DiagnoseOptions::default(), &|_| {}).expect("a diagnosis")
}

fn outcome(found: &Diagnosis, seconds: f64, experiments: usize) -> Outcome {
    let mut named: Vec<Effect> = found.findings.effects.iter().map(|e| e.name).collect();
    named.sort();
    named.dedup();
    let share = |found: &hyst_ident::diagnose::Found| Some((found.std_error? / found.value).abs());
    let of = |effect: &hyst_ident::diagnose::Finding| {
        let name = effect.name;
        let errors =
            effect.parameters.iter().filter_map(move |(p, found)| Some((format!("{name}.{p}"), share(found)?)));
        errors.collect::<Vec<_>>()
    };
    let errors = found.findings.effects.iter().flat_map(of).collect();
    Outcome { named, seconds, experiments, errors }
}
