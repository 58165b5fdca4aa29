//! Input and output of an actuator in a model file.

use hyst_core::Error;
use hyst_ident::model::{Base, Ends, Model};
use hyst_ident::record::OutputUnit;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::errors;
use crate::keep::Kept;
use crate::record::output_unit;

/// Sample rate in the file of a model without a sample period \[Hz\].
const DEFAULT_RATE_HZ: f64 = 1000.0;

/// Input and output of a model file, as given by the caller.
#[derive(Default)]
pub(crate) struct Channels {
    pub(crate) input_range: Option<(f64, f64)>,
    pub(crate) output_range: Option<(f64, f64)>,
    pub(crate) input_column: Option<String>,
    pub(crate) output_column: Option<String>,
}

impl Channels {
    /// Returns whether nothing is given.
    pub(crate) fn is_empty(&self) -> bool {
        let Self { input_range, output_range, input_column, output_column } = self;
        input_range.is_none() && output_range.is_none() && input_column.is_none() && output_column.is_none()
    }

    /// Returns a model with these parameters, input and output.
    ///
    /// # Errors
    /// `TypeError` if the input range is not given and the model has no grid; otherwise as [`Model::from_parameters`].
    pub(crate) fn model(&self, kept: Kept, period: Option<f64>) -> PyResult<Model> {
        let grid = match &kept.base {
            Base::Preisach(p) => Some((p.low, p.high)),
            Base::Dpm(p) => Some((p.preisach.low, p.preisach.high)),
            _ => None,
        };
        let input = self.input_range.or(grid).ok_or_else(|| {
            PyTypeError::new_err("give input_range=(low, high), the input range in which the parameters are valid")
        })?;
        let output = self.output_column.as_deref().map_or(Ok(OutputUnit::Micrometre), output_unit)?;
        let ends = Ends {
            input_column: self.input_column.clone().unwrap_or_else(|| "voltage_v".to_owned()),
            input,
            output,
            output_range: self.output_range,
            rate_hz: period.map_or(DEFAULT_RATE_HZ, |period| 1.0 / period),
        };
        Model::from_parameters(kept.base, kept.effects, &ends).map_err(|error: Error| errors::core(error))
    }
}
