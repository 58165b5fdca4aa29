//! Checks the limits of detection of a diagnosis. An effect of that size must be named, an effect of a third of that
//! size only rarely:
//! `cargo run --release -p hyst-tests --example limits -- [TRIALS] [SEED] [--rows ROWS]`.
//!
//! Actuators of seven hysteresis laws without effects are measured, fitted and diagnosed; a record has about four times
//! ROWS (default 3500). Each trial takes one of the
//! resulting limits and adds the effect to the same record, in that size and in a third of it. Each changed record is
//! fitted and diagnosed as by a user. The contribution of an effect is computed from the motion of the fitted model,
//! with other equations than the models', so that the noise does not change. The rate-dependence is not tested: it acts
//! on the drive before the memory, which only the device has.

use std::f64::consts::TAU;

use hyst_ident::diagnose::{DiagnoseOptions, Limit, Weighed, diagnose};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::Effect;
use hyst_ident::record::{Columns, OutputUnit, Record};
use hyst_ident::simulate::{Zero, simulate};
use hyst_tests::other_physics::Actuator;
use rayon::prelude::*;

/// Tested effects, in turn.
const TESTED: [Effect; 9] = [
    Effect::Delay,
    Effect::Lag,
    Effect::Creep,
    Effect::Drift,
    Effect::Interference,
    Effect::Resonance,
    Effect::Saturation,
    Effect::Temperature,
    Effect::Load,
];

/// Smaller size as a share of the limit.
const SMALLER_SIZE: f64 = 1.0 / 3.0;

/// A record and its modelled motion.
struct Measured {
    record: Record,
    motion: Vec<f64>,
}

impl Measured {
    /// Returns the rows of each segment.
    fn segments(&self) -> &[std::ops::Range<usize>] {
        self.record.segments()
    }

    /// Filters the motion; each segment starts with a new filter.
    fn filtered<F: FnMut(f64) -> f64>(&self, filter: impl Fn(f64) -> F) -> Vec<f64> {
        let of = |rows: &std::ops::Range<usize>| {
            let mut filter = filter(self.motion[rows.start]);
            self.motion[rows.clone()].iter().map(|y| filter(*y)).collect::<Vec<f64>>()
        };
        self.segments().iter().flat_map(of).collect()
    }

    /// Returns the motion with an effect of a size; `hz` is the frequency of the limit. `None` if the effect is not
    /// tested.
    fn with(&self, effect: Effect, size: f64, hz: f64) -> Option<Vec<f64>> {
        let (h, time) = (self.record.sample_period(), self.record.time());
        let whole = time[time.len() - 1] - time[0];
        let each = |of: &dyn Fn(usize) -> f64| (0..time.len()).map(|k| self.motion[k] + of(k)).collect::<Vec<f64>>();
        Some(match effect {
            Effect::Delay => self.filtered(|first| {
                let mut past = vec![first];
                move |y| {
                    past.push(y);
                    let at = ((past.len() - 1) as f64 - size / h).max(0.0);
                    let (i, part) = (at as usize, at.fract());
                    past[i] * (1.0 - part) + past[(i + 1).min(past.len() - 1)] * part
                }
            }),
            Effect::Lag => self.filtered(|first| {
                let mut at = first;
                move |y| {
                    at += (1.0 - (-h / size).exp()) * (y - at);
                    at
                }
            }),
            Effect::Creep => self.filtered(|first| {
                // Three relaxations per decade, from a few samples to the whole record.
                let decades = (whole / (4.0 * h)).log10();
                let taus: Vec<f64> =
                    (0..(3.0 * decades) as i32).map(|i| 4.0 * h * 10f64.powf(f64::from(i) / 3.0)).collect();
                let mut states = vec![first; taus.len()];
                move |y| {
                    let follow = |(state, tau): (&mut f64, &f64)| {
                        *state += (1.0 - (-h / tau).exp()) * (y - *state);
                        *state - first
                    };
                    y + size / 3.0 * states.iter_mut().zip(&taus).map(follow).sum::<f64>()
                }
            }),
            Effect::Resonance => self.filtered(|first| {
                // A share of the motion passes a mode with damping 0.02, in small steps.
                let (omega, mut at, mut speed, mut before) = (TAU * hz, first, 0.0, first);
                move |y| {
                    const STEPS: u32 = 40;
                    for i in 1..=STEPS {
                        let u = before + (y - before) * f64::from(i) / f64::from(STEPS);
                        speed += h / f64::from(STEPS) * (omega * omega * (u - at) - 0.04 * omega * speed);
                        at += h / f64::from(STEPS) * speed;
                    }
                    before = y;
                    y + size * (at - y)
                }
            }),
            Effect::Drift => each(&|k| size * (time[k] - time[0]) / whole),
            Effect::Interference => each(&|k| size * (TAU * hz * time[k] + 1.0).sin()),
            Effect::Saturation => {
                let top = self.motion.iter().fold(f64::MIN, |top, y| top.max(*y));
                self.motion.iter().map(|y| y.min(top - size)).collect()
            }
            Effect::Temperature => {
                let degc = self.record.temperature()?;
                let mean = degc.iter().sum::<f64>() / degc.len() as f64;
                each(&|k| size * (degc[k] - mean) * self.motion[k])
            }
            Effect::Load => {
                let newtons = self.record.load()?;
                each(&|k| size * newtons[k])
            }
            _ => return None,
        })
    }

    /// Returns the record with another motion.
    fn changed(&self, motion: &[f64]) -> Record {
        let r = &self.record;
        let output = r.output().unwrap_or_default();
        let output = output.iter().zip(motion.iter().zip(&self.motion)).map(|(y, (with, without))| y + with - without);
        let mut labels = Vec::with_capacity(r.rows());
        (0_i64..).zip(self.segments()).for_each(|(i, rows)| labels.extend(std::iter::repeat_n(i, rows.len())));
        Record::from_samples(Columns {
            name: "changed".into(),
            segment: Some(labels),
            time: r.time().to_vec(),
            input: Some(r.input().to_vec()),
            output: Some((OutputUnit::Micrometre, output.collect())),
            temperature: r.temperature().map(<[f64]>::to_vec),
            load: r.load().map(<[f64]>::to_vec),
            ..Columns::default()
        })
        .expect("the changed record is valid")
    }
}

/// Returns the frequency in the meaning of a limit \[Hz\].
fn frequency(meaning: &str) -> Option<f64> {
    let (before, _) = meaning.split_once(" Hz")?;
    before.rsplit(' ').next()?.parse().ok()
}

/// Number of trials in a row without an outcome after which the program ends.
const MAX_WITHOUT_OUTCOME: u64 = 64;

/// Result of a trial.
struct Outcome {
    actuator: Actuator,
    effect: Effect,
    size: f64,
    unit: String,
    /// Whether the effect was named at the limit, and at a third of it.
    named: [bool; 2],
    /// Names and candidates at the limit, with their probabilities.
    weighed: Vec<Weighed>,
}

/// Runs one trial with the first effect, from `number` on, for which this record has a limit. `None` if the diagnosis
/// names an effect or gives no limit.
fn run(seed: u64, segment_rows: Option<usize>, number: u64) -> Option<Outcome> {
    let drawn = Actuator::draw(seed, number).bare();
    let actuator = Actuator { segment_rows: segment_rows.unwrap_or(drawn.segment_rows), ..drawn };
    let record = actuator.record(0, "train");
    let fitted = |record: &Record| fit(record, actuator.kind, &FitOptions::default()).ok();
    let diagnosed = |record: &Record| {
        let model = fitted(record)?;
        Some((diagnose(record, None, &model, &DiagnoseOptions::default(), &|_| {}).ok()?, model))
    };
    let (found, model) = diagnosed(&record)?;
    // Without the zero of the sensor.
    let motion: Vec<f64> =
        simulate(&model, &record, Zero::None).ok()?.predicted.iter().map(|y| y - model.zero).collect();
    if !found.findings.effects.is_empty() {
        return None;
    }
    let measured = Measured { record, motion };
    let tested = |i: usize| TESTED[(number as usize + i) % TESTED.len()];
    let limited = (0..TESTED.len()).find_map(|i| match found.findings.limits.get(&tested(i))? {
        Limit::Size { size, unit, meaning } => Some((tested(i), *size, unit.clone(), meaning.clone())),
        Limit::NotVisible { .. } => None,
    });
    let (effect, size, unit, meaning) = limited?;
    let hz = match effect {
        Effect::Interference | Effect::Resonance => {
            frequency(&meaning).expect("the limit of a tone or a mode has a frequency")
        }
        _ => 0.0,
    };
    let mut weighed = Vec::new();
    let named = [1.0, SMALLER_SIZE].map(|share| {
        let motion = measured.with(effect, share * size, hz).expect("an effect with a limit can be added");
        let (found, _) = diagnosed(&measured.changed(&motion)).expect("the changed record can be diagnosed");
        if share == 1.0 {
            weighed.clone_from(&found.weighed);
        }
        // If effects are indistinguishable, either name is right.
        found
            .findings
            .effects
            .iter()
            .any(|finding| finding.name == effect || finding.ties().any(|tie| tie.name == effect))
    });
    Some(Outcome { actuator, effect, size, unit, named, weighed })
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| words.get(i).and_then(|w| w.parse().ok()).unwrap_or(default);
    let (trials, seed) = (number(0, 100) as usize, number(1, 1));
    let segment_rows = words
        .iter()
        .position(|word| word == "--rows")
        .map(|at| words.get(at + 1).and_then(|word| word.parse().ok()).expect("--rows needs a number"));
    let mut outcomes: Vec<Outcome> = Vec::new();
    let (mut next, mut last) = (0, 0);
    while outcomes.len() < trials && next - last < MAX_WITHOUT_OUTCOME {
        let numbers: Vec<u64> = (next..next + 8).collect();
        next += 8;
        let done: Vec<Outcome> = numbers.par_iter().filter_map(|i| run(seed, segment_rows, *i)).collect();
        for o in done.into_iter().take(trials - outcomes.len()) {
            let result = |named: bool| if named { "named" } else { "not named" };
            let probability =
                |w: &Weighed| format!("{}{} {:.2}", if w.named { "" } else { "(not) " }, w.effect, w.probability());
            println!(
                "{:3} {:?} {}: {} of {:.3e} {}: {} [{}]; a third of it: {}",
                outcomes.len(),
                o.actuator.law,
                o.actuator.kind.name(),
                o.effect,
                o.size,
                o.unit,
                result(o.named[0]),
                o.weighed.iter().map(probability).collect::<Vec<_>>().join(", "),
                result(o.named[1])
            );
            outcomes.push(o);
            last = next;
        }
    }
    for (i, what) in ["at the limit", "at a third of it"].into_iter().enumerate() {
        let count = |of: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| of(o)).count();
        println!("{what}: named in {} of {}", count(&|o| o.named[i]), outcomes.len());
        for effect in TESTED {
            let (named, all) = (count(&|o| o.effect == effect && o.named[i]), count(&|o| o.effect == effect));
            println!("  {effect}: {named} of {all}");
        }
    }
}
