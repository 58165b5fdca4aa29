//! What chosen experiments save: simulated actuators with one or two effects are diagnosed after the usual identification experiment, and
//! after experiments that are chosen one by one: `cargo run --release -p hyst-tests --example experiments [COUNT] [SEED]`.

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
/// Time for the chosen experiments \[s\], and what they are to reach.
const WITHIN_S: f64 = 36.0;
const AIM: Aim = Aim { probability: 0.95, precision: 0.1 };
/// Actuators that are computed side by side.
const AT_ONCE: usize = 2;

/// What came of one way.
struct Way {
    named: Vec<Effect>,
    seconds: f64,
    experiments: usize,
    /// Standard errors as shares of the values, by parameter.
    errors: BTreeMap<String, f64>,
}

fn main() {
    let argument = |i: usize| std::env::args().nth(i).and_then(|s| s.parse::<u64>().ok());
    let (count, seed) = (argument(1).unwrap_or(40) as usize, argument(2).unwrap_or(1));
    // One or two effects of the list.
    let numbers: Vec<u64> = (0..).filter(|i| (5..18).contains(&(i % 20))).take(count).collect();
    let (mut shares, mut ratios) = (Vec::new(), Vec::new());
    let (mut same, mut right_usual, mut right_chosen) = (0, 0, 0);
    // The usual record alone is a minute of work.
    for some in numbers.chunks(AT_ONCE) {
        let done: Vec<(Vec<Effect>, Way, Way)> = some.par_iter().map(|i| both(&draw(seed, *i))).collect();
        for (i, (truth, usual, chosen)) in some.iter().zip(&done) {
            let share = chosen.seconds / usual.seconds;
            println!(
                "{i:4} {:28} usual {:28} {:5.1} s   chosen {:28} {:5.1} s in {}",
                names(truth),
                names(&usual.named),
                usual.seconds,
                names(&chosen.named),
                chosen.seconds,
                chosen.experiments
            );
            shares.push(share);
            same += usize::from(usual.named == chosen.named);
            right_usual += usize::from(usual.named == *truth);
            right_chosen += usize::from(chosen.named == *truth);
            let both = usual.errors.iter().filter_map(|(name, error)| Some(chosen.errors.get(name)? / error));
            ratios.extend(both.filter(|ratio| ratio.is_finite()));
        }
    }
    println!(
        "drive time, chosen over usual: median {:.2}, largest {:.2}",
        quantile(&shares, 0.5),
        quantile(&shares, 1.0)
    );
    println!("the same names: {same} of {count}; the right ones: usual {right_usual}, chosen {right_chosen}");
    println!(
        "standard errors of parameters, chosen over usual: median {:.2}, quartiles {:.2} and {:.2} ({} parameters)",
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

/// The actuator's effects, and what both ways find.
fn both(case: &Case) -> (Vec<Effect>, Way, Way) {
    let plant = || Plant::new(case.plant.clone()).expect("the actuator is sound");
    let mut truth: Vec<Effect> = case.plant.effects().iter().filter_map(|name| name.parse().ok()).collect();
    truth.sort();
    let range = plant().capabilities().voltage;
    let limits = Limits { rate_hz: RATE, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: None };
    let usual = Identification::at_rate(RATE, case.seed).drive(&limits).expect("a drive");
    let train = played(&mut plant(), &usual, RATE, OutputUnit::Micrometre, "usual");
    let found = diagnosed(&train, case.kind);
    let time = usual.time();
    let usual = way(&found, time.last().unwrap_or(&0.0) - time[0], 1);
    (truth, usual, chosen(&mut plant(), case, limits))
}

/// As `close-loop --until` does, but for a slow amplifier, which none of these has.
fn chosen(plant: &mut Plant, case: &Case, limits: Limits) -> Way {
    let mut planner = Planner::new(limits, AIM, WITHIN_S, case.seed);
    let Next::Play(mut next) = planner.first().expect("a drive") else { panic!("there is time for a first look") };
    let (mut records, mut kind) = (Vec::new(), case.kind);
    loop {
        records.push(played(plant, &next.drive, RATE, OutputUnit::Micrometre, "chosen"));
        let train = Record::join(records.clone()).expect("records of one device");
        let mut found = diagnosed(&train, kind);
        if found.findings.remainder.kind == RemainderKind::BaseCapacity && kind == Kind::Pi {
            kind = Kind::Preisach;
            found = diagnosed(&train, kind);
        }
        match planner.next(&found.findings, &train).expect("a drive").1 {
            Next::Play(chosen) => next = chosen,
            Next::End(_) => return way(&found, planner.spent(), records.len()),
        }
    }
}

fn diagnosed(train: &Record, kind: Kind) -> Diagnosis {
    let model = fit(train, kind, &FitOptions::default()).expect("a fit");
    diagnose(train, None, &model, &DiagnoseOptions::default(), &|_| {}).expect("a diagnosis")
}

fn way(found: &Diagnosis, seconds: f64, experiments: usize) -> Way {
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
    Way { named, seconds, experiments, errors }
}
