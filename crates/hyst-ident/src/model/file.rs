//! Reading, checking and writing of `model.json`.

use std::path::Path;

use hyst_core::{Error, Kind};
use serde::{Deserialize, Serialize};
use serde_json::error::Category;

use super::{Channel, FittedOn, Model, ZERO, stages, units};
use crate::BetweenSamples;

/// The schema of the files that this version writes.
pub const SCHEMA: &str = "hyst.model/1";

/// The input in the file.
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
    /// The sample rate of the record. The parameters do not depend on it.
    recorded_at_hz: f64,
    fitted_on: Vec<FittedOn>,
    stages: Vec<S>,
}

/// Why a model file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The file cannot be read.
    #[error("{path}: {source}; give the model.json that hystctl fit or diagnose wrote")]
    Read {
        /// The file.
        path: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file is not JSON, is truncated, or has an invalid field.
    #[error("{path}: line {line}, column {column}: {message}; {advice}")]
    Syntax {
        /// The file.
        path: String,
        /// The line, counted from 1.
        line: usize,
        /// The column, counted from 1.
        column: usize,
        /// What is wrong.
        message: String,
        /// What to do.
        advice: &'static str,
    },
    /// The file has another schema.
    #[error("{path}: the schema is {found:?}, but this version reads {SCHEMA:?}: {advice}")]
    Schema {
        /// The file.
        path: String,
        /// The schema of the file.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// A parameter is out of range.
    #[error("{path}: {source}; correct that field, or fit the model again")]
    Parameter {
        /// The file.
        path: String,
        /// The parameter, and what is wrong.
        source: Error,
    },
    /// The stages do not make a chain.
    #[error("{path}: {message}; correct that field, or fit the model again")]
    Stages {
        /// The file.
        path: String,
        /// What is wrong.
        message: String,
    },
}

impl Model {
    /// Returns one JSON object per stage, with name, parameters, units and standard errors.
    pub fn stages(&self) -> Vec<serde_json::Value> {
        stages::write(self)
    }

    /// Returns the text of the file.
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
        // Serialization of numbers, strings and lists cannot fail.
        serde_json::to_string_pretty(&file).unwrap_or_default() + "\n"
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// Those of [`ModelError`].
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| ModelError::Read { path: name.clone(), source })?;
        Self::parse(&name, &text)
    }

    /// Parses a model. `path` is the file name in errors.
    ///
    /// # Errors
    /// Those of [`ModelError`].
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
            // The message ends with the place, which is stated separately.
            message: e.to_string().split(" at line ").next().unwrap_or_default().to_owned(),
            advice: match e.classify() {
                Category::Data => "correct that field, or fit the model again",
                Category::Eof => "the file is truncated: copy it again, or fit the model again",
                Category::Syntax | Category::Io => {
                    "the file is not valid JSON: give the model.json that hystctl fit or diagnose wrote"
                }
            },
        };
        let head: Head = serde_json::from_str(text).map_err(syntax)?;
        let found = head.schema.unwrap_or_default();
        if found != SCHEMA {
            let newer = found.strip_prefix("hyst.model/").and_then(|n| n.parse::<u32>().ok()).is_some_and(|n| n > 1);
            let advice = if newer { "update hystctl" } else { "give a model.json" };
            return Err(ModelError::Schema { path, found, advice });
        }
        let file: File<serde_json::Value> = serde_json::from_str(text).map_err(syntax)?;
        let model = Self::from_file(file).map_err(|message| ModelError::Stages { path: path.clone(), message })?;
        // The parameters must give a chain, and every number must be finite.
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
            return Err("recorded_at_hz must be a positive number of Hz".into());
        }
        if between_samples != BetweenSamples::Linear && file.kind != Kind::BoucWenOscillator {
            return Err(format!(
                "input.between_samples is {between_samples}, which this version supports for {} only, not for {}",
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
