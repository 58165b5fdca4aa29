//! Columns and solution of the linear unknowns at one set of nonlinear parameters.

use std::ops::Range;

use hyst_core::{CurveSide, Error, HARMONIC_PARTS};
use nalgebra::{DMatrix, DVector};

use super::columns::BaseColumns;
use super::{HATS, Hypothesis, Layout, Problem, SignalPath, initial};
use crate::lsq::{Gram, solve_near};

/// Number of rounds in which an output that is nonlinear in the weights is solved, each linearised around the previous
/// one.
const ROUNDS: usize = 4;
/// Number of rounds from a start that is nearly right.
const ROUNDS_NEAR: usize = 2;

/// Columns and solution at one set of nonlinear parameters.
pub(super) struct Assembly {
    /// Rows of each block: the linear unknowns, then the measured output.
    pub(super) blocks: Vec<DMatrix<f64>>,
    /// Normal equations of all blocks together.
    pub(super) total: Gram,
    pub(super) solution: DVector<f64>,
    pub(super) objective: f64,
    /// Linearisation point of an output that is nonlinear in the weights.
    pub(super) point: Option<Point>,
}

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
pub(super) fn dead_zone_slope(v: f64, threshold: f64) -> f64 {
    let beyond = if threshold >= 0.0 { v > threshold } else { v < threshold };
    f64::from(u8::from(beyond))
}

/// Returns the value of hat function `j` of a wander at a fraction of the record's rows.
pub(crate) fn hat(j: usize, share: f64) -> f64 {
    (1.0 - (share * (HATS - 1) as f64 - j as f64).abs()).max(0.0)
}

impl Problem<'_> {
    pub(super) fn layout(&self, h: &Hypothesis) -> Layout {
        Layout::of(h, self.width, self.zeros(), initial::count(self.samples, h))
    }

    /// Solves for the linear unknowns, starting from `near` if a nearly right assembly is known.
    pub(super) fn assemble(&self, h: &Hypothesis, near: Option<&Assembly>) -> Result<Option<Assembly>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let base = self.columns(&path, h);
        if !h.is_nonlinear_in_weights() {
            return Ok(self.round(h, &path, &base, None, near.map(|n| &n.solution)));
        }
        let near = near.and_then(|n| n.point.as_ref());
        let mut point = match near {
            Some(point) => point.clone(),
            None => {
                let Some(point) = self.first_point(h, &path, &base)? else { return Ok(None) };
                point
            }
        };
        for _ in 1..if near.is_some() { ROUNDS_NEAR } else { ROUNDS } {
            let Some(round) = self.round(h, &path, &base, Some(point), None) else { return Ok(None) };
            point = self.point(h, &path, self.combined(h, &path, &base, &round.solution), &round.solution);
        }
        Ok(self.round(h, &path, &base, Some(point), None))
    }

    /// Returns the output of the operator for a solution.
    fn combined(&self, h: &Hypothesis, path: &SignalPath<'_>, base: &BaseColumns<'_>, z: &DVector<f64>) -> Vec<f64> {
        let layout = self.layout(h);
        let mut operator = base.combined(&z.as_slice()[layout.weights], self.samples.len());
        path.widen(&mut operator, &z.as_slice()[layout.widening]);
        operator
    }

    /// Returns the motion of the linear model; in the knee of a saturation, the motion that would show the measured
    /// output.
    fn first_point(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        base: &BaseColumns<'_>,
    ) -> Result<Option<Point>, Error> {
        let mut straight = h.clone();
        (straight.effects.asymmetry, straight.effects.saturation, straight.gain_wanders) = (None, None, false);
        let plain = SignalPath::new(self.samples, &straight)?;
        let Some(first) = self.round(&straight, &plain, base, None, None) else { return Ok(None) };
        let operator = self.combined(&straight, &plain, base, &first.solution);
        let mut point = self.point(&straight, &plain, operator, &first.solution);
        if h.effects.saturation.is_some() {
            let zero = &first.solution.as_slice()[self.layout(&straight).zeros];
            for (segment, file) in self.samples.segments.iter().zip(&self.samples.file_of_segment) {
                let zero = zero[if self.zero_per_file { *file } else { 0 }];
                for k in segment.clone() {
                    point.motion[k] = path.unsaturated(self.samples.output[k] - zero);
                }
            }
        }
        Ok(Some(point))
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
        if let (Some(c), Some(mut deflection)) = (z[layout.load].first(), self.samples.load.clone()) {
            path.structure(&mut deflection);
            motion.iter_mut().zip(&deflection).for_each(|(m, d)| *m += c * d);
        }
        if let (Some(c), Some(shift)) = (z[layout.expansion].first(), path.expansion()) {
            motion.iter_mut().zip(&shift).for_each(|(m, d)| *m += c * d);
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

    /// Solves once, linearised around `point`. The search for the active bounds starts from those at `near`.
    fn round(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        base: &BaseColumns<'_>,
        point: Option<Point>,
        near: Option<&DVector<f64>>,
    ) -> Option<Assembly> {
        let layout = self.layout(h);
        let width = layout.len() + 1;
        let mut blocks: Vec<DMatrix<f64>> = self.used.iter().map(|r| DMatrix::zeros(r.len(), width)).collect();
        let mut put = |c: usize, column: Vec<f64>| {
            let mut rest = column.as_slice();
            for block in &mut blocks {
                let (own, others) = rest.split_at(block.nrows());
                block.column_mut(c).copy_from_slice(own);
                rest = others;
            }
        };
        // Near a saturation limit the output follows the motion with a smaller slope or not at all.
        let saturated: Option<Vec<(f64, f64)>> = match &point {
            Some(p) if h.effects.saturation.is_some() => Some(self.at_used_rows(|k| path.saturated(p.motion[k]))),
            _ => None,
        };
        let scaled = |column: &[f64]| {
            let mut at_used_rows = self.at_used_rows(|k| column[k]);
            if let Some(saturated) = &saturated {
                at_used_rows.iter_mut().zip(saturated).for_each(|(x, (_, slope))| *x *= slope);
            }
            at_used_rows
        };
        let columns = base.map(|mut columns| {
            path.output_side_of(&mut columns);
            columns.iter().map(|column| scaled(column)).collect::<Vec<_>>()
        });
        for (c, column) in layout.weights.clone().zip(columns.into_iter().flatten()) {
            put(c, column);
        }
        for (c, column) in self.other_columns(h, path, point.as_ref(), &scaled) {
            put(c, column);
        }
        let mut target = self.at_used_rows(|k| self.samples.output[k]);
        if let (Some(saturated), Some(point)) = (&saturated, &point) {
            let motion = self.at_used_rows(|k| point.motion[k]);
            for (y, ((value, slope), m)) in target.iter_mut().zip(saturated.iter().zip(motion)) {
                *y += slope * m - value;
            }
        }
        put(width - 1, target);
        let total = Gram::of_all(&blocks, width);
        let penalty = self.penalty(h, &total, width - 1);
        let near = point.as_ref().map(|p| &p.solution).or(near).filter(|z| z.len() == width - 1);
        let solution = solve_near(&total, Some(&penalty), &self.bounds(h), near)?;
        let objective = total.error(&solution) + (solution.transpose() * &penalty * &solution)[(0, 0)];
        Some(Assembly { blocks, total, solution, objective, point })
    }

    /// Returns the columns of all linear unknowns except the weights of the base in the rows that count, each with its
    /// position. Columns of the motion pass through `scaled`.
    pub(super) fn other_columns(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        point: Option<&Point>,
        scaled: &dyn Fn(&[f64]) -> Vec<f64>,
    ) -> Vec<(usize, Vec<f64>)> {
        let layout = self.layout(h);
        let mut columns: Vec<(usize, Vec<f64>)> = Vec::new();
        let sensor_columns = self.sensor_columns(h).into_iter().map(|column| self.at_used_rows(|k| column[k]));
        columns.extend((layout.zeros.start..).zip(sensor_columns));
        if let (Some(c), Some(mut load)) = (layout.load.clone().next(), self.samples.load.clone()) {
            path.structure(&mut load);
            columns.push((c, scaled(&load)));
        }
        if let (Some(c), Some(shift)) = (layout.expansion.clone().next(), path.expansion()) {
            columns.push((c, scaled(&shift)));
        }
        let mut wider = path.widening().to_vec();
        path.output_side_of(&mut wider);
        columns.extend(layout.widening.clone().zip(&wider).map(|(c, column)| (c, scaled(column))));
        if let (Some(p), Some(point)) = (h.effects.curve(CurveSide::Output), point) {
            let bend = |s: f64| point.operator.iter().map(|v| dead_zone(*v, s)).collect();
            let mut zones: Vec<Vec<f64>> = p.thresholds.iter().map(|s| bend(*s)).collect();
            path.output_side_of(&mut zones);
            columns.extend(layout.zones.clone().zip(&zones).map(|(c, zone)| (c, scaled(zone))));
        }
        let share = |k: usize| k as f64 / self.samples.len().max(2) as f64;
        for (j, c) in layout.zero_hats.clone().enumerate() {
            columns.push((c, self.at_used_rows(|k| hat(j, share(k)))));
        }
        if let Some(point) = point {
            for (j, c) in layout.gain_hats.clone().enumerate() {
                columns.push((c, self.at_used_rows(|k| hat(j, share(k)) * point.motion[k])));
            }
        }
        for (c, column) in layout.initial.clone().zip(initial::columns(self.samples, h)) {
            columns.push((c, scaled(&column)));
        }
        columns
    }

    /// Returns the values of `of` in the rows that count, block by block.
    pub(super) fn at_used_rows<T>(&self, of: impl Fn(usize) -> T) -> Vec<T> {
        self.used.iter().flatten().map(|k| of(*k)).collect()
    }

    /// Returns the wander in a row, from the heights of its hat functions.
    pub(super) fn wandering(&self, heights: &[f64], row: usize) -> f64 {
        let share = row as f64 / self.samples.len().max(2) as f64;
        heights.iter().enumerate().map(|(j, height)| height * hat(j, share)).sum()
    }

    /// Returns measured minus predicted output in all rows.
    pub(super) fn residual_of(&self, h: &Hypothesis, z: &DVector<f64>) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let motion = self.point_at(h, &path, z).motion;
        Ok(self.residual_along(h, &path, &motion, z))
    }

    /// Returns the same for a known motion.
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

    /// Returns the columns of zeros, drift and tone.
    fn sensor_columns(&self, h: &Hypothesis) -> Vec<Vec<f64>> {
        let s = self.samples;
        let mut columns = vec![vec![0.0; s.len()]; self.zeros()];
        for (segment, file) in s.segments.iter().zip(&s.file_of_segment) {
            let column = &mut columns[if self.zero_per_file { *file } else { 0 }];
            column[segment.clone()].fill(1.0);
        }
        if let Some(drift) = &h.effects.drift {
            columns.push(s.time.iter().map(|t| t - s.time[0]).collect());
            if drift.seconds > 0.0 {
                columns.push(s.time.iter().map(|t| drift.settled(*t)).collect());
            }
        }
        if let Some(tone) = &h.effects.interference {
            let angle = |t: &f64| 2.0 * std::f64::consts::PI * (tone.hz * t).fract();
            for order in (1..=1 + HARMONIC_PARTS / 2).map(|order| order as f64) {
                columns.push(s.time.iter().map(|t| (order * angle(t)).sin()).collect());
                columns.push(s.time.iter().map(|t| (order * angle(t)).cos()).collect());
            }
        }
        columns
    }
}
