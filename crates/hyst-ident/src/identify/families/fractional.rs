//! Fractional models: linear in the gains, nonlinear in c, the orders and the delay.

use hyst_core::{Build, Error, Exponentials, GlOrder, Ifm, IfmParams, Lfdm, LfdmParams, Sampling};
use nalgebra::DMatrix;

use crate::Samples;
use crate::identify::family::run_into;
use crate::identify::{Family, Linear};
use crate::model::Base;
use crate::model::capacity::DELAY;
use crate::optimize::Variable;

/// Memory of a trial: full memory, accurate to 1e-6 of the output's span.
type Memory = Exponentials<f64, 24>;

pub(super) struct LfdmFamily<'a> {
    samples: &'a Samples,
}

impl<'a> LfdmFamily<'a> {
    pub(super) fn new(samples: &'a Samples) -> Self {
        Self { samples }
    }
}

/// Returns c and the orders with the paper's bounds, c on a logarithmic scale.
fn orders() -> Vec<Variable> {
    vec![
        Variable::log("c", "s^beta", 1e-3, 10.0),
        Variable::linear("alpha", "", 0.0, 1.0),
        Variable::linear("beta", "", 0.0, 1.0),
    ]
}

impl Family for LfdmFamily<'_> {
    fn variables(&self) -> Vec<Variable> {
        orders()
    }

    fn linear(&self) -> Vec<Linear> {
        ["a", "b"].map(Linear::not_negative).to_vec()
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        for (column, (a, b)) in [(1.0, 0.0), (0.0, 1.0)].into_iter().enumerate() {
            let p = LfdmParams { a, b, c: values[0], alpha: values[1], beta: values[2], order: GlOrder::First };
            run_into(self.samples, |sampling| Build::<Lfdm<f64, Memory>>::build(&p, sampling), columns, column)?;
        }
        Ok(())
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        let (c, alpha, beta) = (values[0], values[1], values[2]);
        Base::Lfdm(LfdmParams { a: linear[0], b: linear[1], c, alpha, beta, order: GlOrder::First })
    }
}

pub(super) struct IfmFamily<'a> {
    samples: &'a Samples,
}

impl<'a> IfmFamily<'a> {
    pub(super) fn new(samples: &'a Samples) -> Self {
        Self { samples }
    }
}

impl Family for IfmFamily<'_> {
    /// Delays from a tenth of a sample to a tenth of the record, within the capacity of the host's delay stage.
    fn variables(&self) -> Vec<Variable> {
        let h = self.samples.period;
        let longest = (0.1 * self.samples.longest_segment()).min(h * (DELAY as f64 - 4.0)).min(0.1);
        let mut list = orders();
        list.push(Variable::log("tau", "s", 0.1 * h, longest.max(h)));
        list
    }

    fn linear(&self) -> Vec<Linear> {
        ["a", "b", "delta"].map(Linear::not_negative).to_vec()
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        for (column, (a, b)) in [(1.0, 0.0), (0.0, 1.0)].into_iter().enumerate() {
            let (c, alpha, beta, tau) = (values[0], values[1], values[2], values[3]);
            let p = IfmParams { a, b, c, alpha, beta, tau, delta: 0.0, order: GlOrder::First };
            let build = |sampling: &Sampling| Build::<Ifm<f64, Memory, DELAY>>::build(&p, sampling);
            run_into(self.samples, build, columns, column)?;
        }
        columns.column_mut(2).copy_from_slice(&self.samples.input);
        Ok(())
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        let (c, alpha, beta, tau) = (values[0], values[1], values[2], values[3]);
        let (a, b, delta) = (linear[0], linear[1], linear[2]);
        Base::Ifm(IfmParams { a, b, c, alpha, beta, tau, delta, order: GlOrder::First })
    }
}
