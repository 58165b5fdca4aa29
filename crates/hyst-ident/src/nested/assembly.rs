//! Columns and solution of the linear unknowns at one set of nonlinear parameters.

use hyst_core::{CurveSide, Error};
use nalgebra::{DMatrix, DVector};

use super::columns::BaseColumns;
use super::motion::{Point, dead_zone};
use super::wander::hat;
use super::{Hypothesis, Problem, SignalPath, initial};
use crate::lsq::{Bounds, Gram, solve_near};
use crate::statistics::range;

/// Maximum number of rounds in which an output that is nonlinear in the weights is solved.
const MAX_ROUNDS: usize = 12;
/// Number of these in which the step is not halved.
const FULL_ROUNDS: usize = 5;
/// The same from a start that is nearly right.
const MAX_ROUNDS_NEAR: usize = 4;
/// Relative fall of the objective at the next solution below which the rounds end.
const TOLERANCE: f64 = 1e-6;

/// Equations of the linear unknowns at one set of nonlinear parameters.
pub(super) struct Linear {
    /// Rows of each block: the linear unknowns, then the measured output.
    pub(super) blocks: Vec<DMatrix<f64>>,
    /// Normal equations of all blocks together.
    pub(super) total: Gram,
    penalty: DMatrix<f64>,
    bounds: Vec<Bounds>,
    /// Linearisation point of an output that is nonlinear in the weights.
    pub(super) point: Option<Point>,
}

/// The same with their solution.
pub(super) struct Assembly {
    pub(super) linear: Linear,
    pub(super) solution: DVector<f64>,
    pub(super) objective: f64,
}

impl Linear {
    /// Solves the equations. The search for the active bounds starts from those at `near`, or at the linearisation
    /// point.
    fn solved(&self, near: Option<&DVector<f64>>) -> Option<DVector<f64>> {
        let near = self.point.as_ref().map(|p| &p.solution).or(near).filter(|z| z.len() == self.bounds.len());
        solve_near(&self.total, Some(&self.penalty), &self.bounds, near)
    }

    /// Returns Σ residual² and the penalty.
    fn objective(&self, solution: &DVector<f64>) -> f64 {
        self.total.error(solution) + (solution.transpose() * &self.penalty * solution)[(0, 0)]
    }

    fn at(self, solution: DVector<f64>) -> Assembly {
        Assembly { objective: self.objective(&solution), linear: self, solution }
    }
}

/// Returns the assembly with the smaller objective.
fn better(best: Option<Assembly>, other: Assembly) -> Assembly {
    best.filter(|best| best.objective.total_cmp(&other.objective).is_le()).unwrap_or(other)
}

/// Multiplies columns by the slope in each row, if there is one.
pub(super) fn times(columns: &mut [Vec<f64>], slope: Option<&[f64]>) {
    if let Some(slope) = slope {
        columns.iter_mut().for_each(|column| column.iter_mut().zip(slope).for_each(|(x, slope)| *x *= slope));
    }
}

impl Problem<'_> {
    /// Solves for the linear unknowns, starting from `near` if a nearly right assembly is known.
    pub(super) fn assemble(&self, h: &Hypothesis, near: Option<&Assembly>) -> Result<Option<Assembly>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let base = self.columns(&path, h);
        if !h.is_nonlinear_in_weights() {
            let linear = self.linearised(h, &path, &base, None);
            return Ok(linear.solved(near.map(|n| &n.solution)).map(|solution| linear.at(solution)));
        }
        if let Some(point) = near.and_then(|n| n.linear.point.as_ref()) {
            return Ok(self.iterated(h, &path, &base, point.clone(), MAX_ROUNDS_NEAR));
        }
        let starts = self.first_points(h, &path, &base)?.into_iter();
        let solved = starts.filter_map(|point| self.iterated(h, &path, &base, point, MAX_ROUNDS));
        Ok(solved.min_by(|a, b| a.objective.total_cmp(&b.objective)))
    }

    /// Solves an output that is nonlinear in the weights by Gauss-Newton steps. The first [`FULL_ROUNDS`] are full
    /// steps, which may pass a kink of the output. The next ones start from the best solution so far and are halved
    /// until the objective falls.
    fn iterated(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        base: &BaseColumns<'_>,
        start: Point,
        rounds: usize,
    ) -> Option<Assembly> {
        let mut next = self.linearised(h, path, base, Some(start)).solved(None)?;
        let mut best: Option<Assembly> = None;
        for round in 0..rounds {
            self.samples.stop.check();
            let point = self.point(h, path, self.combined(h, path, base, &next), &next);
            let there = self.linearised(h, path, base, Some(point)).at(next);
            match &best {
                Some(best) if there.objective >= best.objective && round >= FULL_ROUNDS => {
                    next = (&best.solution + &there.solution) * 0.5;
                }
                _ => {
                    let Some(solution) = there.linear.solved(Some(&there.solution)) else {
                        return Some(better(best, there));
                    };
                    next = solution;
                    let has_arrived = there.linear.objective(&next) >= (1.0 - TOLERANCE) * there.objective;
                    let from = better(best, there);
                    if has_arrived {
                        return Some(from);
                    }
                    best = Some(from);
                }
            }
        }
        best
    }

    /// Returns the points around which the output is linearised first. Without a saturation, the motion of the linear
    /// model. With one, the motion that would show the measured output. It depends on the zero, and the zero of a fit
    /// without the saturation may be far off. So each limit is also assumed to be at the end of the measured output.
    fn first_points(&self, h: &Hypothesis, path: &SignalPath<'_>, base: &BaseColumns<'_>) -> Result<Vec<Point>, Error> {
        let mut straight = h.clone();
        straight.gain_wanders = false;
        straight.effects.asymmetry = straight.effects.asymmetry.filter(|p| p.side == CurveSide::Input);
        straight.effects.saturation = straight.effects.limits(CurveSide::Input);
        let plain = SignalPath::new(self.samples, &straight)?;
        let Some(first) = self.linearised(&straight, &plain, base, None).solved(None) else { return Ok(Vec::new()) };
        let operator = self.combined(&straight, &plain, base, &first);
        let point = self.point(&straight, &plain, operator, &first);
        let Some(stop) = h.effects.limits(CurveSide::Output) else { return Ok(vec![point]) };
        let zeros = &first.as_slice()[self.layout(&straight).zeros];
        let mut moved = self.samples.output.clone();
        for (segment, file) in self.samples.segments.iter().zip(&self.samples.file_of_segment) {
            let zero = zeros[if self.zero_per_file { *file } else { 0 }];
            moved[segment.clone()].iter_mut().for_each(|y| *y -= zero);
        }
        let (low, high) = range(self.used.iter().flatten().map(|k| moved[*k]));
        let shifts = [0.0, high - stop.high, low - stop.low];
        let at = |shift: &f64| Point {
            motion: moved.iter().map(|y| path.unsaturated(y - shift)).collect(),
            ..point.clone()
        };
        Ok(shifts.iter().filter(|shift| shift.is_finite()).map(at).collect())
    }

    /// Returns the equations of the linear unknowns, linearised around `point`.
    fn linearised(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        base: &BaseColumns<'_>,
        point: Option<Point>,
    ) -> Linear {
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
            Some(p) if h.effects.limits(CurveSide::Output).is_some() => {
                Some(self.at_used_rows(|k| path.saturated(p.motion[k])))
            }
            _ => None,
        };
        let slope: Option<Vec<f64>> = saturated.as_ref().map(|s| s.iter().map(|(_, slope)| *slope).collect());
        let scaled = |column: &[f64]| {
            let mut at_used_rows = [self.at_used_rows(|k| column[k])];
            times(&mut at_used_rows, slope.as_deref());
            let [at_used_rows] = at_used_rows;
            at_used_rows
        };
        let bend = point.as_ref().and_then(|p| self.bend(h, p));
        if path.remembers_output() {
            let columns = base.map(|mut columns| {
                times(&mut columns, bend.as_deref());
                path.output_side_of(&mut columns);
                columns.iter().map(|column| scaled(column)).collect::<Vec<_>>()
            });
            layout.weights.clone().zip(columns.into_iter().flatten()).for_each(|(c, column)| put(c, column));
        } else {
            let of_rows = |factor: &[f64]| self.at_used_rows(|k| factor[k]);
            let factors: Vec<Vec<f64>> =
                bend.as_deref().into_iter().chain(path.factors()).map(of_rows).chain(slope.clone()).collect();
            for (c, column) in layout.weights.clone().zip(self.columns_at_used_rows(h, base).iter()) {
                let mut column = [column.clone()];
                factors.iter().for_each(|factor| times(&mut column, Some(factor)));
                let [column] = column;
                put(c, column);
            }
        }
        for (c, column) in self.other_columns(h, path, point.as_ref(), &scaled) {
            put(c, column);
        }
        let mut target = self.at_used_rows(|k| self.samples.output[k]);
        if let (Some(bend), Some(point)) = (&bend, &point) {
            // The linearised curve is too high by this.
            let mut excess = [point.operator.iter().zip(bend).map(|(v, slope)| (slope - 1.0) * v).collect()];
            path.output_side_of(&mut excess);
            target.iter_mut().zip(scaled(&excess[0])).for_each(|(y, excess)| *y += excess);
        }
        if let (Some(saturated), Some(point)) = (&saturated, &point) {
            let motion = self.at_used_rows(|k| point.motion[k]);
            for (y, ((value, slope), m)) in target.iter_mut().zip(saturated.iter().zip(motion)) {
                *y += slope * m - value;
            }
        }
        put(width - 1, target);
        let total = Gram::of_all(&blocks, width);
        let penalty = self.penalty(h, &total, width - 1);
        Linear { blocks, total, penalty, bounds: self.bounds(h), point }
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
        if let Some(c) = layout.load.clone().next()
            && let Some(mut load) = self.samples.load.clone()
        {
            path.structure(&mut load);
            columns.push((c, scaled(&load)));
        }
        if let Some(c) = layout.expansion.clone().next()
            && let Some(shift) = path.expansion()
        {
            columns.push((c, scaled(&shift)));
        }
        if let Some(c) = layout.direct.clone().next()
            && let Some(beside) = path.direct()
        {
            columns.push((c, scaled(&beside)));
        }
        let mut wider = path.widening().to_vec();
        times(&mut wider, point.and_then(|p| self.bend(h, p)).as_deref());
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
}

#[cfg(test)]
mod tests {
    use hyst_core::{AsymmetryParams, SaturationParams};

    use super::*;
    use crate::Samples;
    use crate::base::{PiBasis, play_column};
    use crate::lsq::Blocks;
    use crate::model::Effects;
    use crate::nested::Fitted;

    /// Play operators of the even thresholds of a fit, from rest, with the sensor's zero at 3 µm, their output passed
    /// through `shape`.
    fn samples(shape: impl Fn(f64) -> f64) -> Samples {
        let rows = 6000;
        let drive = |x: f64| 50.0 * (1.0 - (60.0 * x).cos()) * (0.55 + 0.45 * (4.0 * x).cos());
        let input: Vec<f64> = (0..rows).map(|k| drive(f64::from(k) / f64::from(rows))).collect();
        let mut motion: Vec<f64> = input.iter().map(|u| 0.1 * u).collect();
        let thresholds = PiBasis::for_samples(&Samples::of_columns(1e-3, input.clone(), motion.clone())).thresholds;
        for (at, weight) in [(1, 0.05), (5, 0.03), (9, 0.02)] {
            let play = play_column(&input, std::slice::from_ref(&(0..input.len())), thresholds[at]);
            motion.iter_mut().zip(play).for_each(|(v, p)| *v += weight * p);
        }
        let output = motion.into_iter().map(|v| 3.0 + shape(v)).collect();
        Samples::of_columns(1e-3, input, output)
    }

    /// Fits the linear unknowns on even thresholds.
    fn fitted(samples: &Samples, effects: Effects) -> (Fitted, Vec<f64>) {
        let basis = PiBasis::for_samples(samples);
        let blocks = Blocks::new(samples, 20, 6000);
        let problem = Problem::new(samples, &basis, &blocks, false);
        let fit = problem.fit_linear(&Hypothesis::of(effects)).unwrap().unwrap();
        let residual = problem.residual(&fit).unwrap();
        (fit, residual)
    }

    fn assert_is_exact((fit, residual): &(Fitted, Vec<f64>)) {
        let squares: f64 = residual.iter().map(|r| r * r).sum();
        assert!((squares - fit.squares).abs() <= 1e-4 * squares + 1e-9, "{squares} {}", fit.squares);
        assert!(fit.rmse() < 1e-3, "{}", fit.rmse());
    }

    #[test]
    fn a_curve_that_triples_the_slope_is_solved_exactly() {
        let bend = |v: f64| v + 0.8 * (v - 5.0).max(0.0) + 1.2 * (v - 10.0).max(0.0);
        let curve = AsymmetryParams::behind(vec![5.0, 10.0], vec![0.0; 2]);
        let found = fitted(&samples(bend), Effects { asymmetry: Some(curve), ..Effects::default() });
        assert_is_exact(&found);
        let zones = &found.0.hypothesis.effects.asymmetry.as_ref().unwrap().weights;
        assert!((zones[0] - 0.8).abs() < 0.01 && (zones[1] - 1.2).abs() < 0.01, "{zones:?}");
    }

    #[test]
    fn a_hard_limit_is_solved_although_the_fit_without_it_has_another_zero() {
        let stop = SaturationParams::behind(-50.0, 9.0, 1e-3);
        let found = fitted(&samples(|v| v.min(9.0)), Effects { saturation: Some(stop), ..Effects::default() });
        assert!((found.0.zeros[0] - 3.0).abs() < 0.01, "{:?}", found.0.zeros);
        assert_is_exact(&found);
    }

    /// After a history up to 100 V, no row moves the play operators that only a first rise would.
    #[test]
    fn a_play_operator_that_rests_has_no_weight() {
        let mut rest = samples(|v| v);
        rest.pasts = vec![vec![0.0, 100.0]];
        let (fit, _) = fitted(&rest, Effects::default());
        let basis = PiBasis::for_samples(&rest);
        let above = basis.thresholds.iter().zip(&fit.weights[1..]).filter(|(r, _)| **r >= 50.0);
        assert!(above.clone().count() > 0 && above.clone().all(|(_, w)| *w == 0.0), "{:?}", fit.weights);
    }
}
