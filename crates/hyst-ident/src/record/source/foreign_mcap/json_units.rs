//! Units in a JSON schema.

use std::collections::HashMap;

use serde_json::{Map, Value};

use super::stated_unit::stated_unit;

/// Largest schema that is searched for units \[bytes\].
const MAX_SIZE: usize = 1 << 20;
/// Largest number of parts of a schema that are searched. References can make a schema infinite.
const MAX_PARTS: usize = 10_000;
/// Deepest nesting of fields.
const MAX_DEPTH: usize = 16;

/// Returns the units by path, with `[]` for an index.
pub(crate) fn units(schema: &[u8]) -> HashMap<String, String> {
    let schema =
        Some(schema).filter(|schema| schema.len() <= MAX_SIZE).and_then(|schema| serde_json::from_slice(schema).ok());
    let Some(root) = schema else { return HashMap::new() };
    let mut search = Search { root: &root, parts: 0, units: HashMap::new() };
    search.part(&root, "", MAX_DEPTH);
    search.units
}

struct Search<'a> {
    root: &'a Value,
    parts: usize,
    units: HashMap<String, String>,
}

impl Search<'_> {
    /// Searches a part of the schema and its subparts.
    fn part(&mut self, part: &Value, path: &str, depth: usize) {
        self.parts += 1;
        let Some(part) = part.as_object().filter(|_| depth > 0 && self.parts <= MAX_PARTS) else { return };
        if let Some(unit) = unit(part) {
            self.units.entry(path.to_owned()).or_insert_with(|| unit.clone());
            // The unit of an array applies to its elements.
            self.units.entry(format!("{path}[]")).or_insert(unit);
        }
        let root = self.root;
        if let Some(at) = part.get("$ref").and_then(Value::as_str).and_then(|at| root.pointer(at.strip_prefix('#')?)) {
            self.part(at, path, depth - 1);
        }
        // An optional number is either a number or null.
        for name in ["anyOf", "oneOf", "allOf"] {
            for option in part.get(name).and_then(Value::as_array).into_iter().flatten() {
                self.part(option, path, depth - 1);
            }
        }
        for (name, field) in part.get("properties").and_then(Value::as_object).into_iter().flatten() {
            self.part(field, &format!("{path}.{name}"), depth - 1);
        }
        match part.get("items") {
            Some(Value::Array(items)) => items.iter().for_each(|item| self.part(item, &format!("{path}[]"), depth - 1)),
            Some(item) => self.part(item, &format!("{path}[]"), depth - 1),
            None => {}
        }
    }
}

/// Returns the unit of a field, from the keyword `unit` or `units` or from its description.
fn unit(field: &Map<String, Value>) -> Option<String> {
    let text = |name: &str| field.get(name).and_then(Value::as_str).map(str::trim).filter(|text| !text.is_empty());
    let own = text("unit").or_else(|| text("units")).map(super::words::shortened);
    own.or_else(|| stated_unit(text("description")?))
}
