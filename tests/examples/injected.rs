//! Adds known effects to a measured record and checks which are named:
//! `cargo run --release -p hyst-tests --example injected`.
//!
//! Each effect is added to the output of the measured micromanipulator in two sizes, with other equations than the
//! models'. The record is then fitted and diagnosed as by a user. The effects of the record itself (lag and creep) are
//! expected too. A delay or lag adds to the lag of the record. If the diagnosis reports that two effects are
//! indistinguishable, either name counts; the parameters are compared only if the injected effect is named first.

use hyst_ident::diagnose::{DiagnoseOptions, Finding, Findings, diagnose};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::{Effect, Kind};
use hyst_ident::record::{ColumnMap, Columns, Need, OutputUnit, Record};
use hyst_ident::simulate::Zero;
use hyst_tests::data;
use rayon::prelude::*;

/// Returns the sample period of the record \[s\].
fn period(r: &Record) -> f64 {
    r.sample_period()
}

/// Applies a first-order lag.
fn lagged(x: &[f64], share: f64) -> Vec<f64> {
    let mut y = x[0];
    let follow = |x: &f64| {
        y += share * (x - y);
        y
    };
    x.iter().map(follow).collect()
}

/// Returns a temperature that rises and falls over the record \[°C\].
fn temperature(r: &Record) -> Vec<f64> {
    let whole = r.rows() as f64;
    let at = |k: usize| {
        let x = k as f64 / whole;
        22.0 + 5.0 * (7.0 * x).sin() + 2.0 * (19.0 * x + 0.4).sin()
    };
    (0..r.rows()).map(at).collect()
}

/// Returns a force that changes every few seconds \[N\].
fn force(r: &Record) -> Vec<f64> {
    let t = |k: usize| k as f64 * period(r);
    (0..r.rows()).map(|k| 10.0 * (0.37 * t(k)).sin() + 6.0 * (0.83 * t(k) + 1.0).sin()).collect()
}

/// Stroke of the device \[µm\].
const STROKE: f64 = 46.0;

/// A changed record.
struct Changed {
    output: Vec<f64>,
    temperature: Option<Vec<f64>>,
    load: Option<Vec<f64>>,
    /// Expected parameters: effect, name, value.
    truth: Vec<(Effect, &'static str, f64)>,
    /// Effects that must be named in addition to those of the record itself.
    effects: Vec<Effect>,
}

type Injection = Box<dyn Fn(&Record) -> Changed + Send + Sync>;

/// Returns the injections, each with its name.
fn injections() -> Vec<(String, Injection)> {
    fn plain(output: Vec<f64>, truth: Vec<(Effect, &'static str, f64)>) -> Changed {
        let mut effects: Vec<Effect> = truth.iter().map(|t| t.0).collect();
        effects.dedup();
        Changed { output, temperature: None, load: None, truth, effects }
    }
    fn y(r: &Record) -> Vec<f64> {
        r.output().unwrap_or_default().to_vec()
    }
    let mut all: Vec<(String, Injection)> = Vec::new();
    let mut put = |name: String, of: Injection| all.push((name, of));
    for ms in [15.0, 40.0] {
        put(
            format!("delay {ms} ms"),
            Box::new(move |r| {
                let (y, late) = (y(r), 1e-3 * ms / period(r));
                let at = |k: usize| {
                    let x = (k as f64 - late).max(0.0);
                    let (i, part) = (x as usize, x.fract());
                    y[i] + part * (y[(i + 1).min(y.len() - 1)] - y[i])
                };
                plain((0..y.len()).map(at).collect(), vec![(Effect::Delay, "seconds", 1e-3 * ms)])
            }),
        );
        put(
            format!("lag {ms} ms"),
            Box::new(move |r| {
                let share = 1.0 - (-period(r) / (1e-3 * ms)).exp();
                plain(lagged(&y(r), share), vec![(Effect::Lag, "seconds", 1e-3 * ms)])
            }),
        );
    }
    for um in [0.15, 0.4] {
        put(
            format!("tone {um} µm at 27.3 Hz"),
            Box::new(move |r| {
                let tone = |t: &f64| um * (std::f64::consts::TAU * 27.3 * t + 0.7).sin();
                let output = y(r).iter().zip(r.time()).map(|(y, t)| y + tone(t)).collect();
                plain(output, vec![(Effect::Interference, "hz", 27.3), (Effect::Interference, "amplitude", um)])
            }),
        );
    }
    for percent in [3.0, 8.0] {
        let height = STROKE * 0.01 * percent;
        let added = |name: &str,
                     of: fn(f64, f64) -> f64,
                     truth: fn(f64, f64) -> Vec<(&'static str, f64)>|
         -> (String, Injection) {
            let inject = move |r: &Record| {
                let whole = r.time()[r.rows() - 1];
                let output = y(r).iter().zip(r.time()).map(|(y, t)| y + height * of(*t, whole)).collect();
                plain(
                    output,
                    truth(height, whole).into_iter().map(|(name, value)| (Effect::Drift, name, value)).collect(),
                )
            };
            (format!("{name} {percent} % of the stroke"), Box::new(inject))
        };
        let (name, line) = added("drift", |t, whole| t / whole, |height, whole| vec![("per_second", height / whole)]);
        put(name, line);
        let (name, settles) = added(
            "settling drift",
            |t, _| 1.0 - (-t / 8.0).exp(),
            |height, _| vec![("settling", height), ("seconds", 8.0)],
        );
        put(name, settles);
        put(
            format!("clipping {percent} % below the top"),
            Box::new(move |r| {
                let y = y(r);
                let (low, high) = y.iter().fold((f64::MAX, f64::MIN), |(a, b), y| (a.min(*y), b.max(*y)));
                let end = high - 0.01 * percent * (high - low);
                // The stop is in the device, so the sensor noise remains.
                let noise = |k: usize| 0.03 * ((k as f64 * 1.7).sin() + (k as f64 * 2.9).sin());
                let output = y.iter().enumerate().map(|(k, y)| if *y > end { end + noise(k) } else { *y }).collect();
                plain(output, vec![(Effect::Saturation, "high", end)])
            }),
        );
    }
    for (per_k, um_per_k, um_per_n) in [(0.003, 0.1, 0.03), (0.008, 0.3, 0.1)] {
        put(
            format!("temperature {per_k} /K with a lag of 3 s"),
            Box::new(move |r| {
                let (degc, y) = (temperature(r), y(r));
                let body = lagged(&degc, 1.0 - (-period(r) / 3.0).exp());
                // The motion counts from the rest position of the record.
                let output =
                    y.iter().zip(&body).map(|(at, t)| y[0] + (at - y[0]) * (1.0 + per_k * (t - 22.0))).collect();
                let truth = vec![(Effect::Temperature, "per_kelvin", per_k)];
                Changed { temperature: Some(degc), ..plain(output, truth) }
            }),
        );
        put(
            format!("expansion {um_per_k} µm/K"),
            Box::new(move |r| {
                let degc = temperature(r);
                let output = y(r).iter().zip(&degc).map(|(y, t)| y + um_per_k * (t - 22.0)).collect();
                let truth = vec![(Effect::Temperature, "expansion", um_per_k)];
                Changed { temperature: Some(degc), ..plain(output, truth) }
            }),
        );
        put(
            format!("load {um_per_n} µm/N"),
            Box::new(move |r| {
                let newtons = force(r);
                let output = y(r).iter().zip(&newtons).map(|(y, f)| y + um_per_n * f).collect();
                Changed { load: Some(newtons), ..plain(output, vec![(Effect::Load, "per_newton", um_per_n)]) }
            }),
        );
    }
    for (ms, share, um, percent) in [(15.0, 0.03, 0.15, 3.0), (40.0, 0.08, 0.4, 8.0)] {
        put(
            format!("lag {ms} ms with creep {share}"),
            Box::new(move |r| {
                let late = lagged(&y(r), 1.0 - (-period(r) / (1e-3 * ms)).exp());
                let slow = lagged(&late, 1.0 - (-period(r) / 6.0).exp());
                let output = late.iter().zip(&slow).map(|(y, slow)| y + share * (slow - late[0])).collect();
                Changed {
                    effects: vec![Effect::Lag, Effect::Creep],
                    ..plain(output, vec![(Effect::Lag, "seconds", 1e-3 * ms)])
                }
            }),
        );
        put(
            format!("tone {um} µm with drift {percent} %"),
            Box::new(move |r| {
                let slope = STROKE * 0.01 * percent / r.time()[r.rows() - 1];
                let add = |t: &f64| um * (std::f64::consts::TAU * 27.3 * t).sin() + slope * t;
                let output = y(r).iter().zip(r.time()).map(|(y, t)| y + add(t)).collect();
                plain(output, vec![(Effect::Interference, "amplitude", um), (Effect::Drift, "per_second", slope)])
            }),
        );
    }
    all
}

/// Fits and diagnoses a record, with one zero for each file.
fn found(record: &Record) -> Findings {
    let fitting = FitOptions { zero_per_record: true, ..FitOptions::default() };
    let model = fit(record, Kind::Pi, &fitting).expect("a fit");
    let options = DiagnoseOptions { zero: Zero::PerRecord, ..DiagnoseOptions::default() };
    diagnose(record, None, &model, &options, &|_| {}).expect("a diagnosis").findings
}

/// Returns whether two effects count as the same. The record repeats one loop, in which a delay and a lag look alike.
fn is_same(one: Effect, other: Effect) -> bool {
    let late = |effect| matches!(effect, Effect::Delay | Effect::Lag);
    one == other || (late(one) && late(other))
}

/// Returns whether a finding is an effect, or one that the record cannot distinguish from it.
fn stands_for(finding: &Finding, effect: Effect) -> bool {
    let ties = finding.ties().map(|tie| tie.name);
    std::iter::once(finding.name).chain(ties).any(|name| is_same(effect, name))
}

/// Returns a parameter of an effect, or of one that counts as the same, and its standard error.
fn value(findings: &Findings, effect: Effect, name: &str) -> Option<(f64, f64)> {
    let found = findings.effects.iter().find(|f| is_same(effect, f.name))?.parameters.get(name)?;
    Some((found.value, found.std_error.unwrap_or(0.0)))
}

fn main() {
    let folder = data();
    let path = folder.join("measured/micromanipulator-train.csv");
    let plain = Record::read(&path, &ColumnMap::default(), Need::InputAndOutput).expect("the measured record");
    let unchanged = found(&plain);
    let own: Vec<Effect> = unchanged.effects.iter().map(|f| f.name).collect();
    println!("record itself: {}", own.iter().map(|e| e.name()).collect::<Vec<_>>().join(", "));
    let all = injections();
    let rows: Vec<(bool, String)> = all
        .par_iter()
        .map(|(name, inject)| {
            let changed = inject(&plain);
            let record = Record::from_samples(Columns {
                name: name.clone(),
                time: plain.time().to_vec(),
                input: Some(plain.input().to_vec()),
                output: Some((OutputUnit::Micrometre, changed.output.clone())),
                temperature: changed.temperature.clone(),
                load: changed.load.clone(),
                ..Columns::default()
            })
            .expect("a changed record is valid");
            let findings = found(&record);
            let is_in = |list: &[Effect], f: &Finding| list.iter().any(|e| stands_for(f, *e));
            let named = changed.effects.iter().all(|e| findings.effects.iter().any(|f| stands_for(f, *e)));
            let of_record = |f: &Finding| is_in(&own, f) || unchanged.effects.iter().any(|by| stands_for(by, f.name));
            let nothing_else = findings.effects.iter().all(|f| of_record(f) || is_in(&changed.effects, f));
            let mut notes = Vec::new();
            let mut right = true;
            for (effect, parameter, truth) in &changed.truth {
                // An injected lag adds to that of the record. A missing parameter counts as wrong.
                let before = value(&unchanged, *effect, parameter).map_or(0.0, |v| v.0);
                let named_as_another = !findings.effects.iter().any(|f| is_same(*effect, f.name))
                    && findings.effects.iter().any(|f| stands_for(f, *effect));
                if named_as_another {
                    notes.push(format!("{parameter} not compared: indistinguishable here"));
                    continue;
                }
                let Some((value, error)) = value(&findings, *effect, parameter) else {
                    right = false;
                    notes.push(format!("no {parameter}"));
                    continue;
                };
                right &= (value - before - truth).abs() <= f64::max(0.1 * truth.abs(), 3.0 * error);
                notes.push(format!("{parameter} {:.4} ± {error:.4}, true {truth:.4}", value - before));
            }
            let names: Vec<&str> = findings.effects.iter().map(|f| f.name.name()).collect();
            let good = named && nothing_else && right;
            (good, format!("{} {name}: {} [{}]", if good { "   " } else { "NOT" }, names.join(", "), notes.join("; ")))
        })
        .collect();
    rows.iter().for_each(|(_, line)| println!("{line}"));
    println!("{} of {} right", rows.iter().filter(|r| r.0).count(), rows.len());
}
