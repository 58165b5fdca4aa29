//! An operator that is kept as it is, as one column.

use std::ops::Range;

use hyst_core::{Env, Error, Sampling, Stage};
use nalgebra::DMatrix;

use super::{Basis, Drag};
use crate::Samples;
use crate::lsq::Bounds;
use crate::model::{Base, Operator};

/// Any operator with the parameters that it has: around it effects are looked for, in it nothing is refitted.
#[derive(Clone, Debug)]
pub(crate) struct FixedBasis {
    pub(crate) base: Base,
    operator: Box<Operator>,
    surroundings: Vec<Env<f64>>,
}

impl FixedBasis {
    /// For the surroundings of a record.
    ///
    /// # Errors
    /// If the operator cannot be built at the record's sample period.
    pub(crate) fn new(base: &Base, samples: &Samples) -> Result<Self, Error> {
        let (low, high) = samples.input_range();
        let operator = Operator::new(base, [low, high], &Sampling { period: samples.period })?;
        let surroundings = (0..samples.len()).map(|k| samples.env(k)).collect();
        Ok(Self { base: base.clone(), operator: Box::new(operator), surroundings })
    }
}

impl Basis for FixedBasis {
    fn columns(&self, drive: &[f64], segments: &[Range<usize>], _drag: &Drag, each: &mut dyn FnMut(usize, &mut [f64])) {
        let mut column = vec![0.0; drive.len()];
        let mut state = Box::new(self.operator.state());
        for segment in segments {
            for k in segment.clone() {
                let env = &self.surroundings[k];
                column[k] = if k == segment.start {
                    self.operator.reset(&mut state, env, drive[k])
                } else {
                    self.operator.step(&mut state, env, drive[k])
                };
            }
        }
        each(0, &mut column);
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
