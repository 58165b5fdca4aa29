//! The linear unknowns at one set of nonlinear parameters.

use std::ops::Range;

use hyst_core::Error;
use nalgebra::{DMatrix, DVector};

use super::columns::BaseColumns;
use super::{HATS, Hypothesis, Layout, Problem, SignalPath};
use crate::lsq::{Gram, solve_near};

/// Rounds in which what bends the output is solved, each linear around the one before.
const ROUNDS: usize = 4;
/// Rounds from a point that is nearly right.
const ROUNDS_NEAR: usize = 2;

/// Columns and solution at one set of nonlinear parameters.
pub(super) struct Assembly {
    /// Rows of each block: the linear unknowns, measured output.
    pub(super) blocks: Vec<DMatrix<f64>>,
    pub(super) grams: Vec<Gram>,
    pub(super) total: Gram,
    pub(super) solution: DVector<f64>,
    pub(super) objective: f64,
    /// Where a bent output was taken as linear.
    pub(super) point: Option<Point>,
}

/// A course of the motion around which the output is linear in the unknowns.
#[derive(Clone)]
pub(super) struct Point {
    /// Output of the operator \[y\].
    pub(super) operator: Vec<f64>,
    /// Motion before the stop \[y\].
    pub(super) motion: Vec<f64>,
    /// The unknowns that it comes from.
    pub(super) solution: DVector<f64>,
}

/// What a dead zone of an asymmetry adds for each unit of its weight.
pub(super) fn dead_zone(v: f64, threshold: f64) -> f64 {
    if threshold >= 0.0 { (v - threshold).max(0.0) } else { (v - threshold).min(0.0) }
}

/// By how much that changes with what enters it.
pub(super) fn dead_zone_slope(v: f64, threshold: f64) -> f64 {
    let beyond = if threshold >= 0.0 { v > threshold } else { v < threshold };
    f64::from(u8::from(beyond))
}

/// Height of the hat with number `j` of a wandering at a share of the record's rows.
fn hat(j: usize, share: f64) -> f64 {
    (1.0 - (share * (HATS - 1) as f64 - j as f64).abs()).max(0.0)
}

impl Problem<'_> {
    pub(super) fn layout(&self, h: &Hypothesis) -> Layout {
        Layout::of(h, self.width, self.zeros())
    }

    /// Solves for the linear unknowns, from `near` if there is a point that is nearly right.
    pub(super) fn assemble(&self, h: &Hypothesis, near: Option<&Point>) -> Result<Option<Assembly>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let base = self.columns(&path, h);
        if !h.is_bent() {
            return Ok(self.round(h, &path, &base, None));
        }
        let mut point = match near {
            Some(point) => point.clone(),
            None => {
                let Some(point) = self.first_point(h, &path, &base)? else { return Ok(None) };
                point
            }
        };
        let mut last = None;
        for _ in 0..if near.is_some() { ROUNDS_NEAR } else { ROUNDS } {
            let Some(round) = self.round(h, &path, &base, Some(point)) else { return Ok(None) };
            point = self.point(h, &path, &base, &round.solution);
            last = Some(round);
        }
        Ok(last)
    }

    /// The straight model's motion; where the output stands in the knee of a stop, the motion that would show it.
    fn first_point(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        base: &BaseColumns<'_>,
    ) -> Result<Option<Point>, Error> {
        let mut straight = h.clone();
        (straight.effects.asymmetry, straight.effects.saturation, straight.gain_wanders) = (None, None, false);
        let plain = SignalPath::new(self.samples, &straight)?;
        let Some(first) = self.round(&straight, &plain, base, None) else { return Ok(None) };
        let mut point = self.point(&straight, &plain, base, &first.solution);
        if h.effects.saturation.is_some() {
            let zero = &first.solution.as_slice()[self.layout(&straight).zeros];
            for (segment, file) in self.samples.segments.iter().zip(&self.samples.file_of_segment) {
                let zero = zero[if self.zero_per_file { *file } else { 0 }];
                for k in segment.clone() {
                    point.motion[k] = path.unstopped(self.samples.output[k] - zero);
                }
            }
        }
        Ok(Some(point))
    }

    /// The course of the motion for a solution.
    pub(super) fn point(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        base: &BaseColumns<'_>,
        z: &DVector<f64>,
    ) -> Point {
        let layout = self.layout(h);
        let z = z.as_slice();
        let operator = base.combined(&z[layout.weights], self.samples.len());
        let mut motion = operator.clone();
        if let Some(p) = &h.effects.asymmetry {
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
        Point { operator, motion, solution: DVector::from_column_slice(z) }
    }

    /// One solution, linear around `point`.
    fn round(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        base: &BaseColumns<'_>,
        point: Option<Point>,
    ) -> Option<Assembly> {
        let layout = self.layout(h);
        let width = layout.len() + 1;
        let rows: Vec<Vec<usize>> =
            (0..self.blocks.rows.len()).map(|b| self.blocks.used(b, self.samples).collect()).collect();
        let mut blocks: Vec<DMatrix<f64>> = rows.iter().map(|r| DMatrix::zeros(r.len(), width)).collect();
        let mut put = |c: usize, column: &[f64]| {
            for (block, rows) in blocks.iter_mut().zip(&rows) {
                for (x, k) in block.column_mut(c).iter_mut().zip(rows) {
                    *x = column[*k];
                }
            }
        };
        // Behind a stop the output follows the motion by less, or not at all.
        let stopped: Option<Vec<(f64, f64)>> = match &point {
            Some(p) if h.effects.saturation.is_some() => Some(p.motion.iter().map(|m| path.stopped(*m)).collect()),
            _ => None,
        };
        let slowed = |column: &mut [f64]| {
            if let Some(stopped) = &stopped {
                column.iter_mut().zip(stopped).for_each(|(x, (_, slope))| *x *= slope);
            }
        };
        base.each(&mut |c, column| {
            path.output_side(column);
            slowed(column);
            put(layout.weights.start + c, column);
        });
        let mut filtered: Vec<f64>;
        for (c, column) in (layout.zeros.start..).zip(self.extras(h)) {
            put(c, &column);
        }
        if let (Some(c), Some(mut load)) = (layout.load.clone().next(), self.samples.load.clone()) {
            path.structure(&mut load);
            slowed(&mut load);
            put(c, &load);
        }
        if let (Some(p), Some(point)) = (&h.effects.asymmetry, &point) {
            for (c, s) in layout.zones.clone().zip(&p.thresholds) {
                filtered = point.operator.iter().map(|v| dead_zone(*v, *s)).collect();
                path.output_side(&mut filtered);
                slowed(&mut filtered);
                put(c, &filtered);
            }
        }
        let n = self.samples.len();
        let share = |k: usize| k as f64 / n.max(2) as f64;
        for (j, c) in layout.zero_hats.clone().enumerate() {
            filtered = (0..n).map(|k| hat(j, share(k))).collect();
            put(c, &filtered);
        }
        if let Some(point) = &point {
            for (j, c) in layout.gain_hats.clone().enumerate() {
                filtered = point.motion.iter().enumerate().map(|(k, m)| hat(j, share(k)) * m).collect();
                put(c, &filtered);
            }
        }
        let mut target = self.samples.output.clone();
        if let (Some(stopped), Some(point)) = (&stopped, &point) {
            for (y, ((value, slope), m)) in target.iter_mut().zip(stopped.iter().zip(&point.motion)) {
                *y += slope * m - value;
            }
        }
        put(width - 1, &target);
        let grams: Vec<Gram> = blocks.iter().map(|x| Gram { matrix: x.transpose() * x, rows: x.nrows() }).collect();
        let total = Gram::sum(width, grams.iter());
        let penalty = self.penalty(width - 1);
        let near = point.as_ref().map(|p| &p.solution).filter(|z| z.len() == width - 1);
        let solution = solve_near(&total, Some(&penalty), &self.bounds(h), near)?;
        let objective = total.error(&solution) + (solution.transpose() * &penalty * &solution)[(0, 0)];
        Some(Assembly { blocks, grams, total, solution, objective, point })
    }

    /// How far what wanders in time has wandered in a row, from the heights of its hats.
    pub(super) fn wandering(&self, heights: &[f64], row: usize) -> f64 {
        let share = row as f64 / self.samples.len().max(2) as f64;
        heights.iter().enumerate().map(|(j, height)| height * hat(j, share)).sum()
    }

    /// Measured minus predicted output, all rows.
    pub(super) fn residual_of(&self, h: &Hypothesis, z: &DVector<f64>) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let base = self.columns(&path, h);
        let layout = self.layout(h);
        let motion = self.point(h, &path, &base, z).motion;
        let extras = self.extras(h);
        let n = self.samples.len();
        let z = z.as_slice();
        let wanders = |hats: &Range<usize>, k| self.wandering(&z[hats.clone()], k);
        Ok((0..n)
            .map(|k| {
                let beside: f64 = extras.iter().zip(&z[layout.zeros.start..]).map(|(c, z)| z * c[k]).sum();
                let wandering = wanders(&layout.zero_hats, k) + motion[k] * wanders(&layout.gain_hats, k);
                self.samples.output[k] - path.stopped(motion[k]).0 - beside - wandering
            })
            .collect())
    }

    /// Columns of zeros, drift and tone.
    fn extras(&self, h: &Hypothesis) -> Vec<Vec<f64>> {
        let s = self.samples;
        let mut columns = vec![vec![0.0; s.len()]; self.zeros()];
        for (segment, file) in s.segments.iter().zip(&s.file_of_segment) {
            let column = &mut columns[if self.zero_per_file { *file } else { 0 }];
            column[segment.clone()].fill(1.0);
        }
        if h.effects.drift.is_some() {
            columns.push(s.time.iter().map(|t| t - s.time[0]).collect());
        }
        if let Some(tone) = &h.effects.interference {
            let angle = |t: &f64| 2.0 * std::f64::consts::PI * (tone.hz * t).fract();
            columns.push(s.time.iter().map(|t| angle(t).sin()).collect());
            columns.push(s.time.iter().map(|t| angle(t).cos()).collect());
        }
        columns
    }
}
