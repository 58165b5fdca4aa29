//! The stages of a model file: JSON objects with name, parameters, units and standard errors.

use std::collections::{BTreeMap, BTreeSet};

use hyst_core::{Meta, Params, PiParams, ViscousPiParams};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{Base, Effects, Model, units};

/// The contents of the stages of a file.
pub(super) struct Stages {
    pub(super) base: Base,
    pub(super) effects: Effects,
    pub(super) std_errors: BTreeMap<String, f64>,
    pub(super) undetermined: BTreeSet<String>,
}

/// Drag of the play operators of a Prandtl-Ishlinskii base model, a separate stage in the file.
#[derive(Serialize, Deserialize)]
struct RateDependence {
    seconds: f64,
    /// Missing in older files.
    #[serde(default)]
    volt_seconds: f64,
}

impl RateDependence {
    fn of(self, pi: PiParams<Vec<f64>>) -> ViscousPiParams<Vec<f64>> {
        ViscousPiParams { pi, seconds: self.seconds, volt_seconds: self.volt_seconds }
    }
}

/// The parameters of the drag, without those of the play operators.
struct Drag<'a>(&'a mut ViscousPiParams<Vec<f64>>);

impl Params for Drag<'_> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        self.0.visit(&mut |meta, x| {
            if !meta.name.starts_with("pi.") {
                f(meta, x);
            }
        });
    }
}

/// Returns the stages of a model, in the order of the chain.
pub(super) fn write(model: &Model) -> Vec<Value> {
    let (u, y) = (model.input.symbol(), model.output.symbol());
    let mut list = Vec::new();
    let mut push = |name: &str, key: &str, fields: Value, params: &mut dyn Params| {
        let units = units::of(&fields, params, u, y);
        let mut entry = Map::new();
        entry.insert("stage".into(), name.into());
        if let Value::Object(fields) = fields {
            entry.extend(fields);
        }
        let own = |k: &String| k.strip_prefix(key).and_then(|k| k.strip_prefix('.')).map(str::to_owned);
        let errors: Map<String, Value> =
            model.std_errors.iter().filter_map(|(k, v)| Some((own(k)?, Value::from(*v)))).collect();
        entry.insert("units".into(), Value::Object(units));
        if !errors.is_empty() {
            entry.insert("std_errors".into(), Value::Object(errors));
        }
        let undetermined: Vec<Value> = model.undetermined.iter().filter_map(own).map(Value::from).collect();
        if !undetermined.is_empty() {
            entry.insert("undetermined".into(), Value::Array(undetermined));
        }
        list.push(Value::Object(entry));
    };
    // Serialization of numbers, strings and lists cannot fail.
    fn value(x: &impl Serialize) -> Value {
        serde_json::to_value(x).unwrap_or_default()
    }
    let e = &mut model.effects.clone();
    if let Some(p) = &mut e.delay {
        push("delay", "delay", value(p), p);
    }
    if let Some(p) = &mut e.lag {
        push("lag", "lag", value(p), p);
    }
    if let Some(p) = &mut e.rate {
        push("rate", "rate-dependence", value(p), p);
    }
    if let Some(p) = &mut e.widening {
        push("widening", "rate-dependence", value(p), p);
    }
    match &mut model.base.clone() {
        Base::ViscousPi(p) => {
            push("pi", "pi", value(&p.pi), &mut p.pi);
            let drag = value(&RateDependence { seconds: p.seconds, volt_seconds: p.volt_seconds });
            push("rate-dependence", "rate-dependence", drag, &mut Drag(p));
        }
        base => {
            let name = base.kind().name();
            // The enum is serialized as { "name": { fields } }.
            let fields = match value(base) {
                Value::Object(outer) => outer.into_iter().next().map(|(_, fields)| fields).unwrap_or_default(),
                other => other,
            };
            push(name, name, fields, base);
        }
    }
    if let Some(p) = &mut e.asymmetry {
        push("asymmetry", "asymmetry", value(p), p);
    }
    if let Some(p) = &mut e.temperature {
        push("temperature", "temperature", value(p), p);
    }
    if let Some(p) = &mut e.creep {
        push("creep", "creep", value(p), p);
    }
    if let Some(p) = &mut e.load {
        push("load", "load", value(p), p);
    }
    for (i, p) in e.resonances.iter_mut().enumerate() {
        push("resonance", if i == 0 { "resonance" } else { "resonance_2" }, value(p), p);
    }
    if let Some(p) = &mut e.saturation {
        push("saturation", "saturation", value(p), p);
    }
    if let Some(p) = &mut e.drift {
        push("drift", "drift", value(p), p);
    }
    if let Some(p) = &mut e.interference {
        push("interference", "interference", value(p), p);
    }
    list
}

/// Reads the parameters of the stage `name`. An error names the stage and the field.
///
/// An unknown field is refused, because a misspelt field would silently get its default.
fn fields<S: DeserializeOwned + Serialize>(name: &str, value: &Value) -> Result<S, String> {
    let read: S = serde_path_to_error::deserialize(value).map_err(|e| match e.path().to_string() {
        path if path == "." => format!("stage {name}: {}", e.inner()),
        path => format!("stage {name}, field {path}: {}", e.inner()),
    })?;
    match serde_json::to_value(&read).ok().and_then(|known| unknown(value, &known, "")) {
        Some(field) => Err(format!("stage {name} has no field {field:?}")),
        None => Ok(read),
    }
}

/// Returns the path of a field that `known` does not have.
fn unknown(given: &Value, known: &Value, path: &str) -> Option<String> {
    let (Value::Object(given), Value::Object(known)) = (given, known) else { return None };
    given.iter().find_map(|(key, value)| {
        let here = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        match known.get(key) {
            Some(known) => unknown(value, known, &here),
            None if path.is_empty() && ["stage", "units", "std_errors", "undetermined"].contains(&key.as_str()) => None,
            None => Some(here),
        }
    })
}

/// Reads a stage into an empty slot; refuses a second stage of the same name.
fn only<S: DeserializeOwned + Serialize>(slot: &mut Option<S>, name: &str, value: &Value) -> Result<(), String> {
    if slot.replace(fields(name, value)?).is_some() {
        Err(format!("there are two stages {name:?}; remove one"))
    } else {
        Ok(())
    }
}

/// Reads the base model of a stage with this name; `None` if the stage is not a base model.
fn base(name: &str, v: &Value) -> Result<Option<Base>, String> {
    Ok(Some(match name {
        "pi" => Base::Pi(fields(name, v)?),
        "gpi" => Base::Gpi(fields(name, v)?),
        "td-pi" => Base::TdPi(fields(name, v)?),
        "preisach" => Base::Preisach(fields(name, v)?),
        "maxwell-slip" => Base::MaxwellSlip(fields(name, v)?),
        "td-em" => Base::TdEm(fields(name, v)?),
        "bouc-wen" => Base::BoucWen(fields(name, v)?),
        "bouc-wen-oscillator" => Base::BoucWenOscillator(fields(name, v)?),
        "atan" => Base::Atan(fields(name, v)?),
        "sigmoid" => Base::Sigmoid(fields(name, v)?),
        "softplus" => Base::Softplus(fields(name, v)?),
        "softsign" => Base::Softsign(fields(name, v)?),
        "tanh" => Base::Tanh(fields(name, v)?),
        "dpm" => Base::Dpm(fields(name, v)?),
        "lfdm" => Base::Lfdm(fields(name, v)?),
        "ifm" => Base::Ifm(fields(name, v)?),
        _ => return Ok(None),
    }))
}

/// Reads the stages of a file.
pub(super) fn read(stages: Vec<Value>) -> Result<Stages, String> {
    let mut effects = Effects::default();
    let mut bases: Option<Base> = None;
    let mut drag: Option<RateDependence> = None;
    let (mut std_errors, mut undetermined) = (BTreeMap::new(), BTreeSet::new());
    for value in &stages {
        let name = value.get("stage").and_then(Value::as_str).ok_or("a stage has no name in its field \"stage\"")?;
        let mut key = name;
        if let Some(found) = base(name, value)? {
            if bases.replace(found).is_some() {
                return Err("there are two hysteresis stages".into());
            }
        } else {
            match name {
                "rate-dependence" => only(&mut drag, name, value)?,
                "delay" => only(&mut effects.delay, name, value)?,
                "lag" => only(&mut effects.lag, name, value)?,
                "rate" => {
                    key = "rate-dependence";
                    only(&mut effects.rate, name, value)?;
                }
                "widening" => {
                    key = "rate-dependence";
                    only(&mut effects.widening, name, value)?;
                }
                "asymmetry" => only(&mut effects.asymmetry, name, value)?,
                "temperature" => only(&mut effects.temperature, name, value)?,
                "creep" => only(&mut effects.creep, name, value)?,
                "load" => only(&mut effects.load, name, value)?,
                "resonance" => {
                    effects.resonances.push(fields(name, value)?);
                    key = if effects.resonances.len() == 1 { "resonance" } else { "resonance_2" };
                    if effects.resonances.len() > hyst_core::MAX_RESONANCES {
                        return Err(format!("there are more than {} resonances", hyst_core::MAX_RESONANCES));
                    }
                }
                "saturation" => only(&mut effects.saturation, name, value)?,
                "drift" => only(&mut effects.drift, name, value)?,
                "interference" => only(&mut effects.interference, name, value)?,
                other => return Err(format!("this version has no stage {other:?}")),
            }
        }
        let errors: BTreeMap<String, f64> =
            value.get("std_errors").map_or_else(|| Ok(BTreeMap::new()), |v| fields(name, v))?;
        std_errors.extend(errors.into_iter().map(|(k, v)| (format!("{key}.{k}"), v)));
        let own: Vec<String> = value.get("undetermined").map_or_else(|| Ok(Vec::new()), |v| fields(name, v))?;
        undetermined.extend(own.into_iter().map(|k| format!("{key}.{k}")));
    }
    let base = match (bases.ok_or("there is no hysteresis stage")?, drag) {
        (base, None) => base,
        (Base::Pi(pi), Some(drag)) => Base::ViscousPi(drag.of(pi)),
        (other, Some(_)) => {
            let kind = other.kind();
            return Err(format!(
                "the stage rate-dependence is for pi only, not for {kind}; for rate dependence of preisach use dpm"
            ));
        }
    };
    Ok(Stages { base, effects, std_errors, undetermined })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_core::PiParams;

    #[test]
    fn a_misspelt_field_is_named() {
        let stage = |text: &str| read(vec![serde_json::from_str::<Value>(text).unwrap()]).map(|_| ());
        let numbers = r#""a":1.0,"b":1.0,"c":1.0,"alpha":0.5,"beta":0.5"#;
        assert_eq!(stage(&format!(r#"{{"stage":"lfdm",{numbers},"order":"second"}}"#)), Ok(()));
        let refused = stage(&format!(r#"{{"stage":"lfdm",{numbers},"ordr":"second"}}"#));
        assert_eq!(refused, Err("stage lfdm has no field \"ordr\"".into()));
        let slip = r#"{"stage":"td-em","slip":{"reading":"backlash","widths":[1.0],"gains":[1.0],"width":2.0},"capacitance":1.0,
            "resistance":1.0,"mass":1.0,"stiffness":1.0,"damping":1.0,"coupling":[1.0,0.0,0.0],"per_metre":1.0}"#;
        assert_eq!(stage(slip), Err("stage td-em has no field \"slip.width\"".into()));
    }

    #[test]
    fn the_stage_rate_dependence_is_for_pi_only() {
        let stage = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        let pi = stage(r#"{"stage":"pi","gain":0.1,"thresholds":[1.0],"weights":[0.1]}"#);
        let drag = stage(r#"{"stage":"rate-dependence","seconds":0.002}"#);
        let with = |drag: &Value| read(vec![pi.clone(), drag.clone()]).map(|stages| stages.base);
        let expected = PiParams { gain: 0.1, thresholds: vec![1.0], weights: vec![0.1] };
        let expected = ViscousPiParams { pi: expected, seconds: 0.002, volt_seconds: 0.0 };
        assert_eq!(with(&drag), Ok(Base::ViscousPi(expected.clone())));
        let root = stage(r#"{"stage":"rate-dependence","seconds":0.002,"volt_seconds":0.5}"#);
        assert_eq!(with(&root), Ok(Base::ViscousPi(ViscousPiParams { volt_seconds: 0.5, ..expected })));
        let misspelt = stage(r#"{"stage":"rate-dependence","seconds":0.002,"voltseconds":0.5}"#);
        assert!(with(&misspelt).is_err_and(|e| e.contains("no field \"voltseconds\"")));
        let slip = stage(r#"{"stage":"maxwell-slip","reading":"backlash","widths":[1.0],"gains":[0.1]}"#);
        assert!(read(vec![slip, drag]).is_err_and(|e| e.contains("is for pi only")));
        assert!(read(vec![pi.clone(), pi]).is_err_and(|e| e.contains("two hysteresis")));
    }
}
