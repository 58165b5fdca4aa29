//! A model as Rust source.

use std::fmt;

use hyst_core::ChainParams;
use serde::{Deserialize, Serialize};

use super::{harmless, inverse, lost, origin};
use crate::model::{Base, Model};

/// A list of numbers that is printed as a slice in Rust source.
#[derive(Serialize, Deserialize)]
struct Slice(Vec<f64>);

impl fmt::Debug for Slice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Always on one line, because lists may have hundreds of numbers.
        write!(f, "&{:?}", self.0)
    }
}

/// Returns the type of the operator in Rust source, with exactly the needed capacity, and the context of its `build`.
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

/// Returns the capacity for the dead time of a model at a sample period \[samples\], including the two samples that
/// every delay needs.
fn dead_time(model: &Model, period: f64) -> usize {
    let of_the_drive = model.effects.delay.map_or(0.0, |p| p.seconds);
    let of_the_operator = if let Base::Ifm(p) = &model.base { p.tau } else { 0.0 };
    ((of_the_drive.max(of_the_operator) / period).ceil() as usize + 2).next_power_of_two().max(32)
}

/// Returns Rust source: constants for `hyst-core`, and the function that builds the chain from them.
pub fn rust(model: &Model) -> String {
    // The conversion through JSON maps the lists of all kinds of parameters. It cannot fail, because the types are the
    // same.
    let params: Option<ChainParams<Slice>> =
        serde_json::to_value(model.to_params()).ok().and_then(|v| serde_json::from_value(v).ok());
    let Some(params) = params else { return String::new() };
    let operator = match params.operator.activation() {
        Some((kind, p)) => format!("(ActivationKind, ActivationParams) = (ActivationKind::{kind:?}, {p:?})"),
        None => {
            let text = format!("{:?}", params.operator);
            // `Pi(PiParams { … })`: the first word inside is the type of the parameters.
            let inner = text.find('(').map_or("", |at| &text[at + 1..text.len() - 1]);
            let name = inner.split([' ', '{']).next().unwrap_or_default();
            let list = if inner.contains("&[") { "<&[f64]>" } else { "" };
            format!("{name}{list} = {inner}")
        }
    };
    let (operator_type, context) = operator_type(&model.base);
    let creep = model.effects.creep.as_ref().map_or(1, |c| c.seconds.len().max(1));
    let period = 1.0 / model.recorded_at_hz;
    let mut surroundings = String::new();
    if model.needs_temperature() {
        surroundings += "// The model depends on temperature: set env.temperature [degC] at every sample.\n";
    }
    if model.needs_load() {
        surroundings += "// The model depends on load: set env.load [N] at every sample.\n";
    }
    if let Some(lost) = lost(model) {
        surroundings += &format!("// The model was {lost}.\n");
    }
    format!(
        "// Written by hystctl {version}. {origin}\n\
         //\n\
         // The predicted output of a drive:\n\
         //   let sampling = Sampling {{ period: {period:?} }}; // your sample period, s\n\
         //   let model = chain::<f32, {dead_time}>(&sampling)?; // {dead_time}: capacity for the dead time in samples, plus 2\n\
         //   let mut state = model.state();\n\
         //   let mut y = model.reset(&mut state, &env, INPUT[0] as f32); // env: hyst_core::Env\n\
         //   y = model.step(&mut state, &env, drive); // once per period\n\
         //\n\
         {inverse}\
         {surroundings}\
         #[allow(unused_imports)]\n\
         use hyst_core::{{*, Curve::*, CurveSide::*, GlOrder::*, RateLaw::*, SlipReading::*}};\n\
         \n\
         /// The base model.\n\
         pub const OPERATOR: {operator};\n\
         /// The effects.\n\
         pub const EFFECTS: EffectParams<&[f64]> = {effects:?};\n\
         /// Whether the output falls when the base model rises.\n\
         pub const FALLS: bool = {falls};\n\
         /// The sensor zero: reading at rest [{unit}].\n\
         pub const ZERO: f64 = {zero:?};\n\
         /// Minimum and maximum input that the model was identified on [{input}].\n\
         pub const INPUT: [f64; 2] = {range:?};\n\
         \n\
         /// Builds the model for a sample period, in `f32` or `f64`, with a dead time of up to `D - 2` samples.\n\
         ///\n\
         /// # Errors\n\
         /// If the parameters do not allow the sample period, or the dead time is longer than `D - 2` samples.\n\
         pub fn chain<T: Real, const D: usize>(\n    sampling: &Sampling,\n) -> Result<Chain<T, {operator_type}, D, {creep}>, Error> {{\n    \
         let hysteresis: {operator_type} = OPERATOR.build({context})?;\n    \
         Ok(EFFECTS.around(hysteresis, sampling)?.with_falling(FALLS).with_zero(ZERO))\n\
         }}\n",
        version = env!("CARGO_PKG_VERSION"),
        origin = origin(model),
        effects = params.effects,
        falls = params.falls,
        zero = params.zero,
        range = params.input,
        period = period,
        dead_time = dead_time(model, period),
        inverse = inverse::example(model, period),
        unit = harmless(model.output.symbol()),
        input = harmless(model.input.symbol()),
    )
}
