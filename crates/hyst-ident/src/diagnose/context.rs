//! What a named effect is described from.

use std::collections::BTreeMap;

use crate::model::Model;
use crate::record::OutputUnit;
use crate::samples::Samples;

/// Receives the parameters of an effect: stage, name, value and unit.
pub(super) type Put<'a> = dyn FnMut(&str, &str, f64, &str) + 'a;

/// What an effect is described from.
pub(super) struct Context<'a> {
    pub(super) model: &'a Model,
    pub(super) extended: &'a Model,
    pub(super) samples: &'a Samples,
    /// Standard errors by `stage.parameter`.
    pub(super) errors: &'a BTreeMap<String, f64>,
    /// Cross-validated RMSE on the basis of the search with all effects found, in noise floors.
    pub(super) left: f64,
}

impl<'a> Context<'a> {
    /// Returns the symbol of the output's unit.
    pub(super) fn symbol(&self) -> &'a str {
        let unit = &self.model.output.unit;
        OutputUnit::of_suffix(unit).map_or(unit.as_str(), |u| u.symbol())
    }

    /// Returns the mean gain over the range of the record \[y/u\], without its sign.
    pub(super) fn mean_gain(&self) -> f64 {
        let (low, high) = self.samples.input_range();
        (self.samples.output_span() / (high - low)).max(f64::MIN_POSITIVE)
    }
}
