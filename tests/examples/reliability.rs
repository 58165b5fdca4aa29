//! Checks the calibration of the probabilities of names, on actuators of seven hysteresis laws:
//! `cargo run --release -p hyst-tests --example reliability -- [COUNT] [SEED] [--from NUMBER] [--rows ROWS]
//! [--results FILE] [--fit] [--svg FILE] [--save DIR]`.
//!
//! Each actuator is measured, fitted and diagnosed; a record has about four times ROWS (default 3500). `--results` keeps
//! the outcome of each actuator, one JSON object a line; actuators that the file has are not run again. `--fit` fits the
//! coefficients of the probability to the results, which are then training data. Without it, the calibration error of
//! the present coefficients is printed, and `--svg` draws the reliability diagram. `--save` writes the records and
//! diagnoses nothing.

use std::io::Write as _;
use std::sync::Mutex;
use std::time::Instant;

use hyst_ident::diagnose::{DiagnoseOptions, FEATURES, Weighed, diagnose};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::Effect;
use hyst_ident::record::Record;
use hyst_ident::simulate::{Zero, simulate};
use hyst_tests::other_physics::Actuator;
use plotters::prelude::*;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

type Failure = Box<dyn std::error::Error>;

/// Bins of the diagram.
const BINS: usize = 10;
/// Unknowns of the regression: a constant and a slope for each feature.
const UNKNOWNS: usize = FEATURES + 1;

/// Outcome for one actuator.
#[derive(Serialize, Deserialize)]
struct Outcome {
    seed: u64,
    segment_rows: usize,
    number: u64,
    /// Hysteresis law, and the kind of the fitted model.
    law: String,
    kind: String,
    effects: Vec<Effect>,
    named: Vec<Effect>,
    weighed: Vec<Weighed>,
    /// Test error divided by that of the same actuator without its effects; `None` if there is none.
    ratio: Option<f64>,
    seconds: f64,
}

impl Outcome {
    /// Returns whether the names are exact; a true indistinguishable alternative counts as named.
    fn exact(&self) -> bool {
        self.named == self.effects
    }

    fn has_wrong_name(&self) -> bool {
        self.named.iter().any(|e| !self.effects.contains(e))
    }
}

/// Actuators that are diagnosed.
struct Drawn {
    seed: u64,
    /// Rows of a segment with one sine; `None` for the default.
    segment_rows: Option<usize>,
}

impl Drawn {
    fn actuator(&self, number: u64) -> Actuator {
        let drawn = Actuator::draw(self.seed, number);
        Actuator { segment_rows: self.segment_rows.unwrap_or(drawn.segment_rows), ..drawn }
    }
}

fn run(drawn: &Drawn, number: u64) -> Outcome {
    let actuator = drawn.actuator(number);
    let fitted = |record: &Record| fit(record, actuator.kind, &FitOptions::default()).expect("a fit");
    let bare = actuator.bare();
    let clean = simulate(&fitted(&bare.record(0, "train")), &bare.record(1, "test"), Zero::None);
    let clean = clean.ok().and_then(|s| s.errors).map(|e| e.rmse);
    let (train, test) = (actuator.record(0, "train"), actuator.record(1, "test"));
    let model = fitted(&train);
    let started = Instant::now();
    let found = diagnose(&train, Some(&test), &model, &DiagnoseOptions::default(), &|_| {}).expect("a diagnosis");
    let seconds = started.elapsed().as_secs_f64();
    let mut named: Vec<Effect> = Vec::new();
    for finding in &found.findings.effects {
        // If effects are indistinguishable, either name is right.
        let tie = finding.ties().find(|tie| actuator.effects.contains(&tie.name));
        let is_right = actuator.effects.contains(&finding.name);
        named.push(if is_right { finding.name } else { tie.map_or(finding.name, |a| a.name) });
    }
    named.sort();
    named.dedup();
    let after = found.findings.after.test.map(|e| e.rmse);
    Outcome {
        seed: drawn.seed,
        segment_rows: actuator.segment_rows,
        number,
        law: format!("{:?}", actuator.law),
        kind: actuator.kind.name().into(),
        effects: actuator.effects,
        named,
        weighed: found.weighed,
        ratio: after.zip(clean).map(|(after, clean)| after / clean),
        seconds,
    }
}

fn names(list: &[Effect]) -> String {
    if list.is_empty() { "nothing".into() } else { list.iter().map(|e| e.name()).collect::<Vec<_>>().join("+") }
}

fn print(o: &Outcome) {
    let probability =
        |w: &Weighed| format!("{}{} {:.2}", if w.named { "" } else { "(not) " }, w.effect, w.probability());
    println!(
        "{:4} {} {} {}: {} → {}; error {:.2} × that without, {:.1} s [{}]",
        o.number,
        if o.exact() { "   " } else { "NOT" },
        o.law,
        o.kind,
        names(&o.effects),
        names(&o.named),
        o.ratio.unwrap_or(f64::NAN),
        o.seconds,
        o.weighed.iter().map(probability).collect::<Vec<_>>().join(", ")
    );
}

/// Returns every weighed name, and whether it is right.
fn samples(outcomes: &[Outcome]) -> Vec<(Weighed, bool)> {
    outcomes.iter().flat_map(|o| o.weighed.iter().map(|w| (w.clone(), w.is_right(&o.effects)))).collect()
}

/// Fits a logistic regression by Newton's method, with a small ridge penalty.
fn regression(samples: &[(Weighed, bool)]) -> [f64; UNKNOWNS] {
    let mut beta = nalgebra::SVector::<f64, UNKNOWNS>::zeros();
    for _ in 0..50 {
        let mut gradient = -1e-1 * beta;
        let mut hessian = nalgebra::SMatrix::<f64, UNKNOWNS, UNKNOWNS>::identity() * 1e-1;
        for (w, right) in samples {
            let x = nalgebra::SVector::<f64, UNKNOWNS>::from_fn(|i, _| if i == 0 { 1.0 } else { w.features[i - 1] });
            let p = 1.0 / (1.0 + (-beta.dot(&x)).exp());
            gradient += (f64::from(u8::from(*right)) - p) * x;
            hessian += p * (1.0 - p) * x * x.transpose();
        }
        let Some(step) = hessian.cholesky().map(|c| c.solve(&gradient)) else { break };
        beta += step;
    }
    beta.into()
}

/// Returns the mean probability, the share of right names and the count of each bin.
fn bins(samples: &[(Weighed, bool)]) -> Vec<(f64, f64, usize)> {
    let of = |i: usize| {
        let inside = |w: &Weighed| ((w.probability() * BINS as f64) as usize).min(BINS - 1) == i;
        let own: Vec<&(Weighed, bool)> = samples.iter().filter(|(w, _)| inside(w)).collect();
        let n = own.len().max(1) as f64;
        let mean = own.iter().map(|(w, _)| w.probability()).sum::<f64>() / n;
        (mean, own.iter().filter(|(_, right)| *right).count() as f64 / n, own.len())
    };
    (0..BINS).map(of).collect()
}

fn draw(path: &str, bins: &[(f64, f64, usize)], error: f64) -> Result<(), Failure> {
    hyst_tests::register_font();
    let root = SVGBackend::new(path, (520, 480)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(44)
        .y_label_area_size(52)
        .caption(format!("calibration error {:.1} %", 100.0 * error), ("sans-serif", 16))
        .build_cartesian_2d(0.0..1.0, 0.0..1.0)?;
    chart.configure_mesh().x_desc("stated probability").y_desc("share of right names").draw()?;
    chart.draw_series(LineSeries::new([(0.0, 0.0), (1.0, 1.0)], BLACK.mix(0.4)))?;
    let largest = bins.iter().map(|b| b.2).max().unwrap_or(1) as f64;
    chart.draw_series(bins.iter().filter(|b| b.2 > 0).map(|(stated, right, n)| {
        Circle::new((*stated, *right), 3 + (9.0 * (*n as f64 / largest).sqrt()) as i32, BLUE.mix(0.6).filled())
    }))?;
    root.present()?;
    Ok(())
}

/// Returns the outcomes of some actuators. What the file of results has is not run again, and what is run is added to
/// it.
fn outcomes(drawn: &Drawn, numbers: &[u64], results: Option<&str>) -> Result<Vec<Outcome>, Failure> {
    let known = results.and_then(|file| std::fs::read_to_string(file).ok()).unwrap_or_default();
    let mut known = known.lines().map(serde_json::from_str).collect::<Result<Vec<Outcome>, _>>()?;
    let is_same = |o: &Outcome| o.seed == drawn.seed && o.segment_rows == drawn.actuator(o.number).segment_rows;
    known.retain(|o| is_same(o) && numbers.contains(&o.number));
    let file = results.map(|file| std::fs::OpenOptions::new().create(true).append(true).open(file)).transpose()?;
    let file = Mutex::new(file);
    let missing: Vec<u64> = numbers.iter().copied().filter(|i| known.iter().all(|o| o.number != *i)).collect();
    let run = |i: &u64| {
        let outcome = run(drawn, *i);
        print(&outcome);
        if let Some(file) = file.lock().expect("no writer panics").as_mut() {
            let line = serde_json::to_string(&outcome).expect("an outcome is valid JSON");
            writeln!(file, "{line}").expect("the file of results can be written");
        }
        outcome
    };
    known.extend(missing.par_iter().map(run).collect::<Vec<_>>());
    known.sort_by_key(|o| o.number);
    Ok(known)
}

fn main() -> Result<(), Failure> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| words.get(i).and_then(|w| w.parse().ok()).unwrap_or(default);
    let (count, seed) = (number(0, 500), number(1, 1));
    let option = |name: &str| match words.iter().position(|w| w == name) {
        Some(at) => words.get(at + 1).map(|word| Some(word.as_str())).ok_or(format!("{name} needs a value")),
        None => Ok(None),
    };
    let from = option("--from")?.map_or(Ok(0), |word| word.parse().map_err(|_| "--from needs a number"))?;
    let numbers: Vec<u64> = (from..from + count).collect();
    let segment_rows = option("--rows")?.map(|word| word.parse().map_err(|_| "--rows needs a number")).transpose()?;
    let drawn = Drawn { seed, segment_rows };
    if let Some(folder) = option("--save")? {
        std::fs::create_dir_all(folder)?;
        for i in numbers {
            let actuator = drawn.actuator(i);
            for (experiment, name) in (0..).zip(["train", "test"]) {
                let file = std::fs::File::create_new(format!("{folder}/{i}-{name}.csv"))?;
                actuator.record(experiment, name).write_csv(file)?;
            }
        }
        return Ok(());
    }
    let outcomes = outcomes(&drawn, &numbers, option("--results")?)?;
    let rate = |what: &str, good: usize, of: usize| {
        println!("{what}: {good} of {of} ({:.1} %)", 100.0 * good as f64 / of.max(1) as f64);
    };
    rate("exact set of names", outcomes.iter().filter(|o| o.exact()).count(), outcomes.len());
    rate("with a wrong name", outcomes.iter().filter(|o| o.has_wrong_name()).count(), outcomes.len());
    let free: Vec<&Outcome> = outcomes.iter().filter(|o| o.effects.is_empty()).collect();
    rate("false alarms", free.iter().filter(|o| !o.named.is_empty()).count(), free.len());
    let mut ratios: Vec<f64> = outcomes.iter().filter_map(|o| o.ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = (ratios.len().saturating_sub(1) as f64 * share) as usize;
        ratios.get(place).copied().unwrap_or(f64::NAN)
    };
    println!("error / that without the effects: median {:.2}, 90 % {:.2}", at(0.5), at(0.9));
    let weighed = samples(&outcomes);
    if words.iter().any(|w| w == "--fit") {
        println!("fitted to {} names: {:.3?}", weighed.len(), regression(&weighed));
    }
    let bins = bins(&weighed);
    for (stated, right, n) in bins.iter().filter(|b| b.2 > 0) {
        println!("stated {:5.1} %, right {:5.1} %, {n} names", 100.0 * stated, 100.0 * right);
    }
    let all = weighed.len().max(1) as f64;
    let error: f64 = bins.iter().map(|(stated, right, n)| (stated - right).abs() * *n as f64 / all).sum();
    println!("expected calibration error: {:.1} % over {} names", 100.0 * error, weighed.len());
    if let Some(file) = option("--svg")? {
        draw(file, &bins, error)?;
    }
    Ok(())
}
