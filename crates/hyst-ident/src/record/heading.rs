//! Parsing of column headings into words and a unit.
//!
//! `Time (s)`, `Voltage [mV]`, `disp_nm`, `U / V`, `t_ms` and `/group/Position, µm` are recognised. A unit is never
//! assumed.

/// A physical quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dimension {
    Time,
    Voltage,
    Length,
    Force,
    Temperature,
}

/// A unit, with its conversion to the base unit of its dimension: s, V, µm, N, °C.
///
/// Division by `per_base` rounds once if the factor is a whole number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unit {
    pub(crate) dimension: Dimension,
    /// The number of this unit per base unit.
    pub(crate) per_base: f64,
    /// The value in this unit at zero of the base unit; 0 for all units but K and °F.
    pub(crate) zero: f64,
    /// The symbol of the unit.
    pub(crate) symbol: &'static str,
}

impl Unit {
    /// Converts a value to the base unit of the dimension.
    pub(crate) fn to_base(self, value: f64) -> f64 {
        if self.per_base >= 1.0 {
            (value - self.zero) / self.per_base
        } else {
            (value - self.zero) * (1.0 / self.per_base)
        }
    }

    /// Returns the conversion to the unit `other`; `None` if the dimensions differ.
    pub(crate) fn to(self, other: Self) -> Option<impl Fn(f64) -> f64> {
        let same = self.per_base == other.per_base && self.zero == other.zero;
        (self.dimension == other.dimension).then_some(move |value: f64| {
            if same {
                return value;
            }
            let base = self.to_base(value);
            if other.per_base >= 1.0 {
                base * other.per_base + other.zero
            } else {
                base / (1.0 / other.per_base) + other.zero
            }
        })
    }

    /// Parses a unit such as `mV`, `µm`, `um`, `sec`, `°C`. Symbols are case-sensitive: Nm is not nm.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let text = text.trim().trim_matches(['"', '\'']).trim();
        let word = text.chars().count() > 3;
        let is = |name: &str| name == text || word && name.eq_ignore_ascii_case(text);
        UNITS.iter().find(|(names, _)| names.iter().any(|name| is(name))).map(|(_, unit)| *unit)
    }

    /// Parses the lower-case unit at the end of a name such as `voltage_v`.
    pub(crate) fn parse_suffix(text: &str) -> Option<Self> {
        let is = |name: &str| name.to_lowercase() == text && !matches!(text, "min" | "h");
        Self::parse(text)
            .filter(|_| !matches!(text, "min" | "h"))
            .or_else(|| UNITS.iter().find(|(names, _)| names.iter().any(|name| is(name))).map(|(_, unit)| *unit))
    }
}

const fn unit(dimension: Dimension, per_base: f64, symbol: &'static str) -> Unit {
    Unit { dimension, per_base, zero: 0.0, symbol }
}

use Dimension::{Force, Length, Temperature, Time, Voltage};

const UNITS: &[(&[&str], Unit)] = &[
    (&["s", "sec", "secs", "second", "seconds", "sekunden"], unit(Time, 1.0, "s")),
    (&["ms", "msec", "millisecond", "milliseconds"], unit(Time, 1e3, "ms")),
    (&["us", "µs", "μs", "usec", "microsecond", "microseconds"], unit(Time, 1e6, "µs")),
    (&["ns", "nsec", "nanosecond", "nanoseconds"], unit(Time, 1e9, "ns")),
    (&["min", "minute", "minutes"], unit(Time, 1.0 / 60.0, "min")),
    (&["h", "hour", "hours"], unit(Time, 1.0 / 3600.0, "h")),
    (&["V", "volt", "volts"], unit(Voltage, 1.0, "V")),
    (&["mV", "millivolt", "millivolts"], unit(Voltage, 1e3, "mV")),
    (&["uV", "µV", "μV"], unit(Voltage, 1e6, "µV")),
    (&["kV", "kilovolt", "kilovolts"], unit(Voltage, 1e-3, "kV")),
    (
        &["um", "µm", "μm", "micron", "microns", "micrometer", "micrometre", "micrometers", "micrometres"],
        unit(Length, 1.0, "µm"),
    ),
    (&["nm", "nanometer", "nanometre", "nanometers", "nanometres"], unit(Length, 1e3, "nm")),
    (&["pm", "picometer", "picometre"], unit(Length, 1e6, "pm")),
    (&["mm", "millimeter", "millimetre", "millimeters", "millimetres"], unit(Length, 1e-3, "mm")),
    (&["m", "meter", "metre", "meters", "metres"], unit(Length, 1e-6, "m")),
    (&["N", "newton", "newtons"], unit(Force, 1.0, "N")),
    (&["mN", "millinewton"], unit(Force, 1e3, "mN")),
    (&["uN", "µN", "μN"], unit(Force, 1e6, "µN")),
    (&["kN", "kilonewton"], unit(Force, 1e-3, "kN")),
    (&["degC", "°C", "℃", "deg C", "deg_C", "C", "celsius"], unit(Temperature, 1.0, "°C")),
    (&["K", "kelvin", "degK"], Unit { dimension: Temperature, per_base: 1.0, zero: 273.15, symbol: "K" }),
    (&["degF", "°F", "℉", "F", "fahrenheit"], Unit { dimension: Temperature, per_base: 1.8, zero: 32.0, symbol: "°F" }),
];

/// Words that show that a column is a temperature.
const TEMPERATURE_WORDS: &[&str] = &[
    "temperature",
    "temp",
    "temperatur",
    "t",
    "tc",
    "ntc",
    "pt100",
    "pt1000",
    "thermo",
    "ambient",
    "celsius",
    "kelvin",
];

/// A parsed heading.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Heading {
    /// The words without the unit, in lower case.
    pub(crate) words: Vec<String>,
    /// The unit, if the heading has a known unit.
    pub(crate) unit: Option<Unit>,
    /// The text in brackets at the end, if it is not a known unit.
    pub(crate) unknown: Option<String>,
}

impl Heading {
    /// Parses `name`. A `unit` that the file states elsewhere (a row of units, an attribute) takes precedence.
    pub(crate) fn parse(name: &str, unit: Option<&str>) -> Self {
        // The last part of a path names the column.
        let leaf = leaf(name);
        let (rest, own) = split_unit(leaf);
        let words = words(rest);
        let found = unit.and_then(Unit::parse).or(own);
        // The single letters C, K and F are temperatures only if a word of the heading says so (C may be coulomb, F
        // farad).
        let text = unit.filter(|unit| Unit::parse(unit).is_some()).unwrap_or(leaf);
        let mut ending = text.trim_end_matches([')', ']', '}', '>', ' ']).chars().rev();
        let is_letter = matches!(ending.next(), Some('C' | 'K' | 'F' | 'c' | 'k' | 'f'));
        let alone = is_letter && ending.next().is_none_or(|before| !before.is_alphabetic() && before != '°');
        let warm = words.iter().any(|word| TEMPERATURE_WORDS.contains(&word.as_str()));
        let found = found.filter(|unit| unit.dimension != Temperature || warm || !alone);
        let unknown = in_brackets(leaf)
            .filter(|(_, text)| found.is_none() && text.contains(char::is_alphabetic))
            .map(|(_, text)| text.to_owned());
        Self { words, unit: found, unknown }
    }

    /// Returns whether the heading contains one of `words`.
    pub(crate) fn suggests(&self, words: &[&str]) -> bool {
        self.words.iter().any(|word| words.contains(&word.as_str()))
    }
}

/// Returns the last part of a path such as `/group/name`, `struct.field` or `Sheet!Heading`. A `/` before a unit is not
/// a separator.
pub(crate) fn leaf(name: &str) -> &str {
    let cut = name.rfind(['/', '!']).filter(|at| {
        let (before, after) = (&name[..*at], &name[*at + 1..]);
        let unit = !before.contains('/') && !name.contains('!') && Unit::parse(after).is_some();
        !before.ends_with(' ') && !after.starts_with(' ') && !unit
    });
    let last = cut.map_or(name, |at| &name[at + 1..]);
    // A point separates the parts of a path, but not words or numbers.
    match last.rsplit_once('.') {
        Some((before, field))
            if !last.contains(' ') && !before.is_empty() && field.starts_with(char::is_alphabetic) =>
        {
            field
        }
        _ => last,
    }
}

/// Splits a heading into the text before the brackets at its end and the text in them.
fn in_brackets(name: &str) -> Option<(&str, &str)> {
    let name = name.trim().trim_matches('"').trim();
    [('(', ')'), ('[', ']'), ('{', '}'), ('<', '>')].into_iter().find_map(|(open, close)| {
        let inner = name.strip_suffix(close)?;
        let at = inner.rfind(open)?;
        Some((inner[..at].trim(), inner[at + open.len_utf8()..].trim()))
    })
}

/// Splits a heading into the text without the unit and the unit.
fn split_unit(name: &str) -> (&str, Option<Unit>) {
    let name = name.trim().trim_matches('"').trim();
    if let Some((rest, unit)) = in_brackets(name) {
        return (rest, Unit::parse(unit));
    }
    // A unit after a separator: "U / V", "disp, nm", "x in µm", "disp_nm", "Position nm".
    for separator in [" / ", "/", ", ", " in ", "_in_", "_", " ", "-"] {
        if let Some((rest, last)) = name.rsplit_once(separator)
            && !rest.trim().is_empty()
            && let Some(unit) = if separator.contains('_') { Unit::parse_suffix(last) } else { Unit::parse(last) }
            // "Channel C" ends in a letter, not a unit. "velocity_um_s" ends in a compound unit.
            && (last.trim().chars().count() > 1 || !matches!(separator, " " | "-"))
            && !(separator == "_" && rest.rsplit('_').next().and_then(Unit::parse_suffix).is_some())
        {
            return (rest.trim(), Some(unit));
        }
    }
    // A heading may consist of a unit only. Single letters such as "t", "s" or "V" may be symbols of a quantity and are
    // ignored.
    let whole = Unit::parse(name).filter(|_| name.chars().count() > 1 && name.to_lowercase() != "min");
    if whole.is_some() { ("", whole) } else { (name, None) }
}

/// Splits a heading into words in lower case. An upper-case letter after a lower-case one begins a word:
/// `piezoVoltage`.
pub(crate) fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut word = String::new();
    let mut before = None;
    for c in name.chars() {
        let begins = c.is_uppercase() && before.is_some_and(char::is_lowercase);
        if (begins || !c.is_alphanumeric()) && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        if c.is_alphanumeric() {
            word.extend(c.to_lowercase());
        }
        before = Some(c);
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn of(name: &str) -> (String, Option<&'static str>) {
        let heading = Heading::parse(name, None);
        (heading.words.join(" "), heading.unit.map(|unit| unit.symbol))
    }

    #[test]
    fn headings_are_split_into_words_and_unit() {
        assert_eq!(of("Time (s)"), ("time".into(), Some("s")));
        assert_eq!(of("Voltage [mV]"), ("voltage".into(), Some("mV")));
        assert_eq!(of("disp_nm"), ("disp".into(), Some("nm")));
        assert_eq!(of("U / V"), ("u".into(), Some("V")));
        assert_eq!(of("U/V"), ("u".into(), Some("V")));
        assert_eq!(of("t_ms"), ("t".into(), Some("ms")));
        assert_eq!(of("/stage 1/Position, µm"), ("position".into(), Some("µm")));
        assert_eq!(of("piezoVoltage_V"), ("piezo voltage".into(), Some("V")));
        assert_eq!(of("temperature °C"), ("temperature".into(), Some("°C")));
        assert_eq!(of("/run/voltage_v"), ("voltage".into(), Some("V")));
        assert_eq!((leaf("data.time_s"), leaf("/imu.accel.x"), leaf("Dist. (m)")), ("time_s", "x", "Dist. (m)"));
    }

    #[test]
    fn no_unit_is_assumed() {
        assert_eq!(of("t"), ("t".into(), None));
        assert_eq!(of("V"), ("v".into(), None));
        assert_eq!(of("x"), ("x".into(), None));
        assert_eq!(of("Channel A"), ("channel a".into(), None));
        assert_eq!(of("position [counts]"), ("position".into(), None));
        assert_eq!(of("load_cell"), ("load cell".into(), None));
        for name in
            ["Charge (C)", "Torque (Nm)", "Channel C", "velocity_um_s", "temp_min", "Capacitance (F)", "Inductance [H]"]
        {
            assert_eq!(of(name).1, None, "{name}");
        }
        assert_eq!((of("T (K)").1, of("temperature_k").1, of("Temp C").1), (Some("K"), Some("K"), None));
    }

    #[test]
    fn units_convert() {
        let convert = |from: &str, to: &str, value: f64| Unit::parse(from)?.to(Unit::parse(to)?).map(|f| f(value));
        assert_eq!(convert("mV", "V", 1500.0), Some(1.5));
        assert_eq!(convert("kV", "V", 0.15), Some(150.0));
        assert_eq!(convert("m", "µm", 2.5e-6), Some(2.5));
        assert_eq!(convert("K", "°C", 273.15), Some(0.0));
        assert_eq!(convert("°F", "°C", 212.0), Some(100.0));
        assert_eq!(convert("nm", "nm", 0.1), Some(0.1));
        assert_eq!(convert("nm", "V", 0.1), None);
    }
}
