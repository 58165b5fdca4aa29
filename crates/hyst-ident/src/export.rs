//! `export`: a model's parameters for a board, as a block of bytes, as Rust source, as a C header.

use std::fmt;
use std::fmt::Write as _;
use std::str::FromStr;

use hyst_core::{BlockError, ChainParams, write_block};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::model::{Base, FittedOn, Model};

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

/// Text of the model file for a comment: what could end the comment or its line is left out.
fn harmless(text: &str) -> String {
    text.replace("*/", "").chars().filter(|c| !c.is_control()).collect()
}

fn origin(model: &Model) -> String {
    let of_file = |f: &FittedOn| match f.sha256.as_str() {
        "" => f.file.clone(),
        sum => format!("{} (sha256 {sum})", f.file),
    };
    let files: Vec<String> = model.fitted_on.iter().map(of_file).collect();
    let from = if files.is_empty() { String::new() } else { format!(", fitted on {}", files.join(", ")) };
    harmless(&format!(
        "Parameters of the model {}, input {} [{}], output {} [{}]{from}.",
        model.base.kind(),
        model.input.column,
        model.input.unit,
        model.output.column,
        model.output.unit
    ))
}

/// The operator's type in Rust source, with room for exactly what the model has, and what it is built for.
fn operator_type(base: &Base) -> (String, &'static str) {
    let plays = |list: &[f64]| list.len().max(1);
    match base {
        Base::Pi(p) => (format!("Pi<T, {}>", plays(&p.thresholds)), "&()"),
        Base::ViscousPi(p) => (format!("ViscousPi<T, {}>", plays(&p.pi.thresholds)), "sampling"),
        Base::Gpi(p) => (format!("Gpi<T, {}>", plays(&p.thresholds)), "&()"),
        Base::TdPi(p) => (format!("TdPi<T, {}>", p.plays.max(1)), "&()"),
        Base::MaxwellSlip(p) => (format!("MaxwellSlip<T, {}>", plays(&p.widths)), "&()"),
        Base::TdEm(p) => (format!("TdEm<T, {}>", plays(&p.slip.widths)), "sampling"),
        Base::Preisach(p) => (format!("Everett<T, {}>", p.cells + 1), "&()"),
        Base::Dpm(p) => {
            (format!("Dpm<T, {}, {}, {}>", p.preisach.cells + 1, p.mirror.rates, p.mirror.changes), "sampling")
        }
        Base::Lfdm(_) => ("Lfdm<T, Exponentials<T, 40>>".into(), "sampling"),
        Base::Ifm(_) => ("Ifm<T, Exponentials<T, 40>, D>".into(), "sampling"),
        Base::BoucWen(_) => ("BoucWen<T>".into(), "&()"),
        Base::BoucWenOscillator(_) => ("BoucWenOscillator<T>".into(), "sampling"),
        Base::Atan(_) | Base::Sigmoid(_) | Base::Softplus(_) | Base::Softsign(_) | Base::Tanh(_) => {
            ("Activation<T>".into(), "sampling")
        }
    }
}

/// Rust source: constants for `hyst-core`, and the function that builds the chain of them.
pub fn rust(model: &Model) -> String {
    // Through JSON, because that maps the lists of every kind of parameters at once. It cannot fail: these are the same types.
    let params: Option<ChainParams<Slice>> =
        serde_json::to_value(model.to_params()).ok().and_then(|v| serde_json::from_value(v).ok());
    let Some(params) = params else { return String::new() };
    let operator = match params.operator.activation() {
        Some((kind, p)) => format!("(ActivationKind, ActivationParams) = (ActivationKind::{kind:?}, {p:?})"),
        None => {
            let text = format!("{:?}", params.operator);
            // `Pi(PiParams { … })`: the type of what is inside is its first word.
            let inner = text.find('(').map_or("", |at| &text[at + 1..text.len() - 1]);
            let name = inner.split([' ', '{']).next().unwrap_or_default();
            let list = if inner.contains("&[") { "<&[f64]>" } else { "" };
            format!("{name}{list} = {inner}")
        }
    };
    let (operator_type, context) = operator_type(&model.base);
    let creep = model.effects.creep.as_ref().map_or(1, |c| c.seconds.len().max(1));
    let mut surroundings = String::new();
    if model.needs_temperature() {
        surroundings += "//   The model follows temperature: set env.temperature [degC] at every sample.\n";
    }
    if model.needs_load() {
        surroundings += "//   The model yields under load: set env.load [N] at every sample.\n";
    }
    format!(
        "// Written by hystctl {version}. {origin}\n\
         //\n\
         //   let model = chain::<f32, 32>(&Sampling {{ period: 1e-3 }})?; // 32: samples of dead time that it has room for, and 2\n\
         //   let mut state = model.state();\n\
         //   let mut y = model.reset(&mut state, &env, INPUT[0] as f32); // env: hyst_core::Env\n\
         //   y = model.step(&mut state, &env, drive);                    // every period\n\
         {surroundings}\
         #[allow(unused_imports)]\n\
         use hyst_core::{{*, Curve::*, GlOrder::*, SlipReading::*}};\n\
         \n\
         /// The memory operator.\n\
         pub const OPERATOR: {operator};\n\
         /// The stages around it.\n\
         pub const EFFECTS: EffectParams<&[f64]> = {effects:?};\n\
         /// What the sensor shows at rest [{unit}].\n\
         pub const ZERO: f64 = {zero:?};\n\
         /// Inputs that the model was identified on, lowest and highest [{input}].\n\
         pub const INPUT: [f64; 2] = {range:?};\n\
         \n\
         /// The model at a sample period, in `f32` or `f64`; `D - 2` samples of dead time fit.\n\
         ///\n\
         /// # Errors\n\
         /// If the sample period does not suit the parameters, or the dead time does not fit.\n\
         pub fn chain<T: Real, const D: usize>(\n    sampling: &Sampling,\n) -> Result<Chain<T, {operator_type}, D, {creep}>, Error> {{\n    \
         let hysteresis: {operator_type} = OPERATOR.build({context})?;\n    \
         Ok(EFFECTS.around(hysteresis, sampling)?.with_zero(ZERO))\n\
         }}\n",
        version = env!("CARGO_PKG_VERSION"),
        origin = origin(model),
        effects = params.effects,
        zero = params.zero,
        range = params.input,
        unit = harmless(&model.output.unit),
        input = harmless(&model.input.unit),
    )
}

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
        "/* Written by hystctl {}. {} */\n#ifndef {macros}_MODEL_H\n#define {macros}_MODEL_H\n#define {macros}_MODEL_SUM 0x{sum}u\n\n\
         #include <stdint.h>\n\n#define {macros}_KIND \"{}\"\n\n/* What hyst_core::read_block reads. */\n\
         static const uint8_t {name}_block[{}] = {{",
        env!("CARGO_PKG_VERSION"),
        origin(model),
        model.base.kind(),
        bytes.len()
    );
    for (i, byte) in bytes.iter().enumerate() {
        let _ = write!(text, "{}0x{byte:02x},", if i % 16 == 0 { "\n    " } else { " " });
    }
    text += "\n};\n";
    let (input, output) = (harmless(&model.input.unit), harmless(&model.output.unit));
    let _ = writeln!(text, "\nstatic const double {name}_zero = {:?}; /* {output} */", model.zero);
    let _ = writeln!(text, "static const double {name}_input_low = {:?}; /* {input} */", model.input.low);
    let _ = writeln!(text, "static const double {name}_input_high = {:?}; /* {input} */", model.input.high);
    let mut modes = 0;
    for stage in model.stages() {
        let Value::Object(mut stage) = stage else { continue };
        let title = stage.remove("stage").and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default();
        let units = stage.remove("units").unwrap_or_default();
        stage.remove("std_errors");
        stage.remove("undetermined");
        let _ = writeln!(text, "\n/* {title} */");
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
