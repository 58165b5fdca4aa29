//! The motion that a solution predicts, and the residual.

use std::ops::Range;

use hyst_core::{CurveSide, Error};
use nalgebra::DVector;

use super::columns::BaseColumns;
use super::wander::hat;
use super::{Fitted, Hypothesis, Problem, SignalPath, initial};
use crate::Samples;

/// A linearisation point: a course of the motion around which the output is linear in the unknowns.
#[derive(Clone)]
pub(super) struct Point {
    /// Output of the operator \[y\].
    pub(super) operator: Vec<f64>,
    /// Motion before the stop \[y\].
    pub(super) motion: Vec<f64>,
    /// The unknowns that it follows from.
    pub(super) solution: DVector<f64>,
}

/// Returns the output of a dead zone of an asymmetry, for weight one.
pub(crate) fn dead_zone(v: f64, threshold: f64) -> f64 {
    if threshold >= 0.0 { (v - threshold).max(0.0) } else { (v - threshold).min(0.0) }
}

/// Returns its derivative with respect to its input.
fn dead_zone_slope(v: f64, threshold: f64) -> f64 {
    let beyond = if threshold >= 0.0 { v > threshold } else { v < threshold };
    f64::from(u8::from(beyond))
}

impl Problem<'_> {
    /// Returns the output of the operator for a solution.
    pub(super) fn combined(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        base: &BaseColumns<'_>,
        z: &DVector<f64>,
    ) -> Vec<f64> {
        let layout = self.layout(h);
        let mut operator = base.combined(&z.as_slice()[layout.weights], self.samples.len());
        path.widen(&mut operator, &z.as_slice()[layout.widening]);
        operator
    }

    /// Returns the course of the motion for a solution, given the output of the operator.
    pub(super) fn point(&self, h: &Hypothesis, path: &SignalPath<'_>, operator: Vec<f64>, z: &DVector<f64>) -> Point {
        let layout = self.layout(h);
        let z = z.as_slice();
        let mut motion = operator.clone();
        if let Some(p) = h.effects.curve(CurveSide::Output) {
            let zones = || p.thresholds.iter().zip(&z[layout.zones.clone()]);
            for v in &mut motion {
                *v += zones().map(|(s, c)| c * dead_zone(*v, *s)).sum::<f64>();
            }
        }
        path.output_side(&mut motion);
        if let Some(c) = z[layout.load].first()
            && let Some(mut deflection) = self.samples.load.clone()
        {
            path.structure(&mut deflection);
            motion.iter_mut().zip(&deflection).for_each(|(m, d)| *m += c * d);
        }
        if let Some(c) = z[layout.expansion].first()
            && let Some(shift) = path.expansion()
        {
            motion.iter_mut().zip(&shift).for_each(|(m, d)| *m += c * d);
        }
        if let Some(c) = z[layout.direct].first()
            && let Some(beside) = path.direct()
        {
            motion.iter_mut().zip(&beside).for_each(|(m, d)| *m += c * d);
        }
        let relaxations = initial::relaxations(self.samples, h).into_iter();
        relaxations.zip(&z[layout.initial]).for_each(|(of, away)| of.add_to(&mut motion, *away));
        Point { operator, motion, solution: DVector::from_column_slice(z) }
    }

    /// Returns the course of the motion for a solution.
    pub(super) fn point_at(&self, h: &Hypothesis, path: &SignalPath<'_>, z: &DVector<f64>) -> Point {
        let layout = self.layout(h);
        let mut operator = self.operator(path, h, &z.as_slice()[layout.weights]);
        path.widen(&mut operator, &z.as_slice()[layout.widening]);
        self.point(h, path, operator, z)
    }

    /// Returns the slope of the curve behind the operator in each row; `None` without one, or if its weights are not
    /// yet known.
    pub(super) fn bend(&self, h: &Hypothesis, point: &Point) -> Option<Vec<f64>> {
        let (layout, z) = (self.layout(h), point.solution.as_slice());
        let p = h.effects.curve(CurveSide::Output).filter(|_| z.len() >= layout.len())?;
        let zones = || p.thresholds.iter().zip(&z[layout.zones.clone()]);
        let slope = |v: &f64| 1.0 + zones().map(|(s, c)| c * dead_zone_slope(*v, *s)).sum::<f64>();
        Some(point.operator.iter().map(slope).collect())
    }

    /// Returns the motion of the output, without the sensor's zero, drift and tone, and without any wander.
    pub(crate) fn motion(&self, h: &Hypothesis, solution: &DVector<f64>) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let motion = self.point_at(h, &path, solution).motion;
        Ok(motion.into_iter().map(|m| path.saturated(m).0).collect())
    }

    /// Returns the motion that a fit of this problem predicts for other rows, without zero, drift and tone of the
    /// sensor.
    pub(crate) fn motion_in(&self, fit: &Fitted, samples: &Samples) -> Result<Vec<f64>, Error> {
        let over = self.basis.over(samples);
        let there = self.in_rows(samples, over.as_deref().unwrap_or(self.basis));
        // Fewer files have fewer zeros. Zeros are no part of the motion.
        let (solution, _) = self.layout(&fit.hypothesis).mapped(&fit.solution, &there.layout(&fit.hypothesis));
        there.motion(&fit.hypothesis, &solution)
    }

    /// Returns the output of the operator, before any curve behind it.
    pub(crate) fn operator_output(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, &fit.hypothesis)?;
        Ok(self.point_at(&fit.hypothesis, &path, &fit.solution).operator)
    }

    /// Returns measured minus fitted output in all rows.
    pub(crate) fn residual(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        self.residual_of(&fit.hypothesis, &fit.solution)
    }

    /// Returns measured minus predicted output in all rows.
    pub(super) fn residual_of(&self, h: &Hypothesis, z: &DVector<f64>) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let motion = self.point_at(h, &path, z).motion;
        Ok(self.residual_along(h, &path, &motion, z))
    }

    /// Returns measured minus predicted output in all rows, for a known motion.
    pub(super) fn residual_along(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        motion: &[f64],
        z: &DVector<f64>,
    ) -> Vec<f64> {
        let layout = self.layout(h);
        let sensor_columns = self.sensor_columns(h);
        let z = z.as_slice();
        let wanders = |hats: &Range<usize>, k| self.wandering(&z[hats.clone()], k);
        (0..self.samples.len())
            .map(|k| {
                let beside: f64 = sensor_columns.iter().zip(&z[layout.zeros.start..]).map(|(c, z)| z * c[k]).sum();
                let wandering = wanders(&layout.zero_hats, k) + motion[k] * wanders(&layout.gain_hats, k);
                self.samples.output[k] - path.saturated(motion[k]).0 - beside - wandering
            })
            .collect()
    }

    /// Returns the wander in a row, from the heights of its hat functions.
    pub(super) fn wandering(&self, heights: &[f64], row: usize) -> f64 {
        let share = row as f64 / self.samples.len().max(2) as f64;
        heights.iter().enumerate().map(|(j, height)| height * hat(j, share)).sum()
    }

    /// Returns the course of a wandering zero: times \[s\], evenly over the rows of the record, and heights \[y\].
    pub(crate) fn wandered_zero(&self, fit: &Fitted) -> Vec<(f64, f64)> {
        let heights = &fit.solution.as_slice()[self.layout(&fit.hypothesis).zero_hats];
        let (steps, last) = (heights.len().saturating_sub(1).max(1), self.samples.len().saturating_sub(1));
        heights.iter().enumerate().map(|(j, height)| (self.samples.time[j * last / steps], *height)).collect()
    }
}
