//! Families: which parameters of each model are searched, within which bounds, and which are solved for.
//!
//! Bounds come from the record: its ranges of input and temperature, its sample period and length. No family uses the
//! output.

mod activation;
mod bouc_wen;
mod fractional;
mod gpi;
mod maxwell;
mod oscillator;
mod pi;
mod td_pi;

use std::str::FromStr;

use hyst_core::{Kind, SlipReading};

use super::Family;
use crate::{BetweenSamples, Samples};

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

/// Returns the family of a kind of model; `None` if it is not identified by search. `largest` is the largest |input| of
/// the whole record. `samples` may be a part of the record; relative variables mean the same for both.
pub(crate) fn family_of<'a>(
    kind: Kind,
    samples: &'a Samples,
    largest: f64,
    form: &Form,
) -> Option<Box<dyn Family + 'a>> {
    let elements = |most: usize| form.elements.unwrap_or(most);
    Some(match kind {
        Kind::Pi => Box::new(pi::PiFamily::new(samples, elements(6))),
        Kind::BoucWen => Box::new(bouc_wen::BoucWenFamily::new(samples, form.bouc_wen_n)),
        Kind::Atan | Kind::Sigmoid | Kind::Softplus | Kind::Softsign | Kind::Tanh => {
            Box::new(activation::ActivationFamily::new(samples, kind)?)
        }
        Kind::Lfdm => Box::new(fractional::LfdmFamily::new(samples)),
        Kind::Ifm => Box::new(fractional::IfmFamily::new(samples)),
        Kind::Gpi => Box::new(gpi::GpiFamily::new(samples, elements(16))),
        Kind::TdPi => Box::new(td_pi::TdPiFamily::new(samples, elements(9))),
        Kind::MaxwellSlip => Box::new(maxwell::SlipFamily::new(samples, elements(16), form.slip)),
        Kind::TdEm => Box::new(maxwell::TdEmFamily::new(samples, elements(10))),
        Kind::BoucWenOscillator => {
            Box::new(oscillator::OscillatorFamily::new(samples, form.between_samples.unwrap_or_default(), largest))
        }
        _ => return None,
    })
}

/// Returns the largest |input| of a record, greater than zero.
pub(crate) fn largest_input(samples: &Samples) -> f64 {
    let (low, high) = samples.input_range();
    low.abs().max(high.abs()).max(f64::MIN_POSITIVE)
}
