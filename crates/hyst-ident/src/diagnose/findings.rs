//! Findings: the contents of `findings.json`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::effects::EffectKind;
use super::limit::Limit;
pub use crate::metrics::Errors;
use crate::model::{Effect, Kind};
use crate::simulate::Zero;

/// The verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Effects were named.
    Explained,
    /// The model is at the noise floor.
    NothingMissing,
    /// A finer base model would explain the remainder.
    BaseTooCoarse,
    /// No listed effect explains the remainder.
    Unexplained,
}

/// What the remainder consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RemainderKind {
    /// Noise.
    None,
    /// Misfit of the base model.
    BaseCapacity,
    /// Unknown.
    Unexplained,
}

/// What has changed since the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Change {
    /// Only the sensor's zero.
    Zero,
    /// The device: another one, or the same with another gain or shape.
    Device,
}

/// The residual of the extended model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Remainder {
    /// What it is.
    pub kind: RemainderKind,
    /// Share of the variance of the output.
    pub variance_share: f64,
    /// Change since the fit, if a refit of the same base model explains what a finer one would.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
    /// Slope above which the output does not follow the drive (current-limited amplifier) \[input unit/s\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slew_limit: Option<f64>,
    /// Description in a sentence.
    pub description: String,
    /// Where in the record it is largest, in sentences; empty if it is noise.
    #[serde(rename = "where", default, skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<String>,
}

/// A fitted parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Value.
    pub value: f64,
    /// Standard error; `None` for a parameter at a bound and for a convention.
    pub std_error: Option<f64>,
    /// Unit.
    pub unit: String,
}

/// Another effect tried instead of a named one.
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

/// A suspect: an effect that helps but is not certain enough to be named.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Suspect {
    /// Name.
    pub name: Effect,
    /// Class.
    pub kind: EffectKind,
    /// Probability that the effect is present.
    pub probability: f64,
    /// Cross-validated RMSE with it \[output unit\].
    pub cv_rmse: f64,
    /// Effect that explains nearly as much instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rival: Option<Effect>,
    /// Command that designs the deciding record.
    pub command: String,
}

/// Another kind of model that explains the record better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseAdvice {
    /// The kind.
    pub model: Kind,
    /// Its cross-validated RMSE with all effects found \[output unit\].
    pub cv_rmse: f64,
    /// Cross-validated RMSE of the model's own kind \[output unit\].
    pub own_cv_rmse: f64,
}

/// Rows that a diagnosis used, and rows that it left out.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rows {
    /// Rows that were used.
    pub used: usize,
    /// Rows left out, by reason.
    pub left_out: LeftOut,
    /// Row numbers of spikes, counted from 1 at the first row of data; the first [`MOST_LISTED`] of them.
    pub spikes: Vec<usize>,
}

/// Rows left out, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct LeftOut {
    /// Gaps in time where a log lost samples.
    pub gaps: usize,
    /// Spikes: single sensor values that no device produces.
    pub spikes: usize,
    /// Start-up rows: a transient from before the record.
    pub start_up: usize,
    /// The sensor is at the end of its range.
    pub saturated: usize,
    /// The sensor repeats one value and then jumps.
    #[serde(default)]
    pub frozen: usize,
}

/// Maximum number of spikes in the list.
pub const MOST_LISTED: usize = 100;

/// A named effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Name.
    pub name: Effect,
    /// Class.
    pub kind: EffectKind,
    /// Law that the effect follows; `None` if the model is extended by a flexible form.
    pub law: Option<String>,
    /// Probability that the name, or one that the record cannot distinguish from it, is right.
    pub probability: f64,
    /// Parameters.
    pub parameters: BTreeMap<String, Found>,
    /// Evidence, in sentences.
    pub evidence: Vec<String>,
    /// Other effects tried instead, best first.
    pub alternatives: Vec<Alternative>,
    /// Cross-validated RMSE without it \[output unit\].
    pub cv_rmse_before: f64,
    /// Cross-validated RMSE with it \[output unit\].
    pub cv_rmse_after: f64,
}

impl Finding {
    /// Returns the effects that the record cannot distinguish from this one.
    pub fn ties(&self) -> impl Iterator<Item = &Alternative> {
        self.alternatives.iter().filter(|other| other.indistinguishable)
    }
}

/// Errors on the training record and the test record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OnRecords {
    /// Training record.
    pub train: Option<Errors>,
    /// Test record, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<Errors>,
}

/// The result of a diagnosis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// `hyst.findings/2`
    pub schema: String,
    /// Base model.
    pub base: Kind,
    /// Unit of all errors: the suffix of the output's column.
    pub unit: String,
    /// Standard deviation of the white noise in the record \[unit\].
    pub noise_floor: f64,
    /// How the sensor's zero was treated.
    pub zero: Zero,
    /// The verdict.
    pub verdict: Verdict,
    /// Errors of the model before the extension.
    pub before: OnRecords,
    /// Named effects, in the order of the signal chain.
    pub effects: Vec<Finding>,
    /// Number of play operators of the extended model, if their thresholds were chosen again.
    /// The original thresholds were chosen before the effects were known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plays_placed_anew: Option<usize>,
    /// Suspects, most probable first.
    pub suspects: Vec<Suspect>,
    /// Limits of detection of the effects that are not named.
    pub limits: BTreeMap<Effect, Limit>,
    /// Another kind of model that explains the record better, if one does.
    pub base_advice: Option<BaseAdvice>,
    /// Rows used and left out.
    pub rows: Rows,
    /// The remainder.
    pub remainder: Remainder,
    /// Errors of the extended model.
    pub after: OnRecords,
}
