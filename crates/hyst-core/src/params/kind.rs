//! The kinds of base models, and their names in commands and files.

use core::fmt;
use core::str::FromStr;

/// Kind of a base model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Kind {
    /// Prandtl-Ishlinskii.
    Pi,
    /// Generalised Prandtl-Ishlinskii, with envelope functions.
    Gpi,
    /// Temperature-dependent Prandtl-Ishlinskii.
    TdPi,
    /// Classical Preisach as an Everett map.
    Preisach,
    /// Dynamic Preisach: an Everett map and a mirror function of rate and swing.
    Dpm,
    /// Maxwell-slip elements.
    MaxwellSlip,
    /// Temperature-dependent electromechanical model.
    TdEm,
    /// Bouc-Wen, static.
    BoucWen,
    /// An oscillator with a Bouc-Wen element in its spring.
    BoucWenOscillator,
    /// Linear fractional-order differential model.
    Lfdm,
    /// Improved fractional-order model.
    Ifm,
    /// Activation function atan.
    Atan,
    /// Activation function sigmoid.
    Sigmoid,
    /// Activation function softplus.
    Softplus,
    /// Activation function softsign.
    Softsign,
    /// Activation function tanh.
    Tanh,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 16] = [
        Self::Pi,
        Self::Gpi,
        Self::TdPi,
        Self::Preisach,
        Self::Dpm,
        Self::MaxwellSlip,
        Self::TdEm,
        Self::BoucWen,
        Self::BoucWenOscillator,
        Self::Lfdm,
        Self::Ifm,
        Self::Atan,
        Self::Sigmoid,
        Self::Softplus,
        Self::Softsign,
        Self::Tanh,
    ];

    /// Returns the name that commands and files use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pi => "pi",
            Self::Gpi => "gpi",
            Self::TdPi => "td-pi",
            Self::Preisach => "preisach",
            Self::Dpm => "dpm",
            Self::MaxwellSlip => "maxwell-slip",
            Self::TdEm => "td-em",
            Self::BoucWen => "bouc-wen",
            Self::BoucWenOscillator => "bouc-wen-oscillator",
            Self::Lfdm => "lfdm",
            Self::Ifm => "ifm",
            Self::Atan => "atan",
            Self::Sigmoid => "sigmoid",
            Self::Softplus => "softplus",
            Self::Softsign => "softsign",
            Self::Tanh => "tanh",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The error for an unknown name of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownKind;

impl fmt::Display for UnknownKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("no model has this name; there are")?;
        for (i, kind) in Kind::ALL.iter().enumerate() {
            write!(f, "{} {kind}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl core::error::Error for UnknownKind {}

impl FromStr for Kind {
    type Err = UnknownKind;
    fn from_str(s: &str) -> Result<Self, UnknownKind> {
        Self::ALL.into_iter().find(|k| k.name() == s).ok_or(UnknownKind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_found_by_its_name() {
        for kind in Kind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        assert_eq!("prandtl".parse::<Kind>(), Err(UnknownKind));
    }
}
