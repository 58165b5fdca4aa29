//! Every number in a model file has a unit, found by its path. Tested with models of every kind and every stage.

use std::collections::BTreeMap;

use hyst_core::{Kind, OperatorParams, Params};
use hyst_ident::model::Model;
use hyst_tests::{every_stage, root};
use serde_json::Value;

/// Collects the paths of the numbers below `value`, with the count of numbers at each path; a list has one path.
fn leaves(value: &Value, path: &str, found: &mut BTreeMap<String, usize>) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                leaves(value, &if path.is_empty() { key.clone() } else { format!("{path}.{key}") }, found);
            }
        }
        Value::Array(list) => {
            let numbers = list.iter().filter(|item| item.is_number()).count();
            assert_eq!(numbers, list.len(), "{path} is a list of numbers");
            if numbers > 0 {
                found.insert(path.to_owned(), numbers);
            }
        }
        Value::Number(_) => {
            found.insert(path.to_owned(), 1);
        }
        Value::String(_) | Value::Bool(_) | Value::Null => {}
    }
}

/// Returns the tested models: one of every kind from the papers, an envelope of the other form, and one with every
/// stage.
fn models() -> Vec<(String, Model)> {
    let mut texts: Vec<(String, String)> = Kind::ALL
        .map(|kind| {
            let file = root().join(format!("docs/models/{kind}.json"));
            (kind.to_string(), std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display())))
        })
        .into();
    let mut gpi: Value = serde_json::from_str(&texts[1].1).unwrap();
    gpi["stages"][0]["right"] =
        serde_json::json!({ "tanh": { "height": 200.0, "rate": 0.01, "shift": 0.0, "offset": 1.0 } });
    texts.push(("gpi with a tanh".into(), gpi.to_string()));
    texts.push(("every stage".into(), every_stage(&texts[0].1)));
    texts.into_iter().map(|(name, text)| (name.clone(), Model::parse(&name, &text).unwrap())).collect()
}

#[test]
fn every_number_has_a_unit_and_every_unit_a_number() {
    let mut seen = 0;
    for (name, model) in models() {
        for stage in model.stages() {
            let Value::Object(mut stage) = stage else { panic!("{name}: {stage}") };
            let title = stage.remove("stage").unwrap();
            let units = stage.remove("units").unwrap();
            let mut numbers = BTreeMap::new();
            leaves(&Value::Object(stage), "", &mut numbers);
            let units: BTreeMap<String, String> = serde_json::from_value(units).unwrap();
            let (of_numbers, of_units): (Vec<_>, Vec<_>) = (numbers.keys().collect(), units.keys().collect());
            assert_eq!(of_numbers, of_units, "{name}, stage {title}");
            for (path, unit) in &units {
                let parts = unit.split(", ").count();
                assert!(!unit.is_empty() && [1, numbers[path]].contains(&parts), "{name}, {title}, {path}: {unit:?}");
                // The units are those of the model's quantities, not the symbols u and y of the library.
                assert!(unit.split(|c: char| !c.is_alphanumeric()).all(|word| !["u", "y"].contains(&word)), "{unit}");
            }
            seen += 1;
        }
    }
    assert!(seen >= 16 + 2 + 12, "{seen} stages");
}

/// The optimiser uses the parameter names of the operator's JSON, also for `viscous-pi`, which the file has as two
/// stages.
#[test]
fn parameter_names_of_operators_are_their_json_paths() {
    for (name, model) in models() {
        let mut operator = model.base.clone();
        let Value::Object(outer) = serde_json::to_value(&operator).unwrap() else { panic!("{name}") };
        let mut numbers = BTreeMap::new();
        outer.values().for_each(|fields| leaves(fields, "", &mut numbers));
        operator.visit(&mut |meta, _| match numbers.get_mut(meta.name) {
            Some(remaining) if *remaining > 0 => *remaining -= 1,
            _ => panic!("{name}: {} is not a number of the operator, or occurs too often", meta.name),
        });
        numbers.retain(|_, remaining| *remaining > 0);
        // Sizes and conventions are given, not optimised.
        let given = ["cells", "plays", "rates", "changes", "reference_degc", "per_metre"];
        assert!(numbers.keys().all(|path| given.contains(&path.rsplit('.').next().unwrap())), "{name}: {numbers:?}");
    }
    assert!(models().iter().any(|(_, model)| matches!(model.base, OperatorParams::ViscousPi(_))));
}
