//! Forms of models that have several.

use std::str::FromStr;

use hyst_core::SlipReading;

use crate::BetweenSamples;

/// Forms of models that have several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// Exponent n of a Bouc-Wen model; `None` searches it.
    pub bouc_wen_n: Option<f64>,
    /// Number of play operators (`gpi`, `td-pi`) or elements (`td-em`).
    /// Maximum number for `maxwell-slip`.
    pub elements: Option<usize>,
    /// Kind of the elements of `maxwell-slip`.
    pub slip: SlipReading,
    /// Interpolation of the drive of `bouc-wen-oscillator` between samples.
    /// `None` tries both and uses the better one.
    pub between_samples: Option<BetweenSamples>,
}

impl Default for Form {
    fn default() -> Self {
        Self { bouc_wen_n: Some(1.0), elements: None, slip: SlipReading::Backlash, between_samples: None }
    }
}

impl Form {
    /// Names of the forms.
    /// Those of `bouc-wen` are the first authors of the papers, those of `maxwell-slip` the elements.
    pub const NAMES: [&str; 4] = ["zhu", "xie", "backlash", "elasto-slip"];
}

/// An unknown name of a form.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown form {0:?}; expected one of {names}", names = Form::NAMES.join(", "))]
pub struct UnknownForm(String);

impl FromStr for Form {
    type Err = UnknownForm;

    fn from_str(name: &str) -> Result<Self, UnknownForm> {
        match name {
            "zhu" | "backlash" => Ok(Self::default()),
            "xie" => Ok(Self { bouc_wen_n: None, ..Self::default() }),
            "elasto-slip" => Ok(Self { slip: SlipReading::ElastoSlip, ..Self::default() }),
            _ => Err(UnknownForm(name.into())),
        }
    }
}
