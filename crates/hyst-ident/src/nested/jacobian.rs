//! The derivatives of the output with respect to the nonlinear parameters, and their part of the normal equations.

use std::sync::Arc;

use hyst_core::{Error, HARMONIC_PARTS};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::assembly::Assembly;
use super::bounds::stepped;
use super::motion::Point;
use super::{Cause, Hypothesis, Problem, SignalPath};
use crate::lsq::{Bordered, Gram, Share};
use crate::model::Effect;
use crate::statistics::range;

impl Problem<'_> {
    /// Returns the derivatives of the output with respect to every nonlinear parameter in the rows that count, by
    /// forward differences.
    pub(super) fn jacobian(&self, h: &Hypothesis, solution: &DVector<f64>) -> Result<Vec<Vec<f64>>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let point = self.point_at(h, &path, solution);
        let all: Vec<usize> = (0..h.nonlinear().len()).collect();
        self.jacobian_at(h, &path, &point, &all)
    }

    /// Returns the derivatives for the parameters with these indices, around a given motion.
    pub(super) fn jacobian_at(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        point: &Point,
        of: &[usize],
    ) -> Result<Vec<Vec<f64>>, Error> {
        let Point { operator, motion, solution } = point;
        let here = self.at_used_rows(|k| path.saturated(motion[k]).0);
        let reached = range(here.iter().copied());
        let column = |at: usize| -> Result<Vec<f64>, Error> {
            let Some((moved, step, cause)) = stepped(h, at, self.samples, reached).filter(|(_, step, _)| *step != 0.0)
            else {
                return Ok(vec![0.0; here.len()]);
            };
            if cause == Cause::Effect(Effect::Drift) {
                let drift = h.effects.drift.unwrap_or_default();
                let height = solution[self.layout(h).drift.start + 1];
                let passed = |k: usize| ((self.samples.time[k] - drift.since_s) / drift.seconds).max(0.0);
                return Ok(self.at_used_rows(|k| -height * passed(k) / drift.seconds * (-passed(k)).exp()));
            }
            if cause == Cause::Effect(Effect::Interference) {
                let first = self.layout(h).tone.start;
                let parts = &solution.as_slice()[first..first + 2 + HARMONIC_PARTS];
                let tone = h.effects.interference.unwrap_or_default();
                let slope = |t: f64| {
                    let angle = 2.0 * std::f64::consts::PI * (tone.hz * t).fract();
                    let of = |(i, parts): (usize, &[f64])| {
                        let order = (i + 1) as f64;
                        let (sine, cosine) = (order * angle).sin_cos();
                        order * (parts[0] * cosine - parts[1] * sine)
                    };
                    let turned: f64 = parts.chunks_exact(2).enumerate().map(of).sum();
                    2.0 * std::f64::consts::PI * (t - self.samples.time[0]) * turned
                };
                return Ok(self.at_used_rows(|k| slope(self.samples.time[k])));
            }
            let path = SignalPath::new(self.samples, &moved)?;
            // Stages behind the operator do not change its output.
            let there = match moved.has_same_drive(h) {
                true => self.point(&moved, &path, operator.clone(), solution),
                false => self.point_at(&moved, &path, solution),
            };
            let there = self.at_used_rows(|k| path.saturated(there.motion[k]).0);
            Ok(there.iter().zip(&here).map(|(a, b)| (a - b) / step).collect())
        };
        // Of several errors the first one, independent of the order of the threads.
        let columns: Vec<Result<Vec<f64>, Error>> = of.par_iter().map(|at| column(*at)).collect();
        columns.into_iter().collect()
    }

    /// Returns the normal equations of an assembly with the columns of the Jacobian inserted before the target.
    pub(super) fn with_jacobian(&self, assembly: &Assembly, jacobian: &[Vec<f64>]) -> Gram {
        let mut bordered = Bordered::zeros(assembly.linear.total.matrix.ncols(), jacobian.len());
        assembly.linear.blocks.iter().zip(self.in_blocks(jacobian)).for_each(|(x, j)| bordered.add(x, &j));
        bordered.around(&assembly.linear.total)
    }

    /// Returns the same for each block, as the shares of a fit.
    pub(super) fn shares(&self, assembly: &Assembly, jacobian: &[Vec<f64>]) -> Arc<[Share]> {
        let jacobian: Vec<DMatrix<f64>> = self.in_blocks(jacobian).collect();
        let of = |(x, j): (&DMatrix<f64>, &DMatrix<f64>)| {
            // The target stays the last column.
            let (linear, further) = (x.ncols() - 1, j.ncols());
            let mut rows = x.clone().insert_columns(linear, further, 0.0);
            rows.columns_mut(linear, further).copy_from(j);
            Share::of(rows)
        };
        assembly.linear.blocks.par_iter().zip(&jacobian).map(of).collect::<Vec<_>>().into()
    }
}
