//! How exported Rust source says that its model is inverted.

use hyst_core::{Activation, Build, CompensatorOptions, Error, Invert, Sampling};

use crate::model::capacity::REFERENCES;
use crate::model::{Base, Model, TEMPERATURE_OF_INVERSE, searched_range};

/// How near a search in single precision comes to the drive, as a share of the range; what a preview may miss, of the largest |α u̇|.
const TOLERANCE: f64 = 1e-6;

/// The lines of the comment that make a compensator of the chain, with room for what it takes at this sample period.
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
         //   let inverse = {compensator}; // {taps}: taps of its longest filter at this period\n\
         //   let mut memory = inverse.state();\n\
         //   let mut drive = inverse.reset(&mut memory, &env, reference); // its first value\n\
         //   drive = inverse.step(&mut memory, &env, reference); // every period; for inverse.lead() periods earlier than this\n\
         // With inverse.lead() > 0 give step the reference, and env, of so many periods ahead. Limits keeps a drive in bounds.\n"
    )
}

/// The lines that make the inverse of an operator that does not choose it itself; `None` if it does. `lead` is its preview.
fn hysteresis(model: &Model, period: f64, lead: usize) -> Result<Option<Vec<String>>, Error> {
    let [low, high] = searched_range([model.input.low, model.input.high]);
    let range = format!("{low:?}, {high:?}, {:?}", TOLERANCE * (high - low));
    let searched = |search: &str| {
        vec![format!("let hysteresis = InverseHysteresis {{ inverse: {search}?, lead: 0, band: None }};")]
    };
    Ok(match &model.base {
        Base::TdEm(_) => Some(vec![
            format!(
                "let linear = model.hysteresis.band_limited::<{}>({TEMPERATURE_OF_INVERSE:?}, None)?; // degC that its filter is for",
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
                    "let preview = model.hysteresis.anti_causal::<{references}>({TOLERANCE:?})?; // {references}: references that it looks over"
                ),
                "let hysteresis = InverseHysteresis { lead: preview.lead(), inverse: preview, band: None };".into(),
            ])
        }
    })
}
