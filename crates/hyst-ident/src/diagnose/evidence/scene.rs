//! What the pictures are drawn from: the record, and the predictions with and without an effect.

use std::ops::Range;

use super::picture::Axis;
use crate::Samples;
use crate::model::{Effect, Model};
use crate::record::Record;
use crate::simulate::{Simulation, Zero};

/// Name of the extended model's curve in every picture.
pub(super) const WITH: &str = "with it";
/// Name of the curve of the same model without the effect.
pub(super) const WITHOUT: &str = "without it";
/// Name of the curve that follows from the named effect's parameters.
pub(super) const NAMED: &str = "as named";

/// Inputs of the evidence.
pub(crate) struct Material<'a> {
    pub(crate) extended: &'a Model,
    pub(crate) named: &'a [Effect],
    pub(crate) train: &'a Record,
    pub(crate) test: Option<&'a Record>,
    pub(crate) before: &'a Simulation,
    pub(crate) after: &'a Simulation,
    pub(crate) tests: Option<&'a (Simulation, Simulation)>,
    pub(crate) zero: Zero,
    pub(crate) noise: f64,
}

/// The training record with the predictions of two models.
pub(in crate::diagnose) struct Scene<'a> {
    pub(super) samples: Samples,
    pub(super) without: View,
    pub(super) with: View,
    /// Symbol of the output's unit.
    pub(super) unit: &'a str,
    pub(super) drive_unit: &'a str,
    /// Noise floor \[output unit\].
    pub(super) noise: f64,
}

impl Scene<'_> {
    /// Returns the rows that are no start-up rows.
    pub(super) fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.samples.len()).filter(|k| !self.samples.settling[*k])
    }

    /// Returns an axis for the residual.
    pub(super) fn residual_axis(&self) -> Axis {
        Axis::new("measured − predicted", self.unit)
    }
}

/// Prediction of one model.
pub(super) struct View {
    pub(super) predicted: Vec<f64>,
    /// Measured − predicted.
    pub(super) residual: Vec<f64>,
}

impl View {
    pub(super) fn of(samples: &Samples, simulation: &Simulation) -> Self {
        let residual = samples.output.iter().zip(&simulation.predicted).map(|(y, p)| y - p).collect();
        Self { predicted: simulation.predicted.clone(), residual }
    }
}

/// Returns the segments without their start-up rows.
pub(super) fn settled_segments(samples: &Samples) -> Vec<Range<usize>> {
    let settled = |s: &Range<usize>| {
        let unsettled = samples.settling[s.clone()].iter().rposition(|settling| *settling).map_or(0, |last| last + 1);
        s.start + unsettled..s.end
    };
    samples.segments.iter().map(settled).collect()
}
