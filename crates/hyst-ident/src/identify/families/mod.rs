//! Families: which parameters of each model are searched, within which bounds, and which are solved for.
//!
//! Bounds come from the record: its ranges of input and temperature, its sample period and length. No family uses the
//! output.

mod activation;
mod bouc_wen;
mod form;
mod fractional;
mod gpi;
mod maxwell;
mod oscillator;
mod pi;
mod td_pi;

use hyst_core::Kind;

use super::Family;
use crate::Samples;
pub use form::{Form, UnknownForm};

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
