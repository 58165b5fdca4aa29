//! Prandtl-Ishlinskii with searched thresholds: linear in the weights, nonlinear in the thresholds.

use hyst_core::{Error, PiParams};
use nalgebra::DMatrix;

use crate::Samples;
use crate::base::play_column;
use crate::identify::{Family, Linear};
use crate::model::Base;
use crate::model::capacity::PLAYS;
use crate::optimize::Variable;

pub(super) struct PiFamily<'a> {
    samples: &'a Samples,
    plays: usize,
}

impl<'a> PiFamily<'a> {
    pub(super) fn new(samples: &'a Samples, plays: usize) -> Self {
        Self { samples, plays: plays.clamp(1, PLAYS) }
    }

    /// Returns the thresholds in increasing order, without duplicates.
    fn thresholds(values: &[f64]) -> Vec<f64> {
        let mut list = values.to_vec();
        list.sort_by(f64::total_cmp);
        for i in 1..list.len() {
            list[i] = list[i].max(list[i - 1] * (1.0 + 1e-9));
        }
        list
    }
}

impl Family for PiFamily<'_> {
    /// Each threshold is between a thousandth and half of the input range.
    fn variables(&self) -> Vec<Variable> {
        let (low, high) = self.samples.input_range();
        let range = high - low;
        (0..self.plays).map(|i| Variable::linear(&format!("thresholds[{i}]"), "u", 1e-3 * range, 0.5 * range)).collect()
    }

    fn linear(&self) -> Vec<Linear> {
        let weights = (0..self.plays).map(|i| Linear::not_negative(&format!("weights[{i}]")));
        std::iter::once(Linear::not_negative("gain")).chain(weights).collect()
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        let s = self.samples;
        columns.column_mut(0).copy_from_slice(&s.input);
        for (i, r) in Self::thresholds(values).into_iter().enumerate() {
            columns.column_mut(i + 1).copy_from_slice(&play_column(&s.input, &s.segments, r));
        }
        Ok(())
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        let weights = linear[1..].to_vec();
        Base::Pi(PiParams { gain: linear[0], thresholds: Self::thresholds(values), weights })
    }

    fn in_order(&self, values: &mut [f64]) {
        values.sort_by(f64::total_cmp);
    }

    /// Weights are parts of one curve.
    fn scale(&self, base: &Base, name: &str) -> Option<f64> {
        match base {
            Base::Pi(p) if name.starts_with("weights") => Some(p.gain + p.weights.iter().sum::<f64>()),
            _ => None,
        }
    }
}
