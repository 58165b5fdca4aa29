//! Iterative learning on actuators of seven hysteresis laws: `cargo run --release -p hyst-tests --example learn -- [COUNT] [SEED] [--wrong] [--keep DIR]`.
//!
//! Each actuator is identified (experiment, fit, diagnosis), then follows triangles of 1, 10 and 30 Hz and a staircase, pass by pass. Told is the error
//! over the repeatability, which is measured by playing one drive again and again. `--wrong` learns with models whose gain is off by 30 %, whose delay is
//! off by 2 ms, or that lack a mode which the actuator has.
//! `--keep` writes the models to a folder, or reads them from there.

use hyst_hw::{RecordOptions, record};
use hyst_ident::diagnose::{DiagnoseOptions, diagnose};
use hyst_ident::excite::{Identification, Limits};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::learn::{Ended, LearnOptions, Learner};
use hyst_ident::model::{Kind, Model};
use hyst_ident::record::{Columns, OutputUnit, Record};
use hyst_tests::other_bench::{Bench, OtherDevice};
use hyst_tests::other_physics::Law;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// How a model is spoiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wrong {
    Gain,
    Delay,
    Mode,
}

/// The actuator with a number.
fn draw(seed: u64, number: u64, wrong: Option<Wrong>) -> Bench {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(number));
    let mut draw = |low: f64, high: f64| low * f64::powf(high / low, rng.random::<f64>());
    let stroke_um = draw(7.0, 18.0);
    // None, one or two effects, of the sizes that stages have.
    let effects = [&[][..], &["creep"], &["mode"], &["lag"], &["delay"], &["creep", "lag"], &["creep", "mode"], &["delay"], &["lag"], &["creep"]];
    let has = |effect| effects[(number % 10) as usize].contains(&effect);
    let (delay_s, lag_s, creep, hz, damping) =
        (draw(1.5e-3, 4e-3), draw(1e-3, 4e-3), draw(0.03, 0.1), draw(75.0, 160.0), draw(0.01, 0.05));
    Bench {
        seed: seed.wrapping_mul(7919).wrapping_add(number),
        law: Law::ALL[(number % 7) as usize],
        rate_hz: [1000.0, 2000.0][(number % 2) as usize],
        volts: draw(60.0, 150.0),
        stroke_um,
        noise_um: draw(0.003, 0.008),
        delay_s: if has("delay") || wrong == Some(Wrong::Delay) { delay_s } else { 0.0 },
        lag_s: if has("lag") { lag_s } else { 0.0 },
        creep: if has("creep") { creep } else { 0.0 },
        mode: (has("mode") || wrong == Some(Wrong::Mode)).then_some((hz, damping)),
    }
}

const REFERENCES: [(&str, f64, f64); 4] = [("triangle 1 Hz", 1.0, 4.0), ("triangle 10 Hz", 10.0, 1.0), ("triangle 30 Hz", 30.0, 0.5), ("stairs", 0.25, 4.0)];

fn reference(which: usize, rate_hz: f64, low: f64, high: f64) -> Record {
    let (name, hz, seconds) = REFERENCES[which];
    let rows = (seconds * rate_hz) as usize;
    let up = |t: f64| 1.0 - (2.0 * (t * hz).fract() - 1.0).abs();
    // Six levels, each reached on a smooth rise of a twentieth of its time.
    let stair = |x: f64| {
        let (level, part) = ((6.0 * x).floor(), (6.0 * x).fract());
        let rise = (part / 0.05).min(1.0);
        ((level + rise * rise * (3.0 - 2.0 * rise)) / 7.0).min(1.0)
    };
    let value = |t: f64| low + (high - low) * if name == "stairs" { stair((t * hz).fract()) } else { up(t) };
    let time: Vec<f64> = (0..rows).map(|k| k as f64 / rate_hz).collect();
    let values = time.iter().map(|t| value(*t)).collect();
    Record::from_samples(Columns { name: name.into(), time, output: Some((OutputUnit::Micrometre, values)), ..Columns::default() })
        .expect("a reference")
}

fn identify(device: &mut OtherDevice, bench: &Bench) -> Model {
    let limits = Limits { rate_hz: bench.rate_hz, lo_v: 0.0, hi_v: bench.volts, slew_v_per_s: None };
    let drive = Identification { duration_s: 20.0, ..Identification::at_rate(bench.rate_hz, 1) }.drive(&limits).expect("a drive");
    let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
    let measured = record(device, &segments, &RecordOptions::at(bench.rate_hz), |_| std::ops::ControlFlow::Continue(())).expect("a recording");
    let (mut time, mut input, mut output, mut segment) = (vec![], vec![], vec![], vec![]);
    for (label, part) in measured.segments.iter().enumerate() {
        for s in &part.samples {
            time.push(s.time_s);
            input.push(s.drive_v);
            output.push(s.output);
            segment.push(label as i64);
        }
    }
    let record = Record::from_samples(Columns {
        name: "train".into(),
        segment: Some(segment),
        time,
        input: Some(input),
        output: Some((OutputUnit::Micrometre, output)),
        ..Columns::default()
    })
    .expect("a record");
    let base = fit(&record, Kind::Pi, &FitOptions::default()).expect("a fit");
    diagnose(&record, None, &base, &DiagnoseOptions::default(), &|_| {}).map_or(base, |found| found.extended)
}

fn play(device: &mut OtherDevice, drive: &[f64], plays: usize) -> Vec<Vec<f64>> {
    let options = RecordOptions { settle_s: 2.0, ..RecordOptions::at(device.rate()) };
    let segments = vec![drive; plays];
    let measured = record(device, &segments, &options, |_| std::ops::ControlFlow::Continue(())).expect("a recording");
    measured.segments.iter().map(|s| s.samples.iter().map(|s| s.output).collect()).collect()
}

fn rms(x: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = x.clone().count() as f64;
    (x.map(|x| x * x).sum::<f64>() / n).sqrt()
}

struct Outcome {
    text: String,
    over_floor: Vec<f64>,
    against_gain: f64,
    never_worse: bool,
    ended: Option<Ended>,
}

fn run(seed: u64, number: u64, wrong: Option<Wrong>, keep: Option<&str>) -> Vec<Outcome> {
    let bench = draw(seed, number, wrong);
    let mut device = OtherDevice::new(bench);
    let mut model = match keep.map(|folder| format!("{folder}/{seed}-{number}-{wrong:?}.json")) {
        Some(path) => Model::read(path.as_ref()).unwrap_or_else(|_| {
            let model = identify(&mut device, &bench);
            std::fs::write(&path, model.to_json()).expect("a folder to write to");
            model
        }),
        None => identify(&mut device, &bench),
    };
    match wrong {
        Some(Wrong::Gain) => spoil_gain(&mut model, if number % 2 == 0 { 1.3 } else { 0.7 }),
        Some(Wrong::Delay) => model.effects.delay = None,
        Some(Wrong::Mode) => model.effects.resonances = Default::default(),
        None => {}
    }
    let (low, high) = (model.output.low, model.output.high);
    let (low, high) = (low + 0.2 * (high - low), low + 0.8 * (high - low));
    let mut outcomes = Vec::new();
    for (which, (name, ..)) in REFERENCES.iter().enumerate() {
        let reference = reference(which, bench.rate_hz, low, high);
        let wanted = reference.output().expect("values").to_vec();
        // Without a model: the gain through the ends of the range.
        let gain = (model.output.high - model.output.low) / (model.input.high - model.input.low);
        let straight: Vec<f64> = wanted.iter().map(|y| ((y - model.output.low) / gain).clamp(0.0, bench.volts)).collect();
        let by_gain = play(&mut device, &straight, 1);
        let by_gain = rms(by_gain[0].iter().zip(&wanted).map(|(y, r)| y - r));
        let options = LearnOptions { passes: 6, floor: 1.0, ..LearnOptions::default() };
        let mut learner = match Learner::new(&model, &reference, options) {
            Ok(learner) => learner,
            Err(error) => {
                outcomes.push(Outcome { text: format!("{number:3} {name}: {error}"), over_floor: vec![], against_gain: 0.0, never_worse: false, ended: None });
                continue;
            }
        };
        let mut ended = None;
        let mut stopped = String::new();
        while ended.is_none() {
            let drive = learner.drive().voltage.clone();
            match learner.take(&play(&mut device, &drive, 2)) {
                Ok(end) => ended = end,
                Err(error) => {
                    stopped = error.to_string();
                    break;
                }
            }
        }
        let Some((best, pass, drive)) = learner.best() else {
            outcomes.push(Outcome { text: format!("{number:3} {name}: {stopped}"), over_floor: vec![], against_gain: 0.0, never_worse: true, ended: None });
            continue;
        };
        let drive = drive.voltage.clone();
        let again = play(&mut device, &drive, 6);
        let again: Vec<Vec<f64>> = again.into_iter().map(|y| y[learner.rows()].to_vec()).collect();
        let mean: Vec<f64> = (0..wanted.len()).map(|k| again.iter().map(|y| y[k]).sum::<f64>() / 6.0).collect();
        let floor = rms(again.iter().flat_map(|y| y.iter().zip(&mean).map(|(y, m)| y - m)).collect::<Vec<_>>().into_iter()) * (6.0_f64 / 5.0).sqrt();
        if std::env::var("ONLY").is_ok() {
            eprintln!("{:?} noise {:.5} floor {floor:.5}", bench, bench.noise_um);
            eprintln!("{:?} {:?} {:?} {:?}", model.effects.delay, model.effects.lag, model.effects.resonances, model.effects.creep);
            for p in learner.passes() {
                eprintln!("   {p:?}");
            }
            let e: Vec<f64> = mean.iter().zip(&wanted).map(|(m, r)| r - m).collect();
            let n = e.len();
            let chunks: Vec<String> = e.chunks(n / 12 + 1).map(|c| format!("{:.2}/{:.2}", c.iter().sum::<f64>() / c.len() as f64 / floor, rms(c.iter().copied()) / floor)).collect();
            eprintln!("   mean/rms of error in time: {}", chunks.join(" "));
            let m = e.iter().sum::<f64>() / n as f64;
            for (hz_low, hz_high) in [(0.0, 2.0), (2.0, 8.0), (8.0, 15.0), (15.0, 35.0), (35.0, 70.0), (70.0, 120.0), (120.0, 200.0), (200.0, 350.0), (350.0, 500.0), (500.0, 1000.0), (1000.0, 2000.0)] {
                let mut power = 0.0;
                for k in (hz_low * n as f64 / bench.rate_hz) as usize..((hz_high * n as f64 / bench.rate_hz) as usize).min(n / 2) {
                    let (mut a, mut b) = (0.0, 0.0);
                    for (i, x) in e.iter().enumerate() {
                        let w = std::f64::consts::TAU * (k * i % n) as f64 / n as f64;
                        a += (x - m) * w.cos();
                        b += (x - m) * w.sin();
                    }
                    power += 2.0 * (a * a + b * b) / (n * n) as f64;
                }
                eprint!("   {hz_low}-{hz_high} Hz {:.2}", power.sqrt() / floor);
            }
            eprintln!("   mean {:.2}", m / floor);
        }
        let passes: Vec<f64> = learner.passes().map(|p| p.rmse).collect();
        let over_floor: Vec<f64> = passes.iter().map(|p| p / floor).collect();
        let all: Vec<String> = over_floor.iter().map(|r| format!("{r:.2}")).collect();
        outcomes.push(Outcome {
            text: format!(
                "{number:3} {:?} {name}: {} (best {}, {ended:?}), DC gain {:.0} x; limited {}; {:?}",
                bench.law, all.join(" "), best + 1, by_gain / pass.rmse, pass.limited_rows, model.effects.names()
            ),
            never_worse: passes.iter().all(|p| *p <= passes[0] * 1.02),
            over_floor,
            against_gain: by_gain / pass.rmse,
            ended,
        });
    }
    outcomes
}

/// All weights times a factor: a model of another actuator.
fn spoil_gain(model: &mut Model, factor: f64) {
    let mut json: serde_json::Value = serde_json::from_str(&model.to_json()).expect("json");
    for stage in json["stages"].as_array_mut().expect("stages") {
        if stage["stage"] == "pi" || stage["name"] == "pi" {
            scale(stage, factor);
        }
    }
    *model = Model::parse("spoiled", &json.to_string()).expect("a model");
}

fn scale(stage: &mut serde_json::Value, factor: f64) {
    let times = |value: &mut serde_json::Value| {
        if let Some(x) = value.as_f64() {
            *value = (x * factor).into();
        }
    };
    for name in ["gain", "weights"] {
        let value = &mut stage["parameters"][name];
        match value {
            serde_json::Value::Array(list) => list.iter_mut().for_each(times),
            other => times(other),
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let numbers: Vec<u64> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    let (count, seed) = (numbers.first().copied().unwrap_or(20), numbers.get(1).copied().unwrap_or(1));
    let is_wrong = arguments.iter().any(|a| a == "--wrong");
    let keep = arguments.iter().position(|a| a == "--keep").and_then(|k| arguments.get(k + 1)).map(String::as_str);
    let kinds = [Wrong::Gain, Wrong::Delay, Wrong::Mode];
    let outcomes: Vec<Vec<Outcome>> = (0..count)
        .into_par_iter()
        .filter(|number| std::env::var("ONLY").map_or(true, |only| only == number.to_string()))
        .map(|number| {
            let outcomes = run(seed, number, is_wrong.then(|| kinds[(number % 3) as usize]), keep);
            outcomes.iter().for_each(|o| println!("{}", o.text));
            outcomes
        })
        .collect();
    let all: Vec<&Outcome> = outcomes.iter().flatten().collect();
    let within = all.iter().filter(|o| o.over_floor.iter().take(6).any(|r| *r <= 1.3)).count();
    let mut gains: Vec<f64> = all.iter().map(|o| o.against_gain).collect();
    gains.sort_by(f64::total_cmp);
    println!(
        "{} of {} within 1.3 of the repeatability after 5 learned passes; never worse than the first pass in {}; {:.1} times below the DC gain (median); ended by themselves {}",
        within,
        all.len(),
        all.iter().filter(|o| o.never_worse).count(),
        gains[gains.len() / 2],
        all.iter().filter(|o| o.ended.is_some_and(|e| e != Ended::Passes)).count()
    );
}
