//! `model.json`: reading, checking, writing.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hyst_core::{ChainParams, CompensatorOptions, Error, Kind, Sampling};
use serde::{Deserialize, Serialize};
use serde_json::error::Category;

use super::operator::inverse_ends;
use super::{Base, Compensator, Effects, HostChain, Operator, stages, units};
use crate::{BetweenSamples, Samples};

/// Schema of the files that this version writes.
pub const SCHEMA: &str = "hyst.model/1";

/// Under which name [`Model::std_errors`] and estimates have the sensor's zero, which belongs to no stage.
pub const ZERO: &str = "zero";

/// One end of the actuator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// Column of the record, unit included.
    pub column: String,
    /// Unit: `V` or `N` of an input, the column's ending (`um`, `nm`, `mm`, `n`) of an output.
    pub unit: String,
    /// Lowest value in the record that the model was fitted to.
    pub low: f64,
    /// Highest value in that record.
    pub high: f64,
}

impl Channel {
    /// The unit as it stands beside numbers: `N` for the ending `n`, which beside `s` would read as nano.
    pub fn symbol(&self) -> &str {
        if self.unit == "n" { "N" } else { &self.unit }
    }
}

/// A file that a model was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedOn {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Rows that were fitted.
    pub rows: usize,
    /// Rows that were left out: a start-up transient, a sensor at the end of its range.
    pub settling_rows: usize,
}

/// The input's end, with what only it has.
#[derive(Serialize, Deserialize)]
struct Input {
    column: String,
    unit: String,
    low: f64,
    high: f64,
    #[serde(default, skip_serializing_if = "BetweenSamples::is_linear")]
    between_samples: BetweenSamples,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File<S> {
    schema: String,
    kind: Kind,
    version: String,
    seed: u64,
    input: Input,
    output: Channel,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    falls: bool,
    zero: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    zero_std_error: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rmse: Option<f64>,
    /// Sample period of the record; the parameters do not depend on it.
    recorded_at_hz: f64,
    fitted_on: Vec<FittedOn>,
    stages: Vec<S>,
}

/// A fitted chain: base, effects, and what they were fitted on.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The input.
    pub input: Channel,
    /// How the drive goes on between samples: a whole record is simulated so. A [`chain`](Self::build) that takes one sample after
    /// the other sees it linear.
    pub between_samples: BetweenSamples,
    /// The output.
    pub output: Channel,
    /// Whether the output falls where the hysteresis rises: its gain is negative.
    pub falls: bool,
    /// What the sensor shows at rest \[output unit\].
    pub zero: f64,
    /// The hysteresis.
    pub base: Base,
    /// The stages around it.
    pub effects: Effects,
    /// Standard errors by `stage.parameter`, of the sensor's zero by [`ZERO`].
    pub std_errors: BTreeMap<String, f64>,
    /// Parameters, by `stage.parameter`, that the record does not determine, or only together with others.
    pub undetermined: BTreeSet<String>,
    /// What the model leaves of the rows that it was fitted to, as root of the mean square \[output unit\].
    pub rmse: Option<f64>,
    /// Sample rate of the record \[Hz\].
    pub recorded_at_hz: f64,
    /// The record's files.
    pub fitted_on: Vec<FittedOn>,
    /// Seed of the search.
    pub seed: u64,
    /// Version that wrote the file.
    pub version: String,
}

/// Why a model file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The file cannot be read.
    #[error("{path}: {source}; give the model.json that `fit` or `diagnose` wrote")]
    Read {
        /// The file.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Not JSON, cut off, or with a field that is none.
    #[error("{path}: line {line}, column {column}: {message}; {advice}")]
    Syntax {
        /// The file.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong there.
        message: String,
        /// What to do.
        advice: &'static str,
    },
    /// Another schema.
    #[error("{path}: schema {found:?}, this version reads {SCHEMA:?}: {advice}")]
    Schema {
        /// The file.
        path: String,
        /// Its schema.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// A parameter is not usable.
    #[error("{path}: {source}; fit the model anew or correct that field")]
    Parameter {
        /// The file.
        path: String,
        /// Which and why.
        source: Error,
    },
    /// The stages do not make a chain.
    #[error("{path}: {message}; fit the model anew or correct that field")]
    Stages {
        /// The file.
        path: String,
        /// What is wrong.
        message: String,
    },
}

impl Model {
    /// The chain at a sample period.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn build(&self, period: f64) -> Result<HostChain, Error> {
        let cx = Sampling { period };
        let chain: HostChain =
            self.effects.to_params().around(Operator::new(&self.base, [self.input.low, self.input.high], &cx)?, &cx)?;
        Ok(chain.with_falling(self.falls).with_zero(self.zero))
    }

    /// The stages as the file has them: a JSON object each, with name, parameters, units and standard errors.
    pub fn stages(&self) -> Vec<serde_json::Value> {
        stages::write(self)
    }

    /// The parameters as firmware takes them.
    pub fn to_params(&self) -> ChainParams<Vec<f64>> {
        ChainParams {
            operator: self.base.clone(),
            effects: self.effects.to_params(),
            falls: self.falls,
            zero: self.zero,
            input: [self.input.low, self.input.high],
        }
    }

    /// The compensator at a sample period.
    ///
    /// # Errors
    /// As [`build`](Self::build), and if the chain has no inverse.
    pub fn compensator(&self, period: f64, options: &CompensatorOptions) -> Result<Compensator, Error> {
        let mut chain = self.build(period)?;
        chain.hysteresis = chain.hysteresis.with_bandwidth(options.bandwidth_hz);
        chain.compensator(&Sampling { period }, options)
    }

    /// Inputs that the compensator's memory operator does not leave, if there are such, lowest and highest, and how near it comes
    /// to the exact one \[input unit\]: for outputs beyond what they reach it takes the nearer end.
    pub fn inverse_ends(&self) -> Option<([f64; 2], f64)> {
        inverse_ends(&self.base, [self.input.low, self.input.high])
    }

    /// Whether the model needs a temperature.
    pub fn needs_temperature(&self) -> bool {
        self.effects.temperature.is_some() || matches!(self.base, Base::TdPi(_) | Base::TdEm(_))
    }

    /// Whether the model needs a load.
    pub fn needs_load(&self) -> bool {
        self.effects.load.is_some()
    }

    /// The surroundings that the model cannot do without and these rows lack: the column, and why.
    pub(crate) fn lacking(&self, samples: &Samples) -> Option<(&'static str, &'static str)> {
        if self.needs_temperature() && samples.temperature.is_none() {
            return Some((
                "temperature_degc",
                "the model's gain depends on it; if it was constant, give --temperature",
            ));
        }
        (self.needs_load() && samples.load.is_none()).then_some(("load_n", "the model yields under it"))
    }

    /// The file's text.
    pub fn to_json(&self) -> String {
        let Channel { column, unit, low, high } = self.input.clone();
        let file = File {
            schema: SCHEMA.into(),
            kind: self.base.kind(),
            version: self.version.clone(),
            seed: self.seed,
            input: Input { column, unit, low, high, between_samples: self.between_samples },
            output: self.output.clone(),
            falls: self.falls,
            zero: self.zero,
            zero_std_error: self.std_errors.get(ZERO).copied(),
            rmse: self.rmse,
            recorded_at_hz: self.recorded_at_hz,
            fitted_on: self.fitted_on.clone(),
            stages: self.stages(),
        };
        // Plain numbers, strings and lists: this cannot fail.
        serde_json::to_string_pretty(&file).unwrap_or_default() + "\n"
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| ModelError::Read { path: name.clone(), source })?;
        Self::parse(&name, &text)
    }

    /// Whether one of the record's files is one that the model was fitted to, byte for byte.
    pub fn was_fitted_to(&self, record: &crate::record::Record) -> bool {
        let fitted = |sum: &str| self.fitted_on.iter().any(|file| file.sha256 == sum);
        record.sources().iter().any(|source| source.sha256.as_deref().is_some_and(fitted))
    }

    /// Reads a model from text; `path` is what errors call it.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn parse(path: &str, text: &str) -> Result<Self, ModelError> {
        #[derive(Deserialize)]
        struct Head {
            schema: Option<String>,
        }
        let path = path.to_owned();
        let syntax = |e: serde_json::Error| ModelError::Syntax {
            path: path.clone(),
            line: e.line(),
            column: e.column(),
            // The place stands before it.
            message: e.to_string().split(" at line ").next().unwrap_or_default().to_owned(),
            advice: match e.classify() {
                Category::Data => "correct that field, or fit the model anew",
                Category::Eof => "the file is truncated: fit the model anew",
                Category::Syntax | Category::Io => {
                    "this is no JSON: give the model.json that `fit` or `diagnose` wrote"
                }
            },
        };
        let head: Head = serde_json::from_str(text).map_err(syntax)?;
        let found = head.schema.unwrap_or_default();
        if found != SCHEMA {
            let newer = found.strip_prefix("hyst.model/").and_then(|n| n.parse::<u32>().ok()).is_some_and(|n| n > 1);
            let advice = if newer { "update hystctl to read it" } else { "give a model.json" };
            return Err(ModelError::Schema { path, found, advice });
        }
        let file: File<serde_json::Value> = serde_json::from_str(text).map_err(syntax)?;
        let model = Self::from_file(file).map_err(|message| ModelError::Stages { path: path.clone(), message })?;
        // Whatever the sample period, a chain must come of it and every number must be finite.
        let period = 1.0 / model.recorded_at_hz;
        let usable = units::agree(&model.base, &model.output).and_then(|()| model.build(period).map(|_| ()));
        usable.map_err(|source| ModelError::Parameter { path: path.clone(), source })?;
        for (name, x) in [("zero", model.zero), ("input.low", model.input.low), ("input.high", model.input.high)] {
            if !x.is_finite() {
                return Err(ModelError::Parameter { path, source: Error::NonFinite(name) });
            }
        }
        Ok(model)
    }

    fn from_file(file: File<serde_json::Value>) -> Result<Self, String> {
        let stages::Stages { base, effects, mut std_errors, undetermined } = stages::read(file.stages)?;
        std_errors.extend(file.zero_std_error.map(|error| (ZERO.into(), error)));
        if base.kind() != file.kind {
            return Err(format!("the kind is {}, but the hysteresis stage is {}", file.kind, base.kind()));
        }
        let Input { column, unit, low, high, between_samples } = file.input;
        let input = Channel { column, unit, low, high };
        for (name, channel) in [("input", &input), ("output", &file.output)] {
            if channel.low > channel.high {
                return Err(format!("{name}.low {} is above {name}.high {}", channel.low, channel.high));
            }
        }
        if !(file.recorded_at_hz > 0.0 && file.recorded_at_hz.is_finite()) {
            return Err("recorded_at_hz must be positive".into());
        }
        if between_samples != BetweenSamples::Linear && file.kind != Kind::BoucWenOscillator {
            return Err(format!(
                "input.between_samples is {between_samples}, which is for {} in this version, not for {}",
                Kind::BoucWenOscillator,
                file.kind
            ));
        }
        Ok(Self {
            input,
            between_samples,
            output: file.output,
            falls: file.falls,
            zero: file.zero,
            base,
            effects,
            std_errors,
            undetermined,
            rmse: file.rmse.filter(|rmse| rmse.is_finite()),
            recorded_at_hz: file.recorded_at_hz,
            fitted_on: file.fitted_on,
            seed: file.seed,
            version: file.version,
        })
    }
}
