//! `model.json`: reading, checking, writing.

use std::collections::BTreeMap;
use std::path::Path;

use hyst_core::{
    CompensatorOptions, CreepParams, DelayParams, DriftParams, Error, InterferenceParams, LagParams, ResonanceParams,
    Sampling, TemperatureParams,
};
use serde::{Deserialize, Serialize};

use super::{Base, Compensator, CreepBank, Effects, HostChain, Kind};

/// Schema of the files that this version writes.
pub const SCHEMA: &str = "hyst.model/1";

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

/// A file that a model was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedOn {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Rows that were fitted.
    pub rows: usize,
    /// Rows that were left out as a start-up transient.
    pub settling_rows: usize,
}

/// One stage of the file: its parameters, their units, their standard errors.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct StageEntry {
    #[serde(flatten)]
    stage: StageSpec,
    units: BTreeMap<String, String>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    std_errors: BTreeMap<String, f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
enum StageSpec {
    Base(Base),
    Effect(EffectSpec),
}

#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "stage", rename_all = "kebab-case")]
enum EffectSpec {
    Delay(DelayParams),
    Lag(LagParams),
    Temperature(TemperatureParams),
    Creep(CreepBank),
    Resonance(ResonanceParams),
    Drift(DriftParams),
    Interference(InterferenceParams),
}

/// Reads a stage by its name, so that an error can name the stage and the field.
fn read_stage(value: serde_json::Value) -> Result<(StageSpec, BTreeMap<String, f64>), String> {
    #[derive(Deserialize)]
    struct PiSpec {
        gain: f64,
        thresholds: Vec<f64>,
        weights: Vec<f64>,
    }
    fn field<S: serde::de::DeserializeOwned>(name: &str, value: serde_json::Value) -> Result<S, String> {
        serde_path_to_error::deserialize(value).map_err(|e| match e.path().to_string() {
            path if path == "." => format!("stage {name}: {}", e.inner()),
            path => format!("stage {name}, field {path}: {}", e.inner()),
        })
    }
    let name =
        value.get("stage").and_then(|v| v.as_str()).ok_or("a stage has no name in its field \"stage\"")?.to_owned();
    let std_errors = value.get("std_errors").cloned().map_or(Ok(BTreeMap::new()), |v| field(&name, v))?;
    let effect = StageSpec::Effect;
    let spec = match name.as_str() {
        "pi" => {
            let PiSpec { gain, thresholds, weights } = field(&name, value)?;
            StageSpec::Base(Base::Pi { gain, thresholds, weights })
        }
        "preisach" => StageSpec::Base(Base::Preisach(field(&name, value)?)),
        "delay" => effect(EffectSpec::Delay(field(&name, value)?)),
        "lag" => effect(EffectSpec::Lag(field(&name, value)?)),
        "temperature" => effect(EffectSpec::Temperature(field(&name, value)?)),
        "creep" => effect(EffectSpec::Creep(field(&name, value)?)),
        "resonance" => effect(EffectSpec::Resonance(field(&name, value)?)),
        "drift" => effect(EffectSpec::Drift(field(&name, value)?)),
        "interference" => effect(EffectSpec::Interference(field(&name, value)?)),
        other => return Err(format!("there is no stage called {other:?} in this version")),
    };
    Ok((spec, std_errors))
}

#[derive(Serialize, Deserialize)]
struct File<S> {
    schema: String,
    kind: Kind,
    version: String,
    seed: u64,
    input: Channel,
    output: Channel,
    zero: f64,
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
    /// The output.
    pub output: Channel,
    /// What the sensor shows at rest \[output unit\].
    pub zero: f64,
    /// The hysteresis.
    pub base: Base,
    /// The stages around it.
    pub effects: Effects,
    /// Standard errors by `stage.parameter`.
    pub std_errors: BTreeMap<String, f64>,
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
    /// Not a model, or cut off.
    #[error("{path}: line {line}, column {column}: {message}; the file is truncated or no model: fit it anew")]
    Syntax {
        /// The file.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong there.
        message: String,
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
        let mut chain = HostChain::new(self.base.build()?).with_zero(self.zero);
        let e = &self.effects;
        if let Some(p) = &e.delay {
            chain = chain.with_delay(p, &cx)?;
        }
        if let Some(p) = &e.lag {
            chain = chain.with_lag(p, &cx)?;
        }
        if let Some(p) = &e.temperature {
            chain = chain.with_temperature(p)?;
        }
        if let Some(p) = &e.creep {
            chain = chain.with_creep(&CreepParams { seconds: &p.seconds, shares: &p.shares }, &cx)?;
        }
        for p in &e.resonances {
            chain = chain.with_resonance(p, &cx)?;
        }
        if let Some(p) = &e.drift {
            chain = chain.with_drift(p)?;
        }
        if let Some(p) = &e.interference {
            chain = chain.with_interference(p)?;
        }
        Ok(chain)
    }

    /// The compensator at a sample period.
    ///
    /// # Errors
    /// As [`build`](Self::build), and if the chain has no inverse.
    pub fn compensator(&self, period: f64, options: &CompensatorOptions) -> Result<Compensator, Error> {
        self.build(period)?.compensator(&Sampling { period }, options)
    }

    /// Whether the model needs a temperature.
    pub fn needs_temperature(&self) -> bool {
        self.effects.temperature.is_some()
    }

    /// The file's text.
    pub fn to_json(&self) -> String {
        let file = File {
            schema: SCHEMA.into(),
            kind: self.base.kind(),
            version: self.version.clone(),
            seed: self.seed,
            input: self.input.clone(),
            output: self.output.clone(),
            zero: self.zero,
            recorded_at_hz: self.recorded_at_hz,
            fitted_on: self.fitted_on.clone(),
            stages: self.stages(),
        };
        // Plain numbers, strings and lists: this cannot fail.
        serde_json::to_string_pretty(&file).unwrap_or_default() + "\n"
    }

    fn stages(&self) -> Vec<StageEntry> {
        let (u, y) = (&self.input.unit, &self.output.unit);
        let mut list = Vec::new();
        let mut push = |stage: StageSpec, name: &str, units: &[(&str, String)]| {
            let own = |key: &String| key.strip_prefix(name).and_then(|k| k.strip_prefix('.')).map(str::to_owned);
            list.push(StageEntry {
                stage,
                units: units.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect(),
                std_errors: self.std_errors.iter().filter_map(|(k, v)| Some((own(k)?, *v))).collect(),
            });
        };
        let e = &self.effects;
        let effect = StageSpec::Effect;
        if let Some(p) = e.delay {
            push(effect(EffectSpec::Delay(p)), "delay", &[("seconds", "s".into())]);
        }
        if let Some(p) = e.lag {
            push(effect(EffectSpec::Lag(p)), "lag", &[("seconds", "s".into())]);
        }
        let base = StageSpec::Base(self.base.clone());
        match &self.base {
            Base::Pi { .. } => {
                let slope = format!("{y}/{u}");
                push(base, "pi", &[("gain", slope.clone()), ("thresholds", u.clone()), ("weights", slope)]);
            }
            Base::Preisach(_) => {
                let volts = ["low", "high", "rest"].map(|k| (k, u.clone()));
                let outputs = ["density", "once"].map(|k| (k, y.clone()));
                push(base, "preisach", &[&volts[..], &outputs[..]].concat());
            }
        }
        if let Some(p) = e.temperature {
            push(
                effect(EffectSpec::Temperature(p)),
                "temperature",
                &[("per_kelvin", "1/K".into()), ("reference_degc", "degC".into())],
            );
        }
        if let Some(p) = &e.creep {
            push(effect(EffectSpec::Creep(p.clone())), "creep", &[("seconds", "s".into()), ("shares", "1".into())]);
        }
        for (i, p) in e.resonances.iter().enumerate() {
            let name = if i == 0 { "resonance" } else { "resonance_2" };
            push(
                effect(EffectSpec::Resonance(*p)),
                name,
                &[("hz", "Hz".into()), ("damping", "1".into()), ("gain", "1".into())],
            );
        }
        if let Some(p) = e.drift {
            push(effect(EffectSpec::Drift(p)), "drift", &[("per_second", format!("{y}/s"))]);
        }
        if let Some(p) = e.interference {
            let units = [("hz", "Hz".into()), ("amplitude", y.clone()), ("phase", "rad".into())];
            push(effect(EffectSpec::Interference(p)), "interference", &units);
        }
        list
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
            message: e.to_string(),
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
        model.build(period).map_err(|source| ModelError::Parameter { path: path.clone(), source })?;
        for (name, x) in [("zero", model.zero), ("input.low", model.input.low), ("input.high", model.input.high)] {
            if !x.is_finite() {
                return Err(ModelError::Parameter { path, source: Error::NonFinite(name) });
            }
        }
        Ok(model)
    }

    fn from_file(file: File<serde_json::Value>) -> Result<Self, String> {
        let mut effects = Effects::default();
        let mut base = None;
        let mut std_errors = BTreeMap::new();
        for value in file.stages {
            let (spec, errors) = read_stage(value)?;
            let name = match spec {
                StageSpec::Base(b) => {
                    let name = b.kind().name();
                    if base.replace(b).is_some() {
                        return Err("there are two hysteresis stages".into());
                    }
                    name
                }
                StageSpec::Effect(e) => {
                    let (fresh, name) = match e {
                        EffectSpec::Delay(p) => (effects.delay.replace(p).is_none(), "delay"),
                        EffectSpec::Lag(p) => (effects.lag.replace(p).is_none(), "lag"),
                        EffectSpec::Temperature(p) => (effects.temperature.replace(p).is_none(), "temperature"),
                        EffectSpec::Creep(p) => (effects.creep.replace(p).is_none(), "creep"),
                        EffectSpec::Resonance(p) => {
                            effects.resonances.push(p);
                            (true, if effects.resonances.len() == 1 { "resonance" } else { "resonance_2" })
                        }
                        EffectSpec::Drift(p) => (effects.drift.replace(p).is_none(), "drift"),
                        EffectSpec::Interference(p) => (effects.interference.replace(p).is_none(), "interference"),
                    };
                    if !fresh {
                        return Err(format!("there are two stages {name:?}"));
                    }
                    name
                }
            };
            std_errors.extend(errors.into_iter().map(|(k, v)| (format!("{name}.{k}"), v)));
        }
        let base = base.ok_or("there is no hysteresis stage")?;
        if base.kind() != file.kind {
            return Err(format!("the kind is {}, but the hysteresis stage is {}", file.kind, base.kind()));
        }
        if !(file.recorded_at_hz > 0.0 && file.recorded_at_hz.is_finite()) {
            return Err("recorded_at_hz must be positive".into());
        }
        Ok(Self {
            input: file.input,
            output: file.output,
            zero: file.zero,
            base,
            effects,
            std_errors,
            recorded_at_hz: file.recorded_at_hz,
            fitted_on: file.fitted_on,
            seed: file.seed,
            version: file.version,
        })
    }
}
