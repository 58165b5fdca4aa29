//! A fitted model: base model, effects, ranges of input and output, and the files that they were fitted to.

use std::collections::{BTreeMap, BTreeSet};

use hyst_core::{ChainParams, CompensatorOptions, Error, Sampling};
use serde::{Deserialize, Serialize};

use super::operator::inverse_ends;
use super::{Base, Compensator, Effects, HostChain, Operator};
use crate::record::Record;
use crate::{BetweenSamples, Samples};

/// The key of the sensor zero, which belongs to no stage, in [`Model::std_errors`] and estimates.
pub const ZERO: &str = "zero";

/// The input or the output of the actuator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// The column of the record, with its unit.
    pub column: String,
    /// The unit: `V` or `N` of an input, the suffix of the column (`um`, `nm`, `mm`, `n`) of an output.
    pub unit: String,
    /// The minimum in the record that the model was fitted to.
    pub low: f64,
    /// The maximum in that record.
    pub high: f64,
}

impl Channel {
    /// Returns the symbol of the unit: `N` for the suffix `n`, because `n` before `s` would mean nano.
    pub fn symbol(&self) -> &str {
        if self.unit == "n" { "N" } else { &self.unit }
    }
}

/// A file that a model was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedOn {
    /// The file name without its folder.
    pub file: String,
    /// SHA-256 of the bytes, hexadecimal.
    pub sha256: String,
    /// The number of fitted rows.
    pub rows: usize,
    /// The number of rows that were not fitted: start-up rows, and rows with the sensor at the end of its range.
    pub settling_rows: usize,
}

/// A fitted model: base model, effects, and the files that they were fitted to.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The input.
    pub input: Channel,
    /// The interpolation of the drive between samples in simulations of a record.
    ///
    /// A [`chain`](Self::build) that processes one sample at a time interpolates linearly.
    pub between_samples: BetweenSamples,
    /// The output.
    pub output: Channel,
    /// Whether the output falls when the hysteresis rises (negative gain).
    pub falls: bool,
    /// The sensor zero: reading of the sensor at rest \[output unit\].
    pub zero: f64,
    /// The base model.
    pub base: Base,
    /// The effects.
    pub effects: Effects,
    /// Standard errors by `stage.parameter`; that of the sensor zero by [`ZERO`].
    pub std_errors: BTreeMap<String, f64>,
    /// Parameters, by `stage.parameter`, that the record does not determine, or only in combination with others.
    pub undetermined: BTreeSet<String>,
    /// RMS of the residual over the fitted rows \[output unit\].
    pub rmse: Option<f64>,
    /// Sample rate of the record \[Hz\].
    pub recorded_at_hz: f64,
    /// The files of the record.
    pub fitted_on: Vec<FittedOn>,
    /// The seed of the search.
    pub seed: u64,
    /// The version that wrote the file.
    pub version: String,
}

impl Model {
    /// Builds the chain for a sample period \[s\].
    ///
    /// # Errors
    /// If a parameter is out of range. The error names it.
    pub fn build(&self, period: f64) -> Result<HostChain, Error> {
        let cx = Sampling { period };
        let chain: HostChain =
            self.effects.to_params().around(Operator::new(&self.base, [self.input.low, self.input.high], &cx)?, &cx)?;
        Ok(chain.with_falling(self.falls).with_zero(self.zero))
    }

    /// Returns the parameters for firmware.
    pub fn to_params(&self) -> ChainParams<Vec<f64>> {
        ChainParams {
            operator: self.base.clone(),
            effects: self.effects.to_params(),
            falls: self.falls,
            zero: self.zero,
            input: [self.input.low, self.input.high],
        }
    }

    /// Builds the compensator for a sample period \[s\].
    ///
    /// # Errors
    /// Those of [`build`](Self::build), and if the chain has no inverse.
    pub fn compensator(&self, period: f64, options: &CompensatorOptions) -> Result<Compensator, Error> {
        let mut chain = self.build(period)?;
        chain.hysteresis = chain.hysteresis.with_bandwidth(options.bandwidth_hz);
        chain.compensator(&Sampling { period }, options)
    }

    /// Returns the input range that limits the inverse of the base model, and its tolerance \[input unit\].
    ///
    /// `None` if the inverse is not limited. For outputs that this range does not reach, the inverse returns the nearer
    /// end.
    pub fn inverse_ends(&self) -> Option<([f64; 2], f64)> {
        inverse_ends(&self.base, [self.input.low, self.input.high])
    }

    /// Returns whether the model needs a temperature.
    pub fn needs_temperature(&self) -> bool {
        self.effects.temperature.is_some() || matches!(self.base, Base::TdPi(_) | Base::TdEm(_))
    }

    /// Returns whether the model needs a load.
    pub fn needs_load(&self) -> bool {
        self.effects.load.is_some()
    }

    /// Returns the column that the model needs but these rows do not have, and the reason.
    pub(crate) fn lacking(&self, samples: &Samples) -> Option<(&'static str, &'static str)> {
        if self.needs_temperature() && samples.temperature.is_none() {
            return Some((
                "temperature_degc",
                "the gain of the model depends on temperature; if it was constant, type --temperature DEGC",
            ));
        }
        (self.needs_load() && samples.load.is_none()).then_some(("load_n", "the model has a load effect"))
    }

    /// Returns whether the model was fitted to one of the files of the record, compared byte for byte.
    pub fn was_fitted_to(&self, record: &Record) -> bool {
        let fitted = |sum: &str| self.fitted_on.iter().any(|file| file.sha256 == sum);
        record.sources().iter().any(|source| source.sha256.as_deref().is_some_and(fitted))
    }
}

/// Returns the unit from the suffix of a column's name.
pub(crate) fn unit_of(column: &str) -> String {
    match column.rsplit('_').next() {
        Some("v") => "V".into(),
        Some("n") => "N".into(),
        Some(other) => other.into(),
        None => String::new(),
    }
}
