//! Measures how often a diagnosis is right, on random simulated actuators:
//! `cargo run --release -p hyst-tests --example calibration [COUNT] [SEED] [ONE] [clumps]`; ONE is the number of a case
//! that is printed in detail; with `clumps`, the relays are in clusters.

use std::collections::BTreeMap;

use hyst_hw::Bed;
use hyst_ident::model::Effect;
use hyst_tests::calibration::{Outcome, draw_on, right, run};
use rayon::prelude::*;

/// Number of actuators that are computed in parallel.
const PARALLEL: usize = 8;

fn main() {
    let argument = |i: usize| std::env::args().nth(i).and_then(|s| s.parse::<u64>().ok());
    let (count, seed) = (argument(1).unwrap_or(40), argument(2).unwrap_or(1));
    let relays = if std::env::args().any(|word| word == "clumps") { Bed::Clumps } else { Bed::Relays };
    if let Some(one) = argument(3) {
        let o = run(&draw_on(relays, seed, one));
        println!("{}", line(&o));
        println!("test RMSE {:.5} µm extended model, {:.5} µm actuator without the effect", o.test.0, o.test.1);
        for (name, found, truth, error) in &o.parameters {
            println!("{name}: {found:.6} ± {:.6}, true {truth:.6}", error.unwrap_or(f64::NAN));
        }
        o.evidence.iter().for_each(|why| println!("{why}"));
        return;
    }
    println!("{count} actuators from seed {seed}:");
    let mut outcomes: Vec<Outcome> = Vec::new();
    let numbers: Vec<u64> = (0..count).collect();
    for chunk in numbers.chunks(PARALLEL) {
        let done: Vec<Outcome> = chunk.par_iter().map(|i| run(&draw_on(relays, seed, *i))).collect();
        for outcome in &done {
            let mark = if outcome.exact() { "" } else { "NOT: " };
            println!("  {mark:5} {}", line(outcome));
        }
        outcomes.extend(done);
    }
    summary(&outcomes);
}

fn names(list: &[Effect]) -> String {
    if list.is_empty() { "nothing".into() } else { list.iter().map(|e| e.name()).collect::<Vec<_>>().join("+") }
}

fn line(o: &Outcome) -> String {
    let disturbance = o.case.disturbed.as_ref().map_or(String::new(), |d| format!(" ({d})"));
    format!(
        "seed {} {}: {}{disturbance} → {}{}; remainder {:?}, error {:.2} × that without the effect, {:.1} s",
        o.case.seed,
        o.case.kind.name(),
        names(&o.truth),
        names(&o.named),
        if o.true_verdict() { "" } else { " (verdict NOT true)" },
        o.remainder,
        o.ratio(),
        o.seconds
    )
}

/// Returns the quantile at `share`.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get((share * (sorted.len().max(1) - 1) as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

fn rate(what: &str, good: usize, of: usize) {
    println!("{what}: {good} of {of} ({:.1} %)", 100.0 * good as f64 / of.max(1) as f64);
}

fn summary(outcomes: &[Outcome]) {
    let (disturbed, listed): (Vec<&Outcome>, Vec<&Outcome>) = outcomes.iter().partition(|o| o.case.disturbed.is_some());
    let (free, with): (Vec<&Outcome>, Vec<&Outcome>) = listed.into_iter().partition(|o| o.truth.is_empty());
    println!();
    matrix(&with);
    rate("exact set of names", with.iter().chain(&free).filter(|o| o.exact()).count(), with.len() + free.len());
    rate(
        "    with one effect",
        with.iter().filter(|o| o.truth.len() == 1 && o.exact()).count(),
        with.iter().filter(|o| o.truth.len() == 1).count(),
    );
    rate(
        "    with two",
        with.iter().filter(|o| o.truth.len() == 2 && o.exact()).count(),
        with.iter().filter(|o| o.truth.len() == 2).count(),
    );
    rate("false alarms without any effect", free.iter().filter(|o| !o.named.is_empty()).count(), free.len());
    rate(
        "wrong names with an unlisted disturbance",
        disturbed.iter().filter(|o| !o.wrong().is_empty()).count(),
        disturbed.len(),
    );
    rate("true verdicts", outcomes.iter().filter(|o| o.true_verdict()).count(), outcomes.len());
    let ratios: Vec<f64> = with.iter().map(|o| o.ratio()).collect();
    println!(
        "test error / that of the actuator without the effect: median {:.2}, 90th percentile {:.2}",
        quantile(&ratios, 0.5),
        quantile(&ratios, 0.9)
    );
    let parameters: Vec<_> = with.iter().flat_map(|o| o.parameters.iter()).collect();
    rate(
        "parameters within three standard errors or 2 %",
        parameters.iter().filter(|(_, found, truth, error)| right(*found, *truth, *error)).count(),
        parameters.len(),
    );
    for (name, found, truth, error) in
        parameters.iter().filter(|(_, found, truth, error)| !right(*found, *truth, *error))
    {
        println!("    {name}: {found:.6} ± {:.6}, true {truth:.6}", error.unwrap_or(f64::NAN));
    }
    let seconds: Vec<f64> = outcomes.iter().map(|o| o.seconds).collect();
    println!(
        "duration of a diagnosis, several in parallel: median {:.1} s, longest {:.1} s",
        quantile(&seconds, 0.5),
        quantile(&seconds, 1.0)
    );
}

/// Prints the confusion matrix: true effects in rows, named effects in columns.
fn matrix(with: &[&Outcome]) {
    let mut counts: BTreeMap<(Effect, Effect), usize> = BTreeMap::new();
    let mut missed: BTreeMap<Effect, usize> = BTreeMap::new();
    for o in with {
        for e in &o.truth {
            if o.named.contains(e) {
                *counts.entry((*e, *e)).or_default() += 1;
            } else {
                *missed.entry(*e).or_default() += 1;
            }
            for wrong in o.wrong() {
                *counts.entry((*e, wrong)).or_default() += 1;
            }
        }
    }
    print!("{:16}", "true \\ named");
    Effect::ALL.iter().for_each(|e| print!("{:>6}", &e.name()[..e.name().len().min(5)]));
    println!("{:>8}", "missed");
    for row in Effect::ALL {
        print!("{:16}", row.name());
        Effect::ALL.iter().for_each(|c| print!("{:>6}", counts.get(&(row, *c)).copied().unwrap_or(0)));
        println!("{:>8}", missed.get(&row).copied().unwrap_or(0));
    }
}
