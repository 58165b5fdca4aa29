//! Figures of a page: their frames, their data, and tables of small ones.

use std::collections::BTreeMap;

use hyst_ident::diagnose::{Axis, Picture, Role, Style};
use hyst_ident::model::Effect;
use serde_json::Value;

use super::html::{Page, Table, escaped};
use crate::text::short;

/// Maximum number of points of a curve in a figure that also has a table.
const MAX_TABLE_ROWS: usize = 60;
/// Significant digits of plotted numbers.
const DIGITS: i32 = 7;

/// Returns the pictures of one effect, or those without an effect, each with its index in the list.
pub(crate) fn of(pictures: &[Picture], effect: Option<Effect>) -> Vec<(usize, &Picture)> {
    pictures.iter().enumerate().filter(|(_, p)| p.effect == effect).collect()
}

/// Writes the frames of the figures; a script draws the plots into them.
pub(crate) fn write(page: &mut Page, pictures: &[(usize, &Picture)]) {
    if pictures.is_empty() {
        return;
    }
    page.raw("<div class=\"pictures\">");
    for (at, picture) in pictures {
        page.raw(&figure(*at, picture));
    }
    page.raw("</div>");
}

fn figure(at: usize, picture: &Picture) -> String {
    let key: String = picture
        .curves
        .iter()
        .map(|curve| {
            let points = if curve.style == Style::Points { " points" } else { "" };
            let role = role(curve.role);
            format!("<li><span class=\"swatch {role}{points}\"></span>{}</li>", escaped(&curve.name))
        })
        .collect();
    let (title, caption) = (escaped(&picture.title), escaped(&picture.caption));
    format!(
        "<figure data-picture=\"{at}\">\n<figcaption><strong>{title}</strong> {caption}</figcaption>\n<ul class=\"key\">{key}</ul>\n\
        <div class=\"plot\" role=\"img\" aria-label=\"Plot: {title}. {caption}\"></div>\n{}</figure>",
        numbers(picture)
    )
}

fn role(role: Role) -> &'static str {
    match role {
        Role::Measured => "measured",
        Role::Without => "without",
        Role::With => "with",
        Role::Reference => "reference",
    }
}

/// Returns a table of the points of a small picture, or nothing.
fn numbers(picture: &Picture) -> String {
    let few = |p: &Picture| p.curves.iter().all(|c| c.x.len() <= MAX_TABLE_ROWS);
    if !few(picture) {
        return String::new();
    }
    // Sort key: the bits of x. Bits of positive numbers are in order already. Bits of negative numbers are mapped to
    // that order.
    let key = |x: f64| {
        let bits = x.to_bits() as i64;
        if bits < 0 { i64::MIN - bits } else { bits }
    };
    let mut rows: BTreeMap<i64, (f64, Vec<Option<f64>>)> = BTreeMap::new();
    for (i, curve) in picture.curves.iter().enumerate() {
        for (x, y) in curve.x.iter().zip(&curve.y) {
            let row = rows.entry(key(*x)).or_insert_with(|| (*x, vec![None; picture.curves.len()]));
            if let Some(cell) = row.1.get_mut(i) {
                *cell = Some(*y);
            }
        }
    }
    let axis = |a: &Axis| if a.unit.is_empty() { a.label.clone() } else { format!("{} [{}]", a.label, a.unit) };
    let mut table =
        picture.curves.iter().fold(Table::new(&axis(&picture.y)).words(&axis(&picture.x)), |t, c| t.numbers(&c.name));
    for (x, values) in rows.into_values() {
        let cells = values.into_iter().map(|v| v.map_or_else(String::new, short));
        table.row(&std::iter::once(short(x)).chain(cells).collect::<Vec<_>>());
    }
    format!("<details><summary>Numbers</summary>{}</details>\n", table.html())
}

/// Returns the data of all pictures as JSON, for the script.
pub(crate) fn data(pictures: &[Picture]) -> serde_json::Result<String> {
    let mut all = serde_json::to_value(pictures)?;
    round(&mut all);
    serde_json::to_string(&all)
}

/// Rounds all numbers to [`DIGITS`] significant digits.
fn round(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(round),
        Value::Object(fields) => fields.values_mut().for_each(round),
        Value::Number(number) => {
            if let Some(x) = number.as_f64().filter(|x| *x != 0.0) {
                let unit = 10f64.powi(DIGITS - 1 - x.abs().log10().floor() as i32);
                let rounded = (x * unit).round() / unit;
                if rounded.is_finite() {
                    *value = rounded.into();
                }
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plotted_numbers_are_rounded() {
        let mut value = serde_json::json!({ "x": [1.234_567_891, -0.000_123_456_789_1, 0.0, null, 7], "name": "a" });
        round(&mut value);
        assert_eq!(value.to_string(), r#"{"name":"a","x":[1.234568,-0.0001234568,0.0,null,7.0]}"#);
    }
}
