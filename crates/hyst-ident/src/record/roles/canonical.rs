//! Units and column names of the record format.

use crate::record::columns::Role;
use crate::record::heading::{Dimension, Unit};
use crate::record::unit::{OutputUnit, TimeUnit};

impl Unit {
    /// Returns the unit of a column name of the record format.
    pub(crate) fn of_canonical(name: &str) -> Option<Self> {
        let is_own = matches!(Role::of_column(name)?, Role::Time | Role::Output | Role::Temperature | Role::Load)
            || name == "voltage_v";
        match name.rsplit_once("_in_") {
            Some((_, unit)) => Self::parse_suffix(unit),
            None => is_own.then(|| name.rsplit_once('_')).flatten().and_then(|(_, unit)| Self::parse_suffix(unit)),
        }
    }

    /// Returns the column name of the record format for values of this unit with `role`. It has the same unit if the
    /// format supports it.
    pub(super) fn canonical(self, role: Role) -> &'static str {
        match (role, self.dimension) {
            (Role::Time, _) => match self.symbol {
                "ms" => TimeUnit::Millisecond,
                "µs" => TimeUnit::Microsecond,
                _ => TimeUnit::Second,
            }
            .column(),
            (Role::Load, _) => "load_n",
            (_, Dimension::Force) => OutputUnit::Newton.column(),
            (Role::Output, _) => match self.symbol {
                "nm" => OutputUnit::Nanometre,
                "mm" => OutputUnit::Millimetre,
                _ => OutputUnit::Micrometre,
            }
            .column(),
            (Role::Temperature, _) => "temperature_degc",
            (Role::Segment, _) => "segment",
            (Role::Input, _) => "voltage_v",
        }
    }
}

/// Returns whether values in `unit` can have `role`.
pub(super) fn has(role: Role, unit: Unit) -> bool {
    match role {
        Role::Segment => false,
        Role::Time => unit.dimension == Dimension::Time,
        Role::Input => unit.dimension == Dimension::Voltage,
        Role::Output => matches!(unit.dimension, Dimension::Length | Dimension::Force),
        Role::Temperature => unit.dimension == Dimension::Temperature,
        Role::Load => unit.dimension == Dimension::Force,
    }
}

/// Returns the number of the unit of a time column per second.
pub(super) fn per_second(canonical: &str) -> f64 {
    TimeUnit::of_column(canonical).unwrap_or(TimeUnit::Second).per_second()
}
