//! Statements above the rows: the sample interval, the times and the units.

use super::super::Axis;
use super::super::numbers::number;
use super::fields::{Delimiter, fields};
use crate::record::heading::Unit;

/// Returns the sample period \[s\] of a remark such as `Sample Interval, 1.0e-3` or `# SAMPLE_TIME = 0.001`.
fn period_of_remark(line: &str) -> Option<f64> {
    let lower = line.to_lowercase();
    let lower = lower.trim_start_matches(|c: char| !c.is_alphanumeric());
    let interval = [
        "sample interval",
        "sample_time",
        "sampletime",
        "sample time",
        "sampling interval",
        "sample period",
        "sampling period",
        "delta_x",
        "time increment",
    ];
    let rate = ["sample rate", "sample_rate", "samplerate", "sampling rate", "sampling frequency"];
    let behind = |keys: &[&str]| {
        let key = keys.iter().find(|key| lower.starts_with(**key))?;
        // The number is next, or after a unit in brackets. "rate of card 2: 5000" is something else.
        let rest = lower[key.len()..].trim_start();
        let rest =
            rest.strip_prefix(['(', '[']).and_then(|rest| rest.split_once([')', ']'])).map_or(rest, |(_, rest)| rest);
        let rest = rest.trim_start_matches([' ', '\t', ':', '=', ',', ';', '"']);
        let end =
            rest.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | 'e' | '-' | '+'))).unwrap_or(rest.len());
        // Numbers with a comma such as "44,100" and "2,5" are ambiguous.
        if rest[end..].strip_prefix(',').is_some_and(|more| more.starts_with(|c: char| c.is_ascii_digit())) {
            return None;
        }
        let value = number(&rest.as_bytes()[..end], b'.').filter(|value| *value > 0.0 && value.is_finite())?;
        Some((value, rest[end..].trim_matches(|c: char| !c.is_alphabetic()).to_owned()))
    };
    if let Some((value, unit)) = behind(&interval) {
        return match unit.as_str() {
            "" | "s" | "sec" | "seconds" => Some(value),
            "ms" => Some(value / 1e3),
            "us" | "µs" => Some(value / 1e6),
            _ => None,
        };
    }
    let (value, unit) = behind(&rate)?;
    match unit.as_str() {
        "" | "hz" | "s" | "sa s" | "samples s" | "s/s" | "sa/s" | "samples/s" => Some(1.0 / value),
        "khz" | "ks/s" | "ksa/s" => Some(1e-3 / value),
        "mhz" | "ms/s" | "msa/s" => Some(1e-6 / value),
        _ => None,
    }
}

/// Returns the times of the rows that a remark above them states.
pub(super) fn axis_of_remarks<'a>(mut lines: impl Iterator<Item = &'a str>) -> Axis {
    lines.find_map(period_of_remark).map_or(Axis::Unknown, |step| Axis::Even { start: 0.0, step })
}

/// Returns the units that an oscilloscope states above its table, by column: `Horizontal Units,s`, `Vertical
/// Units,V,um`.
pub(super) fn units_of_axes<'a>(remarks: impl Iterator<Item = &'a str>, delimiter: Delimiter) -> Vec<(usize, &'a str)> {
    let of = |line: &'a str| {
        let parts = fields(line, delimiter);
        let first = match parts.first()?.to_lowercase().as_str() {
            "horizontal units" | "x units" | "x_unit" => 0,
            "vertical units" | "y units" | "y_unit" => 1,
            _ => return None,
        };
        Some((first..).zip(parts.into_iter().skip(1).filter(|unit| Unit::parse(unit).is_some())))
    };
    remarks.filter_map(of).flatten().collect()
}

/// Returns the times from the columns `Start` and `Increment` of an oscilloscope, whose values are in the row of units.
pub(super) fn start_and_increment(names: &[&str], units: &[&str]) -> Option<Axis> {
    let value = |name: &str| {
        let at = names.iter().position(|own| own.eq_ignore_ascii_case(name))?;
        units.get(at)?.parse::<f64>().ok().filter(|value| value.is_finite())
    };
    let step = value("increment").filter(|step| *step > 0.0)?;
    Some(Axis::Even { start: value("start").unwrap_or(0.0), step })
}
