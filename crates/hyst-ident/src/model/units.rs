//! The units of the numbers of a stage, by their paths in the file.

use std::collections::BTreeMap;

use hyst_core::{Error, Params};
use serde_json::{Map, Value};

use super::{Base, Channel};
use crate::record::OutputUnit;

/// Replaces `u` and `y` in `unit` by the units of the model.
fn unit(unit: &str, input: &str, output: &str) -> String {
    if unit.is_empty() {
        return "1".into();
    }
    let words = unit.split_inclusive(|c: char| !c.is_alphanumeric());
    let mut text = String::new();
    for word in words {
        let (name, rest) = word.split_at(word.trim_end_matches(|c: char| !c.is_alphanumeric()).len());
        text += match name {
            "u" => input,
            "y" => output,
            other => other,
        };
        text += rest;
    }
    text
}

/// Returns the unit of a number that is given and never searched. `Params::visit` does not visit such numbers.
fn of_given(field: &str) -> Option<&'static str> {
    Some(match field {
        "reference_degc" => "degC",
        "reference_rate" => "u/s",
        "growth" => "",
        "since_s" => "s",
        "per_metre" => "y/m",
        "cells" | "plays" | "rates" | "changes" => "",
        _ => return None,
    })
}

/// Calls `f` with the path of every number and of every list of numbers.
fn paths(fields: &Value, path: &str, f: &mut dyn FnMut(&str)) {
    match fields {
        Value::Object(fields) => {
            for (key, value) in fields {
                paths(value, &if path.is_empty() { key.clone() } else { format!("{path}.{key}") }, f);
            }
        }
        Value::Array(list) if list.iter().any(Value::is_number) => f(path),
        Value::Number(_) => f(path),
        _ => {}
    }
}

/// Returns the unit of every number of a stage, by its path.
///
/// A list has one unit. If its elements have different units, these are listed in order, separated by commas.
pub(super) fn of(fields: &Value, params: &mut dyn Params, input: &str, output: &str) -> Map<String, Value> {
    let mut visited: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    params.visit(&mut |meta, _| visited.entry(meta.name).or_default().push(meta.unit));
    let mut units = Map::new();
    for (path, each) in &mut visited {
        if each.iter().all(|unit| Some(unit) == each.first()) {
            each.truncate(1);
        }
        let words: Vec<String> = each.iter().map(|of| unit(of, input, output)).collect();
        units.insert((*path).to_owned(), words.join(", ").into());
    }
    paths(fields, "", &mut |path| {
        let field = path.rsplit('.').next().unwrap_or(path);
        if let Some(given) = of_given(field) {
            units.insert(path.to_owned(), unit(given, input, output).into());
        }
    });
    units
}

/// Refuses a base model that states a unit of its output other than that of the model.
///
/// # Errors
/// [`Error::OutOfRange`] with the field and what it must be.
pub(super) fn agree(base: &Base, output: &Channel) -> Result<(), Error> {
    let Base::TdEm(p) = base else { return Ok(()) };
    let (per_metre, must) = match OutputUnit::of_column(&output.column) {
        Some(OutputUnit::Micrometre) => (1e6, "1e6, because the output is in um"),
        Some(OutputUnit::Nanometre) => (1e9, "1e9, because the output is in nm"),
        Some(OutputUnit::Millimetre) => (1e3, "1e3, because the output is in mm"),
        Some(OutputUnit::Newton) | None => {
            let must = "displacement_um, displacement_nm or displacement_mm, because td-em gives a displacement";
            return Err(Error::OutOfRange { name: "output.column", must });
        }
    };
    if p.per_metre == per_metre { Ok(()) } else { Err(Error::OutOfRange { name: "td-em.per_metre", must }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Effects, Ends, Model};
    use hyst_core::TdEmParams;
    use serde_json::json;

    #[test]
    fn units_of_the_model_are_inserted() {
        assert_eq!(unit("y/u", "V", "um"), "um/V");
        assert_eq!(unit("u s/y", "V", "um"), "V s/um");
        assert_eq!(unit("1/u", "V", "um"), "1/V");
        assert_eq!(unit("", "V", "um"), "1");
        assert_eq!(unit("Hz", "V", "um"), "Hz");
    }

    #[test]
    fn a_list_has_one_unit_or_one_per_element() {
        let mut params = TdEmParams::PRINTED;
        let fields = json!({ "slip": { "widths": [1.0], "gains": [1.0], "reading": "backlash" }, "per_metre": 1e6, "empty": [] });
        let units = Value::Object(of(&fields, &mut params, "V", "um"));
        let expected = json!({
            "slip.widths": "V", "slip.gains": "A/V", "capacitance": "F", "resistance": "Ohm", "mass": "kg", "stiffness": "N/m",
            "damping": "N s/m", "coupling": "N/V, N/(V K), N/(V K^2)", "per_metre": "um/m",
        });
        assert_eq!(units, expected);
    }

    #[test]
    fn an_output_in_another_unit_is_named() {
        let printed = serde_json::to_value(TdEmParams::PRINTED).unwrap();
        let printed: TdEmParams<Vec<f64>> = serde_json::from_value(printed).unwrap();
        let model = |per_metre, output| {
            let ends = Ends {
                input_column: "voltage_v".into(),
                input: (-200.0, 200.0),
                output,
                output_range: None,
                rate_hz: 5000.0,
            };
            Model::from_parameters(Base::TdEm(TdEmParams { per_metre, ..printed.clone() }), Effects::default(), &ends)
        };
        let units = [OutputUnit::Micrometre, OutputUnit::Nanometre, OutputUnit::Millimetre];
        let sizes = [1e6, 1e9, 1e3];
        for (unit, size) in units.into_iter().zip(sizes) {
            let file = model(size, unit).unwrap();
            assert_eq!(Model::parse("file", &file.to_json()).unwrap(), file);
            // Including metres.
            for other in [1.0, 1e3, 1e6, 1e9, f64::NAN].into_iter().filter(|other| *other != size) {
                let why = model(other, unit).unwrap_err();
                assert!(matches!(why, Error::OutOfRange { name: "td-em.per_metre", .. }), "{why}");
                let Base::TdEm(p) = &file.base else { panic!("{file:?}") };
                let wrong = Model { base: Base::TdEm(TdEmParams { per_metre: other, ..p.clone() }), ..file.clone() };
                if other.is_finite() {
                    let message = Model::parse("file", &wrong.to_json()).unwrap_err().to_string();
                    let expected =
                        format!("td-em.per_metre must be {size:e}, because the output is in {}", unit.suffix());
                    assert!(message.contains(&expected), "{message}");
                }
            }
        }
        let force = model(1e6, OutputUnit::Newton).unwrap_err();
        assert!(matches!(force, Error::OutOfRange { name: "output.column", .. }), "{force}");
    }
}
