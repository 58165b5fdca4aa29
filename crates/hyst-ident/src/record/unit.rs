//! The units that an output may have, and the columns named after them.

use serde::{Deserialize, Serialize};

/// What the actuator's output is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A position or its change.
    Displacement,
    /// A force, as of a clamped actuator.
    Force,
}

/// The unit of an output column. Values keep the unit of their file: nothing is converted on reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum OutputUnit {
    /// `displacement_um` \[µm\]
    #[serde(rename = "um")]
    Micrometre,
    /// `displacement_nm` \[nm\]
    #[serde(rename = "nm")]
    Nanometre,
    /// `displacement_mm` \[mm\]
    #[serde(rename = "mm")]
    Millimetre,
    /// `force_n` \[N\]
    #[serde(rename = "n")]
    Newton,
}

impl OutputUnit {
    /// Every unit, in the order in which messages list their columns.
    pub const ALL: [Self; 4] = [Self::Micrometre, Self::Nanometre, Self::Millimetre, Self::Newton];

    /// The name of a record's column in this unit, as `displacement_um`.
    pub fn column(self) -> &'static str {
        match self {
            Self::Micrometre => "displacement_um",
            Self::Nanometre => "displacement_nm",
            Self::Millimetre => "displacement_mm",
            Self::Newton => "force_n",
        }
    }

    /// The ending of column names in this unit: `um`, `nm`, `mm` or `n`.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::Micrometre => "um",
            Self::Nanometre => "nm",
            Self::Millimetre => "mm",
            Self::Newton => "n",
        }
    }

    /// The unit as a person reads it: `µm`, `nm`, `mm` or `N`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Micrometre => "µm",
            Self::Nanometre => "nm",
            Self::Millimetre => "mm",
            Self::Newton => "N",
        }
    }

    /// The column in which a model's answer is written, as `predicted_um`.
    pub fn predicted_column(self) -> String {
        format!("predicted_{}", self.suffix())
    }

    /// What is measured in this unit.
    pub fn quantity(self) -> Quantity {
        match self {
            Self::Newton => Quantity::Force,
            Self::Micrometre | Self::Nanometre | Self::Millimetre => Quantity::Displacement,
        }
    }

    /// The unit of the column `column`, or `None` when that is no output column's name.
    pub fn of_column(column: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.column() == column)
    }

    /// The unit with the ending `suffix`, or `None`.
    pub fn of_suffix(suffix: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.suffix() == suffix)
    }

    /// The factor that turns values in this unit into values in `other`, or `None` between displacement and force.
    pub fn factor_to(self, other: Self) -> Option<f64> {
        // Nanometres in one unit: whole numbers, so that a factor of one is exact.
        let size = |unit| match unit {
            Self::Micrometre => 1e3,
            Self::Millimetre => 1e6,
            Self::Nanometre | Self::Newton => 1.0,
        };
        (self.quantity() == other.quantity()).then(|| size(self) / size(other))
    }
}

/// The unit of a time column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TimeUnit {
    Second,
    Millisecond,
    Microsecond,
}

impl TimeUnit {
    pub(crate) const ALL: [Self; 3] = [Self::Second, Self::Millisecond, Self::Microsecond];

    pub(crate) fn column(self) -> &'static str {
        match self {
            Self::Second => "time_s",
            Self::Millisecond => "time_ms",
            Self::Microsecond => "time_us",
        }
    }

    /// How many of this unit make a second. Dividing by it rounds once; multiplying by its inverse would round twice.
    pub(crate) fn per_second(self) -> f64 {
        match self {
            Self::Second => 1.0,
            Self::Millisecond => 1e3,
            Self::Microsecond => 1e6,
        }
    }

    pub(crate) fn of_column(column: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.column() == column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_and_suffixes_lead_back_to_their_unit() {
        for unit in OutputUnit::ALL {
            assert_eq!(OutputUnit::of_column(unit.column()), Some(unit));
            assert_eq!(OutputUnit::of_suffix(unit.suffix()), Some(unit));
            assert_eq!(serde_json::to_value(unit).unwrap(), serde_json::json!(unit.suffix()));
        }
        assert_eq!(OutputUnit::of_column("displacement_m"), None);
    }

    #[test]
    fn factors_convert_lengths_and_refuse_forces() {
        use OutputUnit::{Micrometre, Millimetre, Nanometre, Newton};
        assert_eq!(Millimetre.factor_to(Nanometre), Some(1e6));
        assert_eq!(Nanometre.factor_to(Micrometre), Some(1e-3));
        assert_eq!(Newton.factor_to(Newton), Some(1.0));
        assert_eq!(Newton.factor_to(Micrometre), None);
    }
}
