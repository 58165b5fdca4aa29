//! Iterative learning on actuators of seven hysteresis laws:
//! `cargo run --release -p hyst-tests --example learn -- [COUNT] [SEED] [--wrong] [--keep DIR]`.
//!
//! Each actuator is identified (experiment, fit, diagnosis), then follows triangles of 1, 10 and 30 Hz and a staircase,
//! pass by pass. The example prints the error divided by the repeatability, which is measured by repeating one drive.
//! `--wrong` uses models with a gain error of 30 %, without the actuator's delay, or without its mode. `--keep` writes
//! the models to a folder and reads them from there.

use hyst_ident::learn::{Ended, LearnOptions, Learner};
use hyst_ident::model::Model;
use hyst_tests::learning::{REFERENCES, identify, play, reference, scale_gain};
use hyst_tests::other_bench::{Bench, OtherDevice};
use hyst_tests::other_physics::Law;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Error of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wrong {
    Gain,
    Delay,
    Mode,
}

/// Returns actuator `number` of a seed.
fn draw(seed: u64, number: u64, wrong: Option<Wrong>) -> Bench {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(number));
    let mut draw = |low: f64, high: f64| low * f64::powf(high / low, rng.random::<f64>());
    let stroke_um = draw(7.0, 18.0);
    // No, one or two effects, with the sizes of real stages.
    let effects = [
        &[][..],
        &["creep"],
        &["mode"],
        &["lag"],
        &["delay"],
        &["creep", "lag"],
        &["creep", "mode"],
        &["delay"],
        &["lag"],
        &["creep"],
    ];
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
            let model = identify(&mut device, true);
            std::fs::write(&path, model.to_json()).expect("a folder to write to");
            model
        }),
        None => identify(&mut device, true),
    };
    match wrong {
        Some(Wrong::Gain) => scale_gain(&mut model, if number.is_multiple_of(2) { 1.3 } else { 0.7 }),
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
        // Without a model: the constant gain between the ends of the range.
        let gain = (model.output.high - model.output.low) / (model.input.high - model.input.low);
        let linear: Vec<f64> = wanted.iter().map(|y| ((y - model.output.low) / gain).clamp(0.0, bench.volts)).collect();
        let by_gain = play(&mut device, &linear, 1);
        let by_gain = rms(by_gain[0].iter().zip(&wanted).map(|(y, r)| y - r));
        let options = LearnOptions { passes: 6, ..LearnOptions::default() };
        let mut learner = match Learner::new(&model, &reference, options) {
            Ok(learner) => learner,
            Err(error) => {
                outcomes.push(Outcome {
                    text: format!("{number:3} {name}: {error}"),
                    over_floor: vec![],
                    against_gain: 0.0,
                    never_worse: false,
                    ended: None,
                });
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
            outcomes.push(Outcome {
                text: format!("{number:3} {name}: {stopped}"),
                over_floor: vec![],
                against_gain: 0.0,
                never_worse: true,
                ended: None,
            });
            continue;
        };
        let drive = drive.voltage.clone();
        let repeats = play(&mut device, &drive, 6);
        let repeats: Vec<Vec<f64>> = repeats.into_iter().map(|y| y[learner.rows()].to_vec()).collect();
        let mean: Vec<f64> = (0..wanted.len()).map(|k| repeats.iter().map(|y| y[k]).sum::<f64>() / 6.0).collect();
        let floor =
            rms(repeats.iter().flat_map(|y| y.iter().zip(&mean).map(|(y, m)| y - m)).collect::<Vec<_>>().into_iter())
                * (6.0_f64 / 5.0).sqrt();
        let passes: Vec<f64> = learner.passes().map(|p| p.rmse).collect();
        let over_floor: Vec<f64> = passes.iter().map(|p| p / floor).collect();
        let all: Vec<String> = over_floor.iter().map(|r| format!("{r:.2}")).collect();
        outcomes.push(Outcome {
            text: format!(
                "{number:3} {:?} {name}: {} (best {}, {ended:?}), DC gain {:.0} x; limited {}; {:?}",
                bench.law,
                all.join(" "),
                best + 1,
                by_gain / pass.rmse,
                pass.limited_rows,
                model.effects.names()
            ),
            never_worse: passes.iter().all(|p| *p <= passes[0] * 1.02),
            over_floor,
            against_gain: by_gain / pass.rmse,
            ended,
        });
    }
    outcomes
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
        .map(|number| {
            let outcomes = run(seed, number, is_wrong.then(|| kinds[(number % 3) as usize]), keep);
            outcomes.iter().for_each(|o| println!("{}", o.text));
            outcomes
        })
        .collect();
    let all: Vec<&Outcome> = outcomes.iter().flatten().collect();
    let before = all.iter().filter(|o| o.over_floor.first().is_some_and(|r| *r <= 1.3)).count();
    let within = all.iter().filter(|o| o.over_floor.iter().take(6).any(|r| *r <= 1.3)).count();
    let mut gains: Vec<f64> = all.iter().map(|o| o.against_gain).collect();
    gains.sort_by(f64::total_cmp);
    println!(
        "{} of {} within 1.3 of the repeatability with the model's inverse, {} after at most 5 learned passes; in {} no pass is more than 2 % worse than the first; error {:.1} times smaller than with the DC gain (median); {} ended before the last pass",
        before,
        all.len(),
        within,
        all.iter().filter(|o| o.never_worse).count(),
        gains[gains.len() / 2],
        all.iter().filter(|o| o.ended.is_some_and(|e| e != Ended::Passes)).count()
    );
}
