//! The generalised Prandtl-Ishlinskii model with linear envelopes: linear in its weights, nonlinear in the envelopes.

use hyst_core::{Build, Curve, Error, Gpi, GpiParams};
use nalgebra::DMatrix;

use crate::Samples;
use crate::identify::family::{largest_input, run_into};
use crate::identify::{Family, Linear};
use crate::model::Base;
use crate::model::capacity::PLAYS;
use crate::optimize::Variable;

/// The left envelope `γ = u − g/2` sets the unit of γ; the right one is `γ = s u + g/2`. Thresholds are even over the
/// range.
pub(super) struct GpiFamily<'a> {
    samples: &'a Samples,
    thresholds: Vec<f64>,
}

impl<'a> GpiFamily<'a> {
    pub(super) fn new(samples: &'a Samples, plays: usize) -> Self {
        let (low, high) = samples.input_range();
        let plays = plays.min(PLAYS);
        // A play operator as wide as half the range slides only once.
        let top = 0.5 * (high - low).max(0.2 * largest_input(samples));
        let thresholds = (1..=plays).map(|i| top * i as f64 / (plays + 1) as f64).collect();
        Self { samples, thresholds }
    }

    fn params<L>(&self, values: &[f64], gain: f64, thresholds: L, weights: L) -> GpiParams<L> {
        let (slope, gap) = (values[0], values[1]);
        GpiParams {
            left: Curve::Linear { slope: 1.0, offset: -0.5 * gap },
            right: Curve::Linear { slope, offset: 0.5 * gap },
            gain,
            thresholds,
            weights,
        }
    }
}

impl Family for GpiFamily<'_> {
    fn variables(&self) -> Vec<Variable> {
        let u = largest_input(self.samples);
        vec![Variable::log("right.linear.slope", "1/u", 0.5, 2.0), Variable::linear("gap", "", 0.0, 0.3 * u)]
    }

    fn linear(&self) -> Vec<Linear> {
        let mut list = vec![Linear::not_negative("gain")];
        list.extend((0..self.thresholds.len()).map(|i| Linear::not_negative(&format!("weights[{i}]"))));
        list
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        let none: &[f64] = &[];
        let first = self.params(values, 1.0, none, none);
        run_into(self.samples, |_| Build::<Gpi<f64, 1>>::build(&first, &()), columns, 0)?;
        for (i, r) in self.thresholds.iter().enumerate() {
            let (thresholds, weights) = ([*r], [1.0]);
            let play = self.params(values, 0.0, &thresholds[..], &weights[..]);
            run_into(self.samples, |_| Build::<Gpi<f64, 1>>::build(&play, &()), columns, i + 1)?;
        }
        Ok(())
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        Base::Gpi(self.params(values, linear[0], self.thresholds.clone(), linear[1..].to_vec()))
    }

    /// Weights are parts of one curve.
    fn scale(&self, base: &Base, name: &str) -> Option<f64> {
        match base {
            Base::Gpi(p) if name.starts_with("weights") => Some(p.gain.abs().max(p.weights.iter().sum())),
            _ => None,
        }
    }
}
