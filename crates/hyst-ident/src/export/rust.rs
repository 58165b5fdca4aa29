//! A model as Rust source.

use std::fmt;

use hyst_core::ChainParams;
use serde::{Deserialize, Serialize};

use super::{harmless, inverse, lost, origin};
use crate::model::{Base, Model};

/// A list of numbers that prints itself as a slice in Rust source.
#[derive(Serialize, Deserialize)]
struct Slice(Vec<f64>);

impl fmt::Debug for Slice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // In one line whatever the style: a list of hundreds would fill pages.
        write!(f, "&{:?}", self.0)
    }
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

/// Room for the dead time of a model at a sample period, and for the two samples that every delay takes.
fn dead_time(model: &Model, period: f64) -> usize {
    let of_the_drive = model.effects.delay.map_or(0.0, |p| p.seconds);
    let of_the_operator = if let Base::Ifm(p) = &model.base { p.tau } else { 0.0 };
    ((of_the_drive.max(of_the_operator) / period).ceil() as usize + 2).next_power_of_two().max(32)
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
    let period = 1.0 / model.recorded_at_hz;
    let mut surroundings = String::new();
    if model.needs_temperature() {
        surroundings += "// The model follows temperature: set env.temperature [degC] at every sample.\n";
    }
    if model.needs_load() {
        surroundings += "// The model yields under load: set env.load [N] at every sample.\n";
    }
    if let Some(lost) = lost(model) {
        surroundings += &format!("// The model was {lost}.\n");
    }
    format!(
        "// Written by hystctl {version}. {origin}\n\
         //\n\
         // What it says of a drive:\n\
         //   let sampling = Sampling {{ period: {period:?} }}; // s, yours\n\
         //   let model = chain::<f32, {dead_time}>(&sampling)?; // {dead_time}: samples of dead time that it has room for, and 2\n\
         //   let mut state = model.state();\n\
         //   let mut y = model.reset(&mut state, &env, INPUT[0] as f32); // env: hyst_core::Env\n\
         //   y = model.step(&mut state, &env, drive); // every period\n\
         //\n\
         {inverse}\
         {surroundings}\
         #[allow(unused_imports)]\n\
         use hyst_core::{{*, Curve::*, CurveSide::*, GlOrder::*, RateLaw::*, SlipReading::*}};\n\
         \n\
         /// The memory operator.\n\
         pub const OPERATOR: {operator};\n\
         /// The stages around it.\n\
         pub const EFFECTS: EffectParams<&[f64]> = {effects:?};\n\
         /// Whether the output falls where the operator rises.\n\
         pub const FALLS: bool = {falls};\n\
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
