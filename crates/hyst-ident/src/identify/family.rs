//! What a model has to say to be identified by search.

use hyst_core::{Env, Error, Stage};
use nalgebra::DMatrix;

use crate::Samples;
use crate::lsq::Bounds;
use crate::model::Base;
use crate::optimize::Variable;

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

    /// Whether a parameter of the model was identified, and not given.
    fn identified(&self, _name: &str) -> bool {
        true
    }
}

/// Output of a stage over the rows, one segment after the other.
pub(crate) fn run<S: Stage<f64>>(samples: &Samples, stage: &S, out: &mut [f64]) {
    let mut state = stage.state();
    for segment in &samples.segments {
        for k in segment.clone() {
            let (env, u): (Env<f64>, f64) = (samples.env(k), samples.input[k]);
            out[k] =
                if k == segment.start { stage.reset(&mut state, &env, u) } else { stage.step(&mut state, &env, u) };
        }
    }
}

/// [`run`] into a column.
pub(crate) fn run_into<S: Stage<f64>>(samples: &Samples, stage: &S, columns: &mut DMatrix<f64>, column: usize) {
    let rows = columns.nrows();
    run(samples, stage, &mut columns.as_mut_slice()[column * rows..(column + 1) * rows]);
}
