//! A model as a C header.

use std::fmt::Write as _;
use std::str::FromStr;

use hyst_core::BlockError;
use serde_json::Value;

use super::{block, harmless, lost, origin, words};
use crate::model::Model;

/// The prefix of the symbols of a C header. Macros have it in upper case.
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

    /// Replaces characters that C identifiers cannot have by `_`.
    fn from_str(name: &str) -> Result<Self, String> {
        // C reserves identifiers that begin with `_`.
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return Err(
                "it is the prefix of C symbols and must begin with a letter from a to z, for example x_axis".into()
            );
        }
        Ok(Self(identifier(name)))
    }
}

/// Returns a C99 header with the parameter block and every parameter as a constant with its unit.
///
/// A program can include the headers of several models with different names. The compiler refuses a second model with
/// the same name.
///
/// # Errors
/// Those of [`block`].
pub fn c(model: &Model, CName(name): &CName) -> Result<String, BlockError> {
    let bytes = block(model)?;
    let macros = name.to_ascii_uppercase();
    // The checksum of the block distinguishes two models.
    let sum: String = bytes.iter().rev().take(4).map(|byte| format!("{byte:02x}")).collect();
    let mut text = format!(
        "/* Written by hystctl {}. {}\n *\n\
         {} */\n#ifndef {macros}_MODEL_H\n#define {macros}_MODEL_H\n#define {macros}_MODEL_SUM 0x{sum}u\n\n\
         #include <stdint.h>\n\n#define {macros}_KIND \"{}\"\n\n/* Parameter block for hyst_core::read_block. */\n\
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
    let _ = writeln!(text, "\n/* Sensor zero (reading at rest): added to the output of the last stage. */");
    let _ = writeln!(text, "static const double {name}_zero = {:?}; /* {output} */", model.zero);
    if model.falls {
        let _ =
            writeln!(text, "/* The output falls when the input rises: the output of the hysteresis H is y = -H(u). */");
    }
    let _ = writeln!(text, "/* Input range that the model was identified on. */");
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
        // The constants of a second mode need other names.
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

/// Returns the comment about the contents of a header: the block, and the chain of the constants.
fn about(model: &Model, name: &str) -> String {
    let stages = model.stages();
    let chain: Vec<&str> = stages.iter().filter_map(|stage| stage.get("stage")?.as_str()).collect();
    format!(
        " * {name}_block is for Rust firmware: hyst_core::read_block (feature block) builds the model from it.\n\
         \x20* The constants are for your own code: {} -> {} -> + {name}_zero -> {},\n\
         \x20* stage by stage below. In each stage, u is the input and y the output. No constant depends on the sample period.\n\
         \x20* The unit follows each constant. NAME_length is the number of elements of a list.{}",
        harmless(&model.input.column),
        chain.join(" -> "),
        harmless(&model.output.column),
        lost(model).map_or(String::new(), |lost| format!("\n * The model was {lost}.")),
    )
}

fn identifier(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Writes every number and list below `value` as a constant. `path` is the place of `value`, by which its unit is
/// found.
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
