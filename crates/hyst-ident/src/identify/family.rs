//! The interface of a model for identification by search.

use hyst_core::{Error, Sampling, Stage};
use nalgebra::DMatrix;

use crate::drive::{Drive, Passes};
use crate::lsq::Bounds;
use crate::model::Base;
use crate::optimize::Variable;
use crate::{BetweenSamples, Samples};

/// A parameter in which the output is linear.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Linear {
    pub(crate) name: String,
    pub(crate) bounds: Bounds,
}

impl Linear {
    pub(crate) fn free(name: &str) -> Self {
        Self { name: name.into(), bounds: Bounds::FREE }
    }

    pub(crate) fn not_negative(name: &str) -> Self {
        Self { name: name.into(), bounds: Bounds::above(0.0) }
    }
}

/// A model with the output `Σ lᵢ φᵢ(v)`: linear in the parameters l, nonlinear in the variables v.
pub(crate) trait Family: Sync {
    /// Returns the variables v with bounds for the record; empty if the model is linear in all parameters.
    fn variables(&self) -> Vec<Variable>;

    /// Returns the parameters l.
    fn linear(&self) -> Vec<Linear>;

    /// Computes the columns φ over all rows for values of v; the memory is reset at the start of each segment.
    ///
    /// # Errors
    /// If the values are not a valid model.
    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error>;

    /// Returns the model with these parameters.
    fn base(&self, values: &[f64], linear: &[f64]) -> Base;

    /// Returns the size of a large change of a parameter; `None` if that is the value of the parameter.
    fn scale(&self, _base: &Base, _name: &str) -> Option<f64> {
        None
    }

    /// Returns the interpolation of the model's drive between samples.
    fn between_samples(&self) -> BetweenSamples {
        BetweenSamples::Linear
    }

    /// Returns whether a parameter is reported, if it follows from the unknowns.
    fn identified(&self, _name: &str) -> bool {
        true
    }

    /// Returns the role of a parameter that is neither searched nor solved for.
    fn other_parameter(&self, _name: &str) -> OtherParameter {
        OtherParameter::Given
    }

    /// Sorts the values into the order of the model. If several variables are interchangeable, a search may end with
    /// any order.
    fn in_order(&self, _values: &mut [f64]) {}

    /// Describes the parameters that come neither from the record nor from the caller.
    fn given(&self) -> Option<String> {
        None
    }
}

/// Role of a parameter that is neither searched nor solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OtherParameter {
    /// Given, or a function of the unknowns.
    Given,
    /// Chosen by the record before the fit: it has a standard error like the others.
    Chosen,
    /// A convention.
    /// It can be changed together with others without an effect on the output, so its error is that of an unknown
    /// number.
    Convention,
}

/// Computes the output of the stage that `build` makes for a sample period, segment by segment; the drive is linear
/// between samples.
pub(crate) fn run<S: Stage<f64>>(
    samples: &Samples,
    build: impl Fn(&Sampling) -> Result<S, Error>,
    out: &mut [f64],
) -> Result<(), Error> {
    let drive = Drive::new(samples, BetweenSamples::Linear, Passes::Once);
    drive.run(&drive.stages(build)?, out);
    Ok(())
}

/// Computes [`run`] into a column.
pub(crate) fn run_into<S: Stage<f64>>(
    samples: &Samples,
    build: impl Fn(&Sampling) -> Result<S, Error>,
    columns: &mut DMatrix<f64>,
    column: usize,
) -> Result<(), Error> {
    run(samples, build, rows_of(columns, column))
}

/// Returns the rows of a column.
pub(crate) fn rows_of(columns: &mut DMatrix<f64>, column: usize) -> &mut [f64] {
    let rows = columns.nrows();
    &mut columns.as_mut_slice()[column * rows..(column + 1) * rows]
}

/// Returns the largest |input| of a record, greater than zero.
pub(crate) fn largest_input(samples: &Samples) -> f64 {
    let (low, high) = samples.input_range();
    low.abs().max(high.abs()).max(f64::MIN_POSITIVE)
}
