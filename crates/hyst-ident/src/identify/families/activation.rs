//! Activation-function models: `z = k₀ u + α u̇ + β f(γ u)` is linear in all parameters but γ.

use hyst_core::{ActivationKind, ActivationParams, Error, Kind};
use nalgebra::DMatrix;

use crate::Samples;
use crate::identify::family::largest_input;
use crate::identify::{Family, Linear};
use crate::model::Base;
use crate::optimize::Variable;

pub(super) struct ActivationFamily<'a> {
    samples: &'a Samples,
    kind: ActivationKind,
}

impl<'a> ActivationFamily<'a> {
    pub(super) fn new(samples: &'a Samples, kind: Kind) -> Option<Self> {
        Some(Self { samples, kind: ActivationKind::from_name(kind.name())? })
    }
}

impl Family for ActivationFamily<'_> {
    /// From an activation that is a straight line over the record's range to one that switches within a millionth of
    /// it.
    fn variables(&self) -> Vec<Variable> {
        let u = largest_input(self.samples);
        vec![Variable::log("gamma", "1/u", 0.01 / u, 1e6 / u)]
    }

    fn linear(&self) -> Vec<Linear> {
        ["k0", "alpha", "beta"].map(Linear::free).to_vec()
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        for (i, segment) in self.samples.segments.iter().enumerate() {
            let mut before = self.samples.input[segment.start];
            for k in segment.clone() {
                let u = self.samples.input[k];
                columns[(k, 0)] = u;
                columns[(k, 1)] = (u - before) / self.samples.period_of(i);
                columns[(k, 2)] = self.kind.value(values[0] * u);
                before = u;
            }
        }
        Ok(())
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        let p = ActivationParams { k0: linear[0], alpha: linear[1], beta: linear[2], gamma: values[0] };
        match self.kind {
            ActivationKind::Atan => Base::Atan(p),
            ActivationKind::Sigmoid => Base::Sigmoid(p),
            ActivationKind::Softplus => Base::Softplus(p),
            ActivationKind::Softsign => Base::Softsign(p),
            ActivationKind::Tanh => Base::Tanh(p),
        }
    }
}
