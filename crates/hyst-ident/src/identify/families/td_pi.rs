//! TD-PI: linear only in ε. α is one: a scale of α and the envelopes has no effect on the output.

use hyst_core::{Build, Error, TdPi, TdPiParams};
use nalgebra::DMatrix;

use crate::Samples;
use crate::identify::family::{largest_input, run_into};
use crate::identify::{Family, Linear, OtherParameter};
use crate::model::Base;
use crate::model::capacity::PLAYS;
use crate::optimize::Variable;

pub(super) struct TdPiFamily<'a> {
    samples: &'a Samples,
    plays: usize,
    reference_degc: f64,
}

impl<'a> TdPiFamily<'a> {
    /// T₀ is the lowest temperature of the record, rounded to one degree.
    pub(super) fn new(samples: &'a Samples, plays: usize) -> Self {
        let lowest = samples.temperature.as_ref().map_or(23.0, |t| crate::statistics::range(t.iter().copied()).0);
        Self { samples, plays: plays.min(PLAYS), reference_degc: lowest.round() }
    }

    fn params(&self, values: &[f64], epsilon: f64) -> TdPiParams {
        let [tau, eta, a0, a1, b0, b1] = [0, 1, 2, 3, 4, 5].map(|i| values.get(i).copied().unwrap_or(0.0));
        TdPiParams {
            alpha: 1.0,
            epsilon,
            tau,
            eta,
            a0,
            a1,
            b0,
            b1,
            plays: self.plays as u16,
            reference_degc: self.reference_degc,
        }
    }
}

impl Family for TdPiFamily<'_> {
    /// The envelopes map the input range to between one threshold and twice all of them.
    fn variables(&self) -> Vec<Variable> {
        let (u, n) = (largest_input(self.samples), self.plays as f64);
        vec![
            Variable::log("tau", "", 0.01, 5.0),
            Variable::linear("eta", "1/K", -0.05, 0.05),
            Variable::log("a0", "1/u", 1.0 / u, 2.0 * n / u),
            Variable::linear("a1", "", -0.5 * n, 0.5 * n),
            Variable::log("b0", "1/u", 1.0 / u, 2.0 * n / u),
            Variable::linear("b1", "", -0.5 * n, 0.5 * n),
        ]
    }

    fn linear(&self) -> Vec<Linear> {
        vec![Linear::not_negative("epsilon")]
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        let params = self.params(values, 1.0);
        run_into(self.samples, |_| Build::<TdPi<f64, PLAYS>>::build(&params, &()), columns, 0)
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        Base::TdPi(self.params(values, linear[0]))
    }

    fn other_parameter(&self, name: &str) -> OtherParameter {
        if name == "alpha" { OtherParameter::Convention } else { OtherParameter::Given }
    }

    fn scale(&self, base: &Base, name: &str) -> Option<f64> {
        match (base, name) {
            // Offsets are lengths along γ, like α; η is small without being undetermined.
            (Base::TdPi(p), "a1" | "b1") => Some(p.alpha),
            (_, "eta") => Some(0.01),
            _ => None,
        }
    }
}
