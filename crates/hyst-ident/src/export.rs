//! `export`: a model's parameters for a board, as a block of bytes, as Rust source, as a C header.

use std::fmt;
use std::fmt::Write as _;

use hyst_core::{BlockError, ChainParams, write_block};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::model::Model;

/// The parameter block that firmware reads with [`hyst_core::read_block`].
///
/// # Errors
/// If the block would be larger than 16 MB.
pub fn block(model: &Model) -> Result<Vec<u8>, BlockError> {
    let params = model.to_params();
    let mut size = 4096;
    loop {
        let mut buffer = vec![0; size];
        match write_block(&params, &mut buffer) {
            Ok(bytes) => return Ok(bytes.to_vec()),
            Err(BlockError::NoRoom) if size < 16 << 20 => size *= 2,
            Err(error) => return Err(error),
        }
    }
}

/// A list of numbers that prints itself as a slice in Rust source.
#[derive(Serialize, Deserialize)]
struct Slice(Vec<f64>);

impl fmt::Debug for Slice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // In one line whatever the style: a list of hundreds would fill pages.
        write!(f, "&{:?}", self.0)
    }
}

fn origin(model: &Model) -> String {
    let files: Vec<String> = model.fitted_on.iter().map(|f| format!("{} (sha256 {})", f.file, f.sha256)).collect();
    let from = if files.is_empty() { "a model that names no record".into() } else { files.join(", ") };
    format!(
        "Parameters of a {} model, input {} [{}], output {} [{}], fitted on {from}.",
        model.base.kind(),
        model.input.column,
        model.input.unit,
        model.output.column,
        model.output.unit
    )
}

/// Rust source: constants for `hyst-core`, to be built at any sample period.
pub fn rust(model: &Model) -> String {
    // Through JSON, because that maps the lists of every kind of parameters at once. It cannot fail: these are the same types.
    let params: Option<ChainParams<Slice>> =
        serde_json::to_value(model.to_params()).ok().and_then(|v| serde_json::from_value(v).ok());
    let Some(params) = params else { return String::new() };
    let operator = format!("{:?}", params.operator);
    // `Pi(PiParams { … })`: the type of what is inside is its first word.
    let inner = operator.find('(').map_or("", |at| &operator[at + 1..operator.len() - 1]);
    let name = inner.split([' ', '{']).next().unwrap_or_default();
    let list = if inner.contains("&[") { "<&[f64]>" } else { "" };
    format!(
        "// Written by hystctl {version}. {origin}\n\
         //\n\
         //   let hysteresis = OPERATOR.build(&cx)?; // cx: () or Sampling, as the operator asks for\n\
         //   let chain = EFFECTS.around(hysteresis, &sampling)?.with_zero(ZERO);\n\
         #[allow(unused_imports)]\n\
         use hyst_core::{{*, Curve::*, SlipReading::*}};\n\
         \n\
         /// The memory operator.\n\
         pub const OPERATOR: {name}{list} = {inner};\n\
         /// The stages around it.\n\
         pub const EFFECTS: EffectParams<&[f64]> = {effects:?};\n\
         /// What the sensor shows at rest [{unit}].\n\
         pub const ZERO: f64 = {zero:?};\n\
         /// Inputs that the model was identified on, lowest and highest [{input}].\n\
         pub const INPUT: [f64; 2] = {range:?};\n",
        version = env!("CARGO_PKG_VERSION"),
        origin = origin(model),
        effects = params.effects,
        zero = params.zero,
        range = params.input,
        unit = model.output.unit,
        input = model.input.unit,
    )
}

/// A C99 header: the block of bytes, and every parameter as a constant with its unit.
///
/// # Errors
/// As [`block`].
pub fn c(model: &Model) -> Result<String, BlockError> {
    let bytes = block(model)?;
    let mut text = format!(
        "/* Written by hystctl {}. {} */\n#ifndef HYST_MODEL_H\n#define HYST_MODEL_H\n\n#include <stdint.h>\n\n\
         #define HYST_KIND \"{}\"\n\n/* What hyst_core::read_block reads. */\n\
         static const uint8_t hyst_block[{}] = {{",
        env!("CARGO_PKG_VERSION"),
        origin(model).replace("*/", "* /"),
        model.base.kind(),
        bytes.len()
    );
    for (i, byte) in bytes.iter().enumerate() {
        let _ = write!(text, "{}0x{byte:02x},", if i % 16 == 0 { "\n    " } else { " " });
    }
    text += "\n};\n";
    let _ = writeln!(text, "\nstatic const double hyst_zero = {:?}; /* {} */", model.zero, model.output.unit);
    let _ = writeln!(text, "static const double hyst_input_low = {:?}; /* {} */", model.input.low, model.input.unit);
    let _ = writeln!(text, "static const double hyst_input_high = {:?}; /* {} */", model.input.high, model.input.unit);
    for (i, stage) in model.stages().into_iter().enumerate() {
        let Value::Object(mut stage) = stage else { continue };
        let name = stage.remove("stage").and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default();
        let units = stage.remove("units").unwrap_or_default();
        stage.remove("std_errors");
        let _ = writeln!(text, "\n/* Stage {}: {name} */", i + 1);
        // A second mode must not have the names of the first.
        let prefix = format!("hyst_{}_{}", i + 1, identifier(&name));
        constants(&mut text, &prefix, "", &Value::Object(stage), &units);
    }
    text += "\n#endif\n";
    Ok(text)
}

fn identifier(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Writes every number and list below `value` as a constant; `path` is its place, for its unit.
fn constants(text: &mut String, prefix: &str, path: &str, value: &Value, units: &Value) {
    let unit = || match units.get(path).and_then(Value::as_str) {
        Some(unit) => format!(" /* {unit} */"),
        None => String::new(),
    };
    let number = |v: &Value| if v.is_f64() { format!("{:?}", v.as_f64().unwrap_or_default()) } else { v.to_string() };
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                constants(text, &format!("{prefix}_{}", identifier(key)), &path, value, units);
            }
        }
        Value::Array(list) if list.is_empty() => {
            let _ = writeln!(text, "#define {prefix}_length 0");
        }
        Value::Array(list) => {
            let numbers: Vec<String> = list.iter().map(number).collect();
            let _ = writeln!(text, "#define {prefix}_length {}", list.len());
            let _ =
                writeln!(text, "static const double {prefix}[{}] = {{{}}};{}", list.len(), numbers.join(", "), unit());
        }
        Value::String(word) => {
            let _ = writeln!(text, "#define {prefix} \"{word}\"");
        }
        Value::Number(n) if n.is_f64() => {
            let _ = writeln!(text, "static const double {prefix} = {};{}", number(value), unit());
        }
        Value::Number(n) => {
            let _ = writeln!(text, "#define {prefix} {n}");
        }
        Value::Bool(_) | Value::Null => {}
    }
}
