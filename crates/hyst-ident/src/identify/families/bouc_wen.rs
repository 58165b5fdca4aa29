//! Bouc-Wen. With g = α w, the memory w depends only on β |α|ⁿ⁻¹, γ/β and n, and the output is linear in k₀ and α.

use hyst_core::{BoucWen, BoucWenParams, Build, Error};
use nalgebra::DMatrix;

use crate::Samples;
use crate::identify::family::{largest_input, run_into};
use crate::identify::{Family, Linear};
use crate::model::Base;
use crate::optimize::Variable;

pub(super) struct BoucWenFamily<'a> {
    samples: &'a Samples,
    n: Option<f64>,
}

impl<'a> BoucWenFamily<'a> {
    pub(super) fn new(samples: &'a Samples, n: Option<f64>) -> Self {
        Self { samples, n }
    }

    /// Returns β |α|ⁿ⁻¹, the ratio γ sgn(α) / β, and n.
    fn shape(&self, values: &[f64]) -> (f64, f64, f64) {
        (values[0], values[1], self.n.unwrap_or_else(|| values[2]))
    }
}

impl Family for BoucWenFamily<'_> {
    /// The memory saturates between a thousandth and a thousand times the record's range.
    fn variables(&self) -> Vec<Variable> {
        let u = largest_input(self.samples);
        let mut list = vec![
            Variable::log("beta |alpha|^(n-1)", "", 1e-3 / u, 1e3 / u),
            Variable::linear("gamma/beta", "", -1.0, 1.0),
        ];
        if self.n.is_none() {
            list.push(Variable::linear("n", "", 1.0, 4.0));
        }
        list
    }

    fn linear(&self) -> Vec<Linear> {
        ["k0", "alpha"].map(Linear::free).to_vec()
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        let (beta, ratio, n) = self.shape(values);
        let params = BoucWenParams { k0: 0.0, alpha: 1.0, beta, gamma: ratio * beta, n };
        columns.column_mut(0).copy_from_slice(&self.samples.input);
        run_into(self.samples, |_| Build::<BoucWen<f64>>::build(&params, &()), columns, 1)
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        let (shape, ratio, n) = self.shape(values);
        let (k0, alpha) = (linear[0], linear[1]);
        let beta = if alpha == 0.0 { 0.0 } else { shape * alpha.abs().powf(1.0 - n) };
        Base::BoucWen(BoucWenParams { k0, alpha, beta, gamma: ratio * beta * alpha.signum(), n })
    }

    /// The scale of γ is β.
    fn scale(&self, base: &Base, name: &str) -> Option<f64> {
        match (base, name) {
            (Base::BoucWen(p), "beta" | "gamma") => Some(p.beta),
            _ => None,
        }
    }
}
