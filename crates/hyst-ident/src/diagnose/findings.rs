//! `findings.json`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::limits::Limit;
use super::named::finding;
use super::search::Named;
pub use crate::metrics::Errors;
use crate::model::{Base, Effect, Kind, Model};
use crate::samples::Samples;
use crate::simulate::{Simulation, Zero};

/// Schema of the findings that this version writes.
const SCHEMA: &str = "hyst.findings/2";

/// The diagnosis in a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Effects were named.
    Explained,
    /// The model is at the noise floor.
    NothingMissing,
    /// A richer base would take what is left.
    BaseTooCoarse,
    /// Something is left that nothing on the list explains.
    Unexplained,
}

/// What kind of residual is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RemainderKind {
    /// Noise.
    None,
    /// The base's own misfit.
    BaseCapacity,
    /// Unknown.
    Unexplained,
}

/// What is no longer as it was in the record that a model was fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Change {
    /// The sensor's zero alone.
    Zero,
    /// The device: it is another one, or the same with another gain or shape.
    Device,
}

/// What is left after everything that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Remainder {
    /// What it is.
    pub kind: RemainderKind,
    /// Share of the output's variance.
    pub variance_share: f64,
    /// Of what a richer base would take: what the same base would take too, fitted anew, since something has changed since the fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
    /// Slope from which on the drive is not followed, as by an amplifier whose current is limited \[input unit/s\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slew_limit: Option<f64>,
    /// In words.
    pub description: String,
    /// Where it lives, in sentences; none if it is noise.
    #[serde(rename = "where", default, skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<String>,
}

/// A parameter that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Value.
    pub value: f64,
    /// Standard error; none if the parameter sits at a bound or is a convention.
    pub std_error: Option<f64>,
    /// Unit.
    pub unit: String,
}

/// Another effect in the place of a named one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// Its name.
    pub name: Effect,
    /// Cross-validated RMSE with it instead \[output unit\].
    pub cv_rmse: f64,
    /// Whether the record cannot tell the two apart.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub indistinguishable: bool,
}

/// What kind of thing an effect is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EffectKind {
    /// Loops that change with the rate of the drive.
    Rate,
    /// The output goes on after the drive has stopped.
    SlowMemory,
    /// The output is filtered: late, smooth or ringing.
    LinearDynamics,
    /// A curve without memory behind the hysteresis.
    OutputShape,
    /// It follows the measured temperature.
    Temperature,
    /// It follows the measured load.
    Load,
    /// The zero moves with time, whatever the drive does.
    Time,
    /// A periodic signal in the sensor.
    Tone,
}

impl EffectKind {
    /// The kind of an effect.
    pub fn of(effect: Effect) -> Self {
        match effect {
            Effect::RateDependence => Self::Rate,
            Effect::Creep => Self::SlowMemory,
            Effect::Delay | Effect::Lag | Effect::Resonance => Self::LinearDynamics,
            Effect::Asymmetry | Effect::Saturation => Self::OutputShape,
            Effect::Temperature => Self::Temperature,
            Effect::Load => Self::Load,
            Effect::Drift => Self::Time,
            Effect::Interference => Self::Tone,
        }
    }
}

/// An effect that helps but is not sure enough to be named.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Suspect {
    /// Name.
    pub name: Effect,
    /// What kind of thing it is.
    pub kind: EffectKind,
    /// Probability that it acts.
    pub probability: f64,
    /// Cross-validated RMSE with it \[output unit\].
    pub cv_rmse: f64,
    /// What explains nearly as much in its place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rival: Option<Effect>,
    /// The command that makes the record that would decide.
    pub command: String,
}

/// Another kind of model that explains the record better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseAdvice {
    /// The kind.
    pub model: Kind,
    /// Its cross-validated RMSE with all that was found \[output unit\].
    pub cv_rmse: f64,
    /// That of the model's own kind.
    pub own_cv_rmse: f64,
}

/// Rows that a diagnosis used, and why it did not use the others.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rows {
    /// Rows that were used.
    pub used: usize,
    /// Rows that were not, by what is the matter with them.
    pub left_out: LeftOut,
    /// Numbers of the rows that spike, from 1 for the first row of data; the first [`MOST_LISTED`] of them.
    pub spikes: Vec<usize>,
}

/// Rows that were left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct LeftOut {
    /// Holes in time, where a log has lost samples.
    pub gaps: usize,
    /// The sensor shows for a moment what no device does.
    pub spikes: usize,
    /// A transient from before the record.
    pub start_up: usize,
    /// The sensor stands at the end of its range.
    pub saturated: usize,
    /// The sensor repeats one value and jumps.
    #[serde(default)]
    pub frozen: usize,
}

/// Spikes that are listed at most.
pub const MOST_LISTED: usize = 100;

/// A named effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Name.
    pub name: Effect,
    /// What kind of thing it is.
    pub kind: EffectKind,
    /// Which law it follows; none where a flexible form extends the model, which is more than its parameters say.
    pub law: Option<String>,
    /// Probability that the name is right; not calibrated yet.
    pub probability: f64,
    /// Parameters.
    pub parameters: BTreeMap<String, Found>,
    /// Why it was named, in sentences.
    pub evidence: Vec<String>,
    /// What else was tried in its place, best first.
    pub alternatives: Vec<Alternative>,
    /// Cross-validated RMSE without it \[output unit\].
    pub cv_rmse_before: f64,
    /// Cross-validated RMSE with it \[output unit\].
    pub cv_rmse_after: f64,
}

/// Errors on the training and the test record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OnRecords {
    /// Training record.
    pub train: Option<Errors>,
    /// Test record, where one was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<Errors>,
}

/// What a diagnosis found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// `hyst.findings/2`
    pub schema: String,
    /// Base model.
    pub base: Kind,
    /// Unit of all errors: the ending of the output's column.
    pub unit: String,
    /// Standard deviation of the white noise in the record \[unit\].
    pub noise_floor: f64,
    /// What was done with the sensor's zero.
    pub zero: Zero,
    /// The diagnosis in a word.
    pub verdict: Verdict,
    /// Errors of the model as it was given.
    pub before: OnRecords,
    /// Effects, in the chain's order.
    pub effects: Vec<Finding>,
    /// Plays that the base of the extended model has at other places than the model's; `None` if they stayed where they were. Those of the
    /// model were placed while the effects stood in the record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plays_placed_anew: Option<usize>,
    /// Effects that help but are not sure enough to be named, the most probable first.
    pub suspects: Vec<Suspect>,
    /// What this record would have shown of each effect that is not named.
    pub limits: BTreeMap<Effect, Limit>,
    /// Another kind of model that explains the record better, if one does.
    pub base_advice: Option<BaseAdvice>,
    /// Which rows were used.
    pub rows: Rows,
    /// What is left.
    pub remainder: Remainder,
    /// Errors of the extended model.
    pub after: OnRecords,
}

pub(super) struct Material<'a> {
    pub(super) model: &'a Model,
    pub(super) extended: &'a Model,
    pub(super) named: &'a [Named],
    pub(super) noise: f64,
    pub(super) errors: &'a BTreeMap<String, f64>,
    pub(super) before: &'a Simulation,
    pub(super) after: &'a Simulation,
    pub(super) tests: Option<&'a (Simulation, Simulation)>,
    pub(super) remainder: Remainder,
    pub(super) zero: Zero,
    pub(super) samples: &'a Samples,
    /// Cross-validated error that the base of the search leaves with all that was found, in noise floors.
    pub(super) left: f64,
    pub(super) suspects: Vec<Suspect>,
    pub(super) limits: BTreeMap<Effect, Limit>,
    pub(super) base_advice: Option<BaseAdvice>,
    pub(super) rows: Rows,
}

/// Thresholds of a base of plays.
fn thresholds(base: &Base) -> Option<&[f64]> {
    match base {
        Base::Pi(p) => Some(&p.thresholds),
        Base::ViscousPi(p) => Some(&p.pi.thresholds),
        _ => None,
    }
}

pub(super) fn collect(m: &Material<'_>) -> Findings {
    let effects: Vec<Finding> = m.named.iter().map(|n| finding(m, n)).collect();
    let verdict = match (effects.is_empty(), m.remainder.kind) {
        (false, _) => Verdict::Explained,
        (true, RemainderKind::None) => Verdict::NothingMissing,
        (true, RemainderKind::BaseCapacity) => Verdict::BaseTooCoarse,
        (true, RemainderKind::Unexplained) => Verdict::Unexplained,
    };
    let on = |train: &Simulation, test: Option<&Simulation>| OnRecords {
        train: train.errors,
        test: test.and_then(|t| t.errors),
    };
    Findings {
        schema: SCHEMA.into(),
        base: m.model.base.kind(),
        unit: m.model.output.unit.clone(),
        noise_floor: m.noise,
        plays_placed_anew: thresholds(&m.extended.base)
            .filter(|new| thresholds(&m.model.base).is_some_and(|old| old != *new))
            .map(<[f64]>::len),
        zero: m.zero,
        verdict,
        before: on(m.before, m.tests.map(|t| &t.0)),
        effects,
        suspects: m.suspects.clone(),
        limits: m.limits.clone(),
        base_advice: m.base_advice.clone(),
        rows: m.rows.clone(),
        remainder: m.remainder.clone(),
        after: on(m.after, m.tests.map(|t| &t.1)),
    }
}
