//! A model as a C header.

use std::fmt::Write as _;
use std::str::FromStr;

use hyst_core::BlockError;
use serde_json::Value;

use super::{block, harmless, lost, origin, words};
use crate::model::Model;

/// What the symbols of a C header begin with; its macros have it in capitals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CName(String);

impl Default for CName {
    /// `hyst`.
    fn default() -> Self {
        Self("hyst".into())
    }
}

impl FromStr for CName {
    type Err = String;

    /// What no C identifier may have becomes `_`.
    fn from_str(name: &str) -> Result<Self, String> {
        // The language keeps identifiers that begin with `_` for itself.
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return Err("symbols in C begin with it: begin with a letter from a to z, as in x_axis".into());
        }
        Ok(Self(identifier(name)))
    }
}

/// A C99 header: the block of bytes, and every parameter as a constant with its unit. A program can have the headers of many models,
/// each with a name of its own; of two with the same name the compiler refuses the second.
///
/// # Errors
/// As [`block`].
pub fn c(model: &Model, CName(name): &CName) -> Result<String, BlockError> {
    let bytes = block(model)?;
    let macros = name.to_ascii_uppercase();
    // The block's own check sum tells two models apart.
    let sum: String = bytes.iter().rev().take(4).map(|byte| format!("{byte:02x}")).collect();
    let mut text = format!(
        "/* Written by hystctl {}. {}\n *\n\
         {} */\n#ifndef {macros}_MODEL_H\n#define {macros}_MODEL_H\n#define {macros}_MODEL_SUM 0x{sum}u\n\n\
         #include <stdint.h>\n\n#define {macros}_KIND \"{}\"\n\n/* What hyst_core::read_block reads. */\n\
         static const uint8_t {name}_block[{}] = {{",
        env!("CARGO_PKG_VERSION"),
        origin(model),
        about(model, name),
        model.base.kind(),
        bytes.len()
    );
    for (i, byte) in bytes.iter().enumerate() {
        let _ = write!(text, "{}0x{byte:02x},", if i % 16 == 0 { "\n    " } else { " " });
    }
    text += "\n};\n";
    let (input, output) = (harmless(model.input.symbol()), harmless(model.output.symbol()));
    let _ = writeln!(text, "\n/* What the sensor shows at rest: added to what leaves the last stage. */");
    let _ = writeln!(text, "static const double {name}_zero = {:?}; /* {output} */", model.zero);
    if model.falls {
        let _ = writeln!(text, "/* The output falls where the input rises: y = -H(u) leaves the hysteresis H. */");
    }
    let _ = writeln!(text, "/* Inputs that the model was identified on. */");
    let _ = writeln!(text, "static const double {name}_input_low = {:?}; /* {input} */", model.input.low);
    let _ = writeln!(text, "static const double {name}_input_high = {:?}; /* {input} */", model.input.high);
    let mut modes = 0;
    for stage in model.stages() {
        let Value::Object(mut stage) = stage else { continue };
        let title = stage.remove("stage").and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default();
        let units = stage.remove("units").unwrap_or_default();
        stage.remove("std_errors");
        stage.remove("undetermined");
        let _ = write!(text, "\n/* {title}");
        for line in words::of_stage(&title) {
            let _ = write!(text, "\n *   {line}");
        }
        text += " */\n";
        modes += usize::from(title == "resonance");
        // A second mode must not have the names of the first.
        let second = if title == "resonance" && modes > 1 { format!("_{modes}") } else { String::new() };
        let prefix = format!("{name}_{}{second}", identifier(&title));
        constants(&mut text, &prefix, "", &Value::Object(stage), &units);
    }
    let _ = write!(
        text,
        "\n#elif {macros}_MODEL_SUM != 0x{sum}u\n#error \"two models are called {name}: export one of them with --name\"\n#endif\n"
    );
    Ok(text)
}

/// What a header holds, as lines of a comment: the block, and the chain that the constants make.
fn about(model: &Model, name: &str) -> String {
    let stages = model.stages();
    let chain: Vec<&str> = stages.iter().filter_map(|stage| stage.get("stage")?.as_str()).collect();
    format!(
        " * {name}_block is for Rust firmware: hyst_core::read_block (feature block) makes the model of it.\n\
         \x20* The constants are for code of your own: {} -> {} -> + {name}_zero -> {},\n\
         \x20* stage by stage below; in each, u is what enters it and y what leaves it. No constant depends on a sample period.\n\
         \x20* After each constant stands its unit; NAME_length is the number of a list's elements.{}",
        harmless(&model.input.column),
        chain.join(" -> "),
        harmless(&model.output.column),
        lost(model).map_or(String::new(), |lost| format!("\n * The model was {lost}.")),
    )
}

fn identifier(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Writes every number and list below `value` as a constant; `path` is its place, for its unit.
fn constants(text: &mut String, prefix: &str, path: &str, value: &Value, units: &Value) {
    let unit = || match units.get(path).and_then(Value::as_str) {
        Some(unit) => format!(" /* {} */", harmless(unit)),
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
            let _ = writeln!(text, "#define {prefix} {n}{}", unit());
        }
        Value::Bool(_) | Value::Null => {}
    }
}
