//! Contents of a log: description of the run, samples, events and their schemas.

use std::collections::BTreeMap;

use hyst_hw::Phase;
use hyst_ident::model::{Effect, Model};
use hyst_ident::record::OutputUnit;
use serde::{Serialize, Serializer};
use serde_json::json;
use sha2::{Digest, Sha256};

/// Description of a run in its log.
#[derive(Clone, Copy, Debug)]
pub struct RunInfo<'a> {
    /// Name of the device.
    pub device: &'a str,
    /// Unit of output, reference and error.
    pub output: OutputUnit,
    /// Samples per second \[Hz\].
    pub sample_rate_hz: f64,
    /// The model that computed the drive; `None` for a drive that was played unchanged.
    pub model: Option<LoggedModel<'a>>,
}

/// A model and the text of its file.
#[derive(Clone, Copy, Debug)]
pub struct LoggedModel<'a> {
    /// The model.
    pub model: &'a Model,
    /// Text of its file.
    pub json: &'a str,
}

/// One sample of the log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LoggedSample {
    /// Time of the device's clock \[s\].
    pub time_s: f64,
    /// Segment, from 0.
    pub segment: usize,
    /// Phase of the run: ramp before a segment, segment, or ramp after it.
    #[serde(serialize_with = "phase_name")]
    pub phase: Phase,
    /// Voltage that was applied \[V\].
    pub drive_v: f64,
    /// Measured output \[output unit\].
    pub output: f64,
    /// Wanted output \[output unit\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
    /// Output minus reference \[output unit\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Output that the model predicts \[output unit\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted: Option<f64>,
    /// Temperature \[°C\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_degc: Option<f64>,
    /// Load \[N\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_n: Option<f64>,
    /// Estimated force \[N\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimated_force_n: Option<f64>,
}

fn phase_name<S: Serializer>(phase: &Phase, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(match phase {
        Phase::Approach => "approach",
        Phase::Record => "record",
        Phase::Retreat => "retreat",
    })
}

impl LoggedSample {
    /// Creates the sample as it was measured; `reference` is the wanted output at that time.
    pub fn new(segment: usize, phase: Phase, sample: &hyst_hw::Sample, reference: Option<f64>) -> Self {
        Self {
            time_s: sample.time_s,
            segment,
            phase,
            drive_v: sample.drive_v,
            output: sample.output,
            reference,
            error: reference.map(|wanted| sample.output - wanted),
            predicted: None,
            temperature_degc: sample.temperature_degc,
            load_n: sample.load_n,
            estimated_force_n: sample.force_n,
        }
    }
}

/// Returns the metadata of a run, as text by key.
pub(super) fn metadata(info: &RunInfo<'_>) -> BTreeMap<String, String> {
    let mut entries = BTreeMap::from(
        [
            ("program", "hystctl"),
            ("version", env!("CARGO_PKG_VERSION")),
            ("git", env!("HYST_GIT")),
            ("device", info.device),
            ("output_column", info.output.column()),
            ("unit", info.output.symbol()),
        ]
        .map(|(key, value)| (key.to_owned(), value.to_owned())),
    );
    // A program that was built without a repository has no git state.
    entries.retain(|_, value| !value.is_empty());
    entries.insert("sample_rate_hz".to_owned(), info.sample_rate_hz.to_string());
    if let Some(LoggedModel { model, json }) = info.model {
        entries.insert("model_kind".to_owned(), model.base.kind().to_string());
        let effects: Vec<&str> = model.effects.names().into_iter().map(Effect::name).collect();
        entries.insert("model_effects".to_owned(), effects.join(","));
        entries.insert("model_sha256".to_owned(), format!("{:x}", Sha256::digest(json)));
    }
    entries
}

/// Returns the JSON schema of [`LoggedSample`].
pub(super) fn schema(unit: &str) -> serde_json::Value {
    let number = |description: String| json!({ "type": "number", "description": description });
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "hyst.actuator.Sample",
        "description": "One sample of an actuator: what was applied, what was measured and what was wanted",
        "type": "object",
        "properties": {
            "time_s": number("Time of the lab's clock [s]".to_owned()),
            "segment": { "type": "integer", "description": "Segment, from 0; the device rests between segments" },
            "phase": {
                "type": "string",
                "enum": ["approach", "record", "retreat"],
                "description": "approach: ramp to the first value; record: the drive; retreat: ramp to rest"
            },
            "drive_v": number("Voltage that was applied [V]".to_owned()),
            "output": {
                "type": ["number", "null"],
                "description": format!("Measured output [{unit}]; null where the sensor showed no number")
            },
            "reference": number(format!("Wanted output [{unit}]; only in a record that follows a reference")),
            "error": { "type": ["number", "null"], "description": format!("Output minus reference [{unit}]") },
            "predicted": number(format!("Output that the model predicts [{unit}]; only if a model runs in parallel")),
            "temperature_degc": number("Temperature [degC], where it is measured".to_owned()),
            "load_n": number("Load [N], where it is measured".to_owned()),
            "estimated_force_n": number("Force on the output [N], where it is estimated".to_owned())
        },
        "required": ["time_s", "segment", "phase", "drive_v", "output"]
    })
}

/// Returns the unit of each field, by `unit.FIELD`.
pub(super) fn units(unit: &str) -> BTreeMap<String, String> {
    let fields = [
        ("time_s", "s"),
        ("drive_v", "V"),
        ("output", unit),
        ("reference", unit),
        ("error", unit),
        ("predicted", unit),
        ("temperature_degc", "degC"),
        ("load_n", "N"),
        ("estimated_force_n", "N"),
    ];
    fields.into_iter().map(|(field, unit)| (format!("unit.{field}"), unit.to_owned())).collect()
}

/// Returns the units of the fields of an event, as [`units`] does.
pub(super) fn event_units() -> BTreeMap<String, String> {
    BTreeMap::from([("unit.time_s".to_owned(), "s".to_owned())])
}

/// An event during a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoggedEvent {
    /// Time of the device's clock \[s\].
    pub time_s: f64,
    /// Kind of the event, for programs: `model-lost`, `model-found`, `fault`, `cancelled`, `gap`.
    pub kind: &'static str,
    /// Description in a sentence.
    pub text: String,
}

/// Returns the JSON schema of [`LoggedEvent`].
pub(super) fn event_schema() -> serde_json::Value {
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "hyst.actuator.Event",
        "description": "Something that happened during a run",
        "type": "object",
        "properties": {
            "time_s": { "type": "number", "description": "Time of the lab's clock [s]" },
            "kind": { "type": "string", "enum": ["model-lost", "model-found", "fault", "cancelled", "gap", "adapted"] },
            "text": { "type": "string" }
        },
        "required": ["time_s", "kind", "text"]
    })
}
