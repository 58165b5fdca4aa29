//! Measures how often a diagnosis is right, on random simulated actuators with known effects.

use std::collections::BTreeMap;
use std::time::Instant;

use hyst_hw::{Bed, DISTURBANCES, EFFECTS, Plant, PlantConfig};
use hyst_ident::diagnose::{DiagnoseOptions, Findings, RemainderKind, Verdict, diagnose};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::{Effect, Kind};
use hyst_ident::simulate::{Zero, simulate};

use crate::experiment;

/// An actuator and the model that is fitted to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Seed of the actuator and of its drives.
    pub seed: u64,
    /// Kind of the fitted model.
    pub kind: Kind,
    /// The actuator.
    pub plant: PlantConfig,
    /// The actuator without its effects.
    pub bare: PlantConfig,
    /// Disturbance that is not in the list of effects.
    pub disturbed: Option<String>,
}

/// Result of the diagnosis of a case.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The case.
    pub case: Case,
    /// True effects.
    pub truth: Vec<Effect>,
    /// Named effects in the order of the chain, each once.
    pub named: Vec<Effect>,
    /// Test RMSE of the extended model, and of the same kind of model on the actuator without its effects \[µm\].
    pub test: (f64, f64),
    /// Parameters with a true value: name, estimate, true value, standard error.
    pub parameters: Vec<(String, f64, f64, Option<f64>)>,
    /// Evidence of each effect, and the description of the remainder.
    pub evidence: Vec<String>,
    /// Kind of the remainder.
    pub remainder: RemainderKind,
    /// Verdict of the diagnosis.
    pub verdict: Verdict,
    /// Duration of the diagnosis \[s\].
    pub seconds: f64,
}

impl Outcome {
    /// Returns whether exactly the true effects were named.
    pub fn exact(&self) -> bool {
        self.truth == self.named
    }

    /// Returns whether the verdict is true: an unlisted disturbance acts, a listed effect acts, or none.
    pub fn true_verdict(&self) -> bool {
        match (&self.case.disturbed, self.truth.is_empty()) {
            (Some(_), _) => self.verdict == Verdict::Unexplained,
            (None, true) => matches!(self.verdict, Verdict::NothingMissing | Verdict::BaseTooCoarse),
            (None, false) => self.verdict == Verdict::Explained,
        }
    }

    /// Returns the named effects that are not true.
    pub fn wrong(&self) -> Vec<Effect> {
        self.named.iter().copied().filter(|e| !self.truth.contains(e)).collect()
    }

    /// Returns the test error of the extended model divided by that for the actuator without its effects.
    pub fn ratio(&self) -> f64 {
        self.test.0 / self.test.1
    }
}

/// Returns whether a parameter is right: within three standard errors or 2 %.
pub fn right(found: f64, truth: f64, std_error: Option<f64>) -> bool {
    (found - truth).abs() <= f64::max(3.0 * std_error.unwrap_or(0.0), 0.02 * truth.abs())
}

/// Measures, fits and diagnoses a case.
///
/// # Panics
/// If the simulated actuator or the fit fails, which no case should cause.
pub fn run(case: &Case) -> Outcome {
    let records = |config: &PlantConfig| {
        let mut plant = Plant::new(config.clone()).expect("the actuator is valid");
        (experiment(&mut plant, case.seed, "train"), experiment(&mut plant, case.seed + 500_000, "test"))
    };
    let fitted = |train| fit(train, case.kind, &FitOptions::default()).expect("a fit");
    let (train, test) = records(&case.bare);
    let clean = simulate(&fitted(&train), &test, Zero::None).ok().and_then(|s| s.errors).map_or(f64::NAN, |e| e.rmse);
    let (train, test) = records(&case.plant);
    let model = fitted(&train);
    let started = Instant::now();
    let found = diagnose(&train, Some(&test), &model, &DiagnoseOptions::default(), &|_| {}).expect("a diagnosis");
    let seconds = started.elapsed().as_secs_f64();
    let mut named: Vec<Effect> = found.findings.effects.iter().map(|e| e.name).collect();
    named.sort();
    named.dedup();
    let mut truth: Vec<Effect> = case.plant.effects().iter().filter_map(|name| name.parse().ok()).collect();
    if case.disturbed.is_some() {
        // No effect of the list acts.
        truth.clear();
    }
    Outcome {
        truth,
        named,
        test: (found.findings.after.test.map_or(f64::NAN, |e| e.rmse), clean),
        parameters: parameters(&case.plant, &found.findings),
        evidence: evidence(&found.findings),
        remainder: found.findings.remainder.kind,
        verdict: found.findings.verdict,
        seconds,
        case: case.clone(),
    }
}

fn evidence(findings: &Findings) -> Vec<String> {
    let of = |e: &hyst_ident::diagnose::Finding| {
        e.evidence.iter().map(|why| format!("{}: {why}", e.name)).collect::<Vec<_>>()
    };
    let mut lines: Vec<String> = findings.effects.iter().flat_map(of).collect();
    lines.push(findings.remainder.description.clone());
    lines
}

/// Returns the estimated parameters that have a true value.
fn parameters(plant: &PlantConfig, findings: &Findings) -> Vec<(String, f64, f64, Option<f64>)> {
    let mut truth: BTreeMap<(Effect, &str), f64> = BTreeMap::new();
    let mut put = |effect, name, value: Option<f64>| {
        truth.extend(value.map(|value| ((effect, name), value)));
    };
    put(Effect::Delay, "seconds", plant.delay.as_ref().map(|p| p.seconds));
    put(Effect::Lag, "seconds", plant.lag.as_ref().map(|p| p.seconds));
    put(Effect::Temperature, "per_kelvin", plant.temperature.as_ref().map(|p| p.per_k).filter(|k| *k != 0.0));
    put(Effect::Load, "per_newton", plant.load.as_ref().map(|p| p.um_per_n));
    put(Effect::Resonance, "hz", plant.modes.first().map(|p| p.hz));
    put(Effect::Resonance, "damping", plant.modes.first().map(|p| p.damping));
    put(Effect::Drift, "per_second", plant.drift.as_ref().map(|p| p.um_per_s));
    put(Effect::Interference, "hz", plant.interference.as_ref().map(|p| p.hz));
    put(Effect::Interference, "amplitude", plant.interference.as_ref().map(|p| p.amplitude_um));
    let mut list = Vec::new();
    for effect in &findings.effects {
        for (name, found) in &effect.parameters {
            // In 1 + c (T − T₀), c depends on T₀. Convert it to the reference temperature of the plant.
            let mut value = found.value;
            let mut error = found.std_error;
            if let (Effect::Temperature, Some(t)) = (effect.name, &plant.temperature)
                && let Some(reference) = effect.parameters.get("reference_degc")
            {
                let factor = 1.0 + found.value * (t.reference_degc - reference.value);
                value /= factor;
                error = error.map(|e| e / factor);
            }
            if let Some(truth) = truth.get(&(effect.name, name.as_str())) {
                list.push((format!("{}.{name}", effect.name), value, *truth, error));
            }
        }
    }
    list
}

/// Returns case `i` of a seed: no, one or two effects, or an unlisted disturbance.
///
/// Of 20 cases, five have no effect, ten have one, three have two, and two have a disturbance. Half of the actuators
/// have relays, half play operators. An asymmetry is a curve after a Prandtl-Ishlinskii operator: such an actuator has
/// play operators, and `pi` is fitted to it.
///
/// # Panics
/// If an ordinary actuator is rejected.
pub fn draw(seed: u64, i: u64) -> Case {
    draw_on(Bed::Relays, seed, i)
}

/// Returns such a case with relays of another kind, for example in clusters.
///
/// # Panics
/// If an ordinary actuator is rejected.
pub fn draw_on(relays: Bed, seed: u64, i: u64) -> Case {
    let case_seed = seed * 10_000 + i;
    let round = (i / 20) as usize;
    let effect = |k: usize| EFFECTS[k % EFFECTS.len()];
    let place = (i % 20) as usize;
    let effects: Vec<&str> = match place {
        5..15 => vec![effect(round * 10 + place - 5)],
        15..18 => {
            let first = round * 3 + place;
            vec![effect(first), effect(first + 1 + round % (EFFECTS.len() - 1))]
        }
        _ => Vec::new(),
    };
    let disturbed = (place >= 18).then(|| DISTURBANCES[(2 * round + place) % DISTURBANCES.len()].to_owned());
    let bed = if effects.contains(&"asymmetry") || (i + round as u64) % 2 == 1 { Bed::Plays } else { relays };
    let plant = |effects: &[&str]| PlantConfig::random_on(bed, case_seed, effects).expect("an ordinary actuator");
    let bare = plant(&[]);
    let plant = match &disturbed {
        Some(kind) => bare.clone().with_disturbance(kind).expect("a disturbance"),
        None => plant(&effects),
    };
    let fits_preisach = bed != Bed::Plays && !effects.contains(&"rate-dependence") && !i.is_multiple_of(4);
    Case { seed: case_seed, kind: if fits_preisach { Kind::Preisach } else { Kind::Pi }, plant, bare, disturbed }
}
