//! Words of headings that suggest or contradict a role.

use crate::record::columns::Role;

const TIME: &[&str] = &["time", "t", "zeit", "timestamp", "clock", "temps"];
pub(super) const INPUT: &[&str] = &[
    "voltage",
    "volt",
    "volts",
    "u",
    "v",
    "vin",
    "uin",
    "input",
    "drive",
    "command",
    "excitation",
    "ao",
    "ao0",
    "spannung",
    "actuation",
    "hv",
    "piezo",
    "amplifier",
];
pub(super) const OUTPUT: &[&str] = &[
    "displacement",
    "disp",
    "position",
    "pos",
    "force",
    "weg",
    "stroke",
    "elongation",
    "extension",
    "sensor",
    "measured",
    "y",
    "z",
    "x",
    "auslenkung",
    "output",
];
const TEMPERATURE: &[&str] = &["temperature", "temp", "temperatur"];
pub(super) const LOAD: &[&str] = &["load", "preload", "external"];
/// Words of a commanded position.
pub(super) const COMMANDED: &[&str] = &[
    "target",
    "commanded",
    "command",
    "setpoint",
    "set",
    "reference",
    "desired",
    "wanted",
    "soll",
    "error",
    "cmd",
    "ref",
];
/// Words of a measured voltage.
pub(super) const SENSOR: &[&str] = &[
    "sensor",
    "monitor",
    "mon",
    "measured",
    "feedback",
    "output",
    "out",
    "gauge",
    "adc",
    "ai",
    "cell",
    "capacitive",
    "strain",
];
/// Units of temperature or load that are not supported.
pub(super) const UNKNOWN_UNITS: &[&str] = &["kg", "g", "lbf"];

/// Words of a voltage that is a sensor signal, not the input.
pub(super) const NOT_INPUT: &[&str] = &["sensor", "gauge", "strain", "capacitive", "lvdt", "interferometer"];
/// Words of a position that is a reference, not a measured output.
pub(super) const NOT_OUTPUT: &[&str] = &["target", "commanded", "setpoint", "desired", "wanted", "soll"];

/// Returns what a column is instead, if its words contradict `role`.
pub(super) fn contrary(role: Role) -> &'static str {
    if role == Role::Input { "a sensor signal" } else { "a reference, not a measured output" }
}

pub(super) fn words_of(role: Role) -> &'static [&'static str] {
    match role {
        Role::Segment => &["segment", "segments"],
        Role::Time => TIME,
        Role::Input => INPUT,
        Role::Output => OUTPUT,
        Role::Temperature => TEMPERATURE,
        Role::Load => LOAD,
    }
}
