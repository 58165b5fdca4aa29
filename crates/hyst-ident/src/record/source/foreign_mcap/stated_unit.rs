//! Units in comments and descriptions.

use crate::record::heading::Unit;

/// Largest number of characters of an unknown unit in square brackets.
const MAX_UNKNOWN: usize = 16;

/// Returns the unit that a text states, as it is written there.
///
/// Recognised are `V`, `drive voltage [V]`, `position (µm)` and `temperature in degrees Celsius`.
pub(crate) fn stated_unit(text: &str) -> Option<String> {
    let text = text.trim().trim_end_matches(['.', ';', ',']);
    let square = inside(text, '[', ']');
    // The (s) of "sample(s)" is not a unit.
    let round = inside(text, '(', ')').filter(|_| text.contains(" (") || text.starts_with('('));
    let behind = |word: &str| text.rsplit_once(word).map(|(_, unit)| unit.trim());
    // "min" alone means minimum, not minutes.
    let whole = Some(text).filter(|text| !text.eq_ignore_ascii_case("min"));
    let candidates = [square, round, behind(" in "), behind(", "), behind(": "), whole];
    let found = candidates.into_iter().flatten().find_map(known);
    // A text in square brackets is a unit even if it is not known. Other unknown words are not.
    let is_unit =
        |unit: &&str| !unit.is_empty() && unit.chars().count() <= MAX_UNKNOWN && !unit.contains([' ', ',', '=']);
    found.or_else(|| square.filter(is_unit)).map(str::to_owned)
}

/// Returns the text in the last brackets.
fn inside(text: &str, open: char, close: char) -> Option<&str> {
    Some(text.rsplit_once(open)?.1.split_once(close)?.0.trim())
}

/// Returns the unit, if it is known.
fn known(text: &str) -> Option<&str> {
    let text = text.strip_prefix("degrees ").or_else(|| text.strip_prefix("Degrees ")).unwrap_or(text);
    Unit::parse(text).map(|_| text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_in_comments() {
        let of = |text| stated_unit(text).unwrap_or_default();
        assert_eq!(of("V"), "V");
        assert_eq!(of("drive voltage [V]"), "V");
        assert_eq!(of("[mV] of the amplifier"), "mV");
        assert_eq!(of("Position (µm)."), "µm");
        assert_eq!(of("position in nm"), "nm");
        assert_eq!(of("[furlong]"), "furlong");
        assert_eq!(of("Measurement of the Temperature in Degrees Celsius"), "Celsius");
        assert_eq!(of("number of sample(s)"), "");
        assert_eq!(of("deprecated"), "");
        assert_eq!(of("one of [1, 2]"), "");
        assert_eq!(of("in use (since 2020)"), "");
    }
}
