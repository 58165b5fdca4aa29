//! An operator that is kept as it is, as one column.

use std::ops::Range;
use std::sync::Arc;

use hyst_core::Error;
use nalgebra::DMatrix;

use super::{Basis, Drag, turned};
use crate::drive::{Drive, Passes};
use crate::lsq::Bounds;
use crate::model::{Base, Model, Operator};
use crate::samples::PerSegment;
use crate::{BetweenSamples, Samples};

/// Any operator with the parameters that it has: around it effects are looked for, in it nothing is refitted.
#[derive(Clone, Debug)]
pub(crate) struct FixedBasis {
    pub(crate) base: Base,
    falls: bool,
    between: BetweenSamples,
    operator: Arc<PerSegment<Operator>>,
    /// Segments and surroundings of the record that it is for.
    samples: Samples,
}

impl FixedBasis {
    /// For a record, its drive going on between the samples as the model has it.
    ///
    /// # Errors
    /// If the operator cannot be built at the record's sample period.
    pub(crate) fn new(model: &Model, samples: &Samples) -> Result<Self, Error> {
        let (low, high) = samples.input_range();
        let between = model.between_samples;
        let drive = Drive::new(samples, between, Passes::Once);
        let operator = drive.stages(|sampling| Operator::new(&model.base, [low, high], sampling))?;
        Ok(Self {
            base: model.base.clone(),
            falls: model.falls,
            between,
            operator: Arc::new(operator),
            samples: samples.clone(),
        })
    }
}

impl Basis for FixedBasis {
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], _drag: &Drag) -> Vec<Vec<f64>> {
        assert_eq!(segments, self.samples.segments, "the columns of a fixed base are those of its own record");
        let column = |_| {
            let mut column = vec![0.0; drive.len()];
            Drive::of(&self.samples, drive, self.between, Passes::Once).run(&self.operator, &mut column);
            column
        };
        turned(self.falls, of.map(column).collect())
    }

    fn remembers(&self) -> bool {
        false
    }

    fn drags(&self) -> bool {
        false
    }

    fn bounds(&self) -> Vec<Bounds> {
        vec![Bounds { lower: 1.0, upper: 1.0 }]
    }

    fn penalty(&self, _level: f64) -> Option<DMatrix<f64>> {
        None
    }
}
