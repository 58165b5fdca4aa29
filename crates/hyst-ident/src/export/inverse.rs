//! The example of a compensator in exported Rust source.

use hyst_core::{Activation, Build, CompensatorOptions, Error, Invert, Sampling};

use crate::model::capacity::REFERENCES;
use crate::model::{Base, Model, TEMPERATURE_OF_INVERSE, searched_range};

/// Tolerance of a search in single precision, as a share of the input range; error of a preview, relative to the
/// largest |α u̇|.
const TOLERANCE: f64 = 1e-6;

/// Returns the comment with the code that makes a compensator of the chain, with capacities for this sample period.
pub(super) fn example(model: &Model, period: f64) -> String {
    let made = model
        .compensator(period, &CompensatorOptions::default())
        .and_then(|inverse| Ok((inverse.taps(), hysteresis(model, period, inverse.hysteresis_lead())?)));
    let (taps, hysteresis) = match made {
        Ok((taps, hysteresis)) => (taps, hysteresis),
        Err(why) => return format!("// No drive can be computed for a reference: {why}.\n"),
    };
    let compensator = match hysteresis {
        None => format!("model.compensator::<{taps}>(&sampling, &CompensatorOptions::default())?"),
        Some(_) => {
            format!("model.compensator_with::<_, {taps}>(hysteresis, &sampling, &CompensatorOptions::default())?")
        }
    };
    let hysteresis: String = hysteresis.iter().flatten().map(|line| format!("//   {line}\n")).collect();
    format!(
        "// The drive that makes the actuator follow a reference:\n\
         {hysteresis}\
         //   let inverse = {compensator}; // {taps}: taps of the longest filter at this period\n\
         //   let mut memory = inverse.state();\n\
         //   let mut drive = inverse.reset(&mut memory, &env, reference); // first reference value\n\
         //   drive = inverse.step(&mut memory, &env, reference); // once per period; the drive of inverse.lead() periods earlier\n\
         // If inverse.lead() > 0, pass the reference and env of that many periods ahead to step. Limits limits the drive.\n"
    )
}

/// Returns the code that makes the inverse of an operator; `None` if the chain makes it. `lead` is the preview of the
/// inverse.
fn hysteresis(model: &Model, period: f64, lead: usize) -> Result<Option<Vec<String>>, Error> {
    let [low, high] = searched_range([model.input.low, model.input.high]);
    let range = format!("{low:?}, {high:?}, {:?}", TOLERANCE * (high - low));
    let searched = |search: &str| {
        vec![format!("let hysteresis = InverseHysteresis {{ inverse: {search}?, lead: 0, band: None }};")]
    };
    Ok(match &model.base {
        Base::TdEm(_) => Some(vec![
            format!(
                "let linear = model.hysteresis.band_limited::<{}>({TEMPERATURE_OF_INVERSE:?}, None)?; // temperature of its filter, degC",
                2 * lead + 1
            ),
            "let band = Some((linear.bandwidth_hz(), linear.error()));".into(),
            "let hysteresis = InverseHysteresis { lead: linear.lead(), inverse: linear, band };".into(),
        ]),
        Base::BoucWen(_) => Some(searched(&format!("model.hysteresis.inverse({range})"))),
        Base::Dpm(_) => Some(searched(&format!("Search::new(model.hysteresis.clone(), {range})"))),
        base => {
            let Some(function) = base.activation() else { return Ok(None) };
            let function: Activation<f64> = function.build(&Sampling { period })?;
            if function.invert().is_ok() {
                return Ok(None);
            }
            let references = function.anti_causal::<REFERENCES>(TOLERANCE)?.lead() + 1;
            Some(vec![
                format!(
                    "let preview = model.hysteresis.anti_causal::<{references}>({TOLERANCE:?})?; // {references}: references in the preview"
                ),
                "let hysteresis = InverseHysteresis { lead: preview.lead(), inverse: preview, band: None };".into(),
            ])
        }
    })
}
