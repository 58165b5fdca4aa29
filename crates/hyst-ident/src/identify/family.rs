//! What a model has to say to be identified by search.

use hyst_core::{Error, Sampling, Stage};
use nalgebra::DMatrix;

use crate::drive::{Drive, Passes};
use crate::lsq::Bounds;
use crate::model::Base;
use crate::optimize::Variable;
use crate::{BetweenSamples, Samples};

/// A parameter that the output is linear in.
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

/// A model whose output is `Σ lᵢ φᵢ(v)`: linear in some parameters l, and not in others v.
pub(crate) trait Family: Sync {
    /// The variables v, with bounds that suit the record; none if the model is linear in all.
    fn variables(&self) -> Vec<Variable>;

    /// The parameters l.
    fn linear(&self) -> Vec<Linear>;

    /// The columns φ over all rows at some values of v; memory is reset at the start of each segment.
    ///
    /// # Errors
    /// If the values make no model.
    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error>;

    /// The model with these parameters.
    fn base(&self, values: &[f64], linear: &[f64]) -> Base;

    /// The size of a change of a parameter of the model that counts as a large one; `None` for the parameter's own size.
    fn scale(&self, _base: &Base, _name: &str) -> Option<f64> {
        None
    }

    /// How the drive that the model sees goes on between samples.
    fn between_samples(&self) -> BetweenSamples {
        BetweenSamples::Linear
    }

    /// Whether a parameter of the model is told of, if it follows from what was searched or solved for.
    fn identified(&self, _name: &str) -> bool {
        true
    }

    /// Whether a parameter of the model that is neither searched nor solved for is unknown all the same.
    fn beside(&self, _name: &str) -> Beside {
        Beside::Nothing
    }

    /// Brings values into the order in which the model has them: where several variables stand for one another, a search ends with any
    /// of their orders.
    fn in_order(&self, _values: &mut [f64]) {}

    /// What else the model is made of, in words: parameters that are neither the record's nor the caller's.
    fn given(&self) -> Option<String> {
        None
    }
}

/// What a parameter is that is neither searched nor solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beside {
    /// Given, or a function of what was searched and solved for.
    Nothing,
    /// Chosen by the record before all else: it has an error like the others.
    Chosen,
    /// A convention. With others it can be changed without a trace: its error is that of a number that nobody knows.
    Convention,
}

/// Output of the stage that `build` makes for a sample period over the rows, one segment after the other; the drive is linear between samples.
pub(crate) fn run<S: Stage<f64>>(
    samples: &Samples,
    build: impl Fn(&Sampling) -> Result<S, Error>,
    out: &mut [f64],
) -> Result<(), Error> {
    let drive = Drive::new(samples, BetweenSamples::Linear, Passes::Once);
    drive.run(&drive.stages(build)?, out);
    Ok(())
}

/// [`run`] into a column.
pub(crate) fn run_into<S: Stage<f64>>(
    samples: &Samples,
    build: impl Fn(&Sampling) -> Result<S, Error>,
    columns: &mut DMatrix<f64>,
    column: usize,
) -> Result<(), Error> {
    run(samples, build, rows_of(columns, column))
}

/// A column's rows.
pub(crate) fn rows_of(columns: &mut DMatrix<f64>, column: usize) -> &mut [f64] {
    let rows = columns.nrows();
    &mut columns.as_mut_slice()[column * rows..(column + 1) * rows]
}
