//! Units of output and time columns, and their column names.

use serde::{Deserialize, Serialize};

/// The quantity of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A position or a displacement.
    Displacement,
    /// A force, for example of a clamped actuator.
    Force,
}

/// The unit of an output column.
///
/// Values are not converted on reading if their unit is one of these. Other units of length are converted to µm, of
/// force to N.
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

    /// Returns the column name for this unit, such as `displacement_um`.
    pub fn column(self) -> &'static str {
        match self {
            Self::Micrometre => "displacement_um",
            Self::Nanometre => "displacement_nm",
            Self::Millimetre => "displacement_mm",
            Self::Newton => "force_n",
        }
    }

    /// Returns the suffix of column names in this unit: `um`, `nm`, `mm` or `n`.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::Micrometre => "um",
            Self::Nanometre => "nm",
            Self::Millimetre => "mm",
            Self::Newton => "n",
        }
    }

    /// Returns the symbol of the unit: `µm`, `nm`, `mm` or `N`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Micrometre => "µm",
            Self::Nanometre => "nm",
            Self::Millimetre => "mm",
            Self::Newton => "N",
        }
    }

    /// Returns the column name for the predicted output, such as `predicted_um`.
    pub fn predicted_column(self) -> String {
        format!("predicted_{}", self.suffix())
    }

    /// Returns the quantity that this unit measures.
    pub fn quantity(self) -> Quantity {
        match self {
            Self::Newton => Quantity::Force,
            Self::Micrometre | Self::Nanometre | Self::Millimetre => Quantity::Displacement,
        }
    }

    /// Returns the unit of the output column `column`, or `None` if `column` is not an output column name.
    pub fn of_column(column: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.column() == column)
    }

    /// Returns the unit with the suffix `suffix`, or `None`.
    pub fn of_suffix(suffix: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.suffix() == suffix)
    }

    /// Returns the factor from this unit to `other`, or `None` between displacement and force.
    pub fn factor_to(self, other: Self) -> Option<f64> {
        // Nanometres per unit. Whole numbers keep a factor of one exact.
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

    /// Returns the number of this unit per second. Division by it rounds once; multiplication by its inverse would
    /// round twice.
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
    fn units_are_found_by_column_and_suffix() {
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
