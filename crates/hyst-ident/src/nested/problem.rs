//! One fit: columns, Jacobian, damped Gauss-Newton.

use std::borrow::Cow;

use hyst_core::Error;
use nalgebra::{DMatrix, DVector};

use super::SignalPath;
use crate::Samples;
use crate::base::Basis;
use crate::lsq::{Blocks, Bounds, Gram, solve};
use crate::model::{Effect, Effects};

/// A record, a base and how rows are cut into blocks.
pub(crate) struct Problem<'a> {
    pub(crate) samples: &'a Samples,
    pub(crate) basis: &'a dyn Basis,
    pub(crate) blocks: &'a Blocks,
    /// One zero for each file instead of one for all.
    pub(crate) zero_per_file: bool,
    /// The base's columns for the drive as it was recorded.
    raw: Vec<Vec<f64>>,
    penalty: Option<DMatrix<f64>>,
}

/// A fit that has converged.
#[derive(Clone)]
pub(crate) struct Fitted {
    pub(crate) effects: Effects,
    pub(crate) weights: Vec<f64>,
    /// One zero, or one for each file.
    pub(crate) zeros: Vec<f64>,
    /// Σ residual² over the rows that count.
    pub(crate) squares: f64,
    pub(crate) rows: usize,
    /// Normal equations of each block at the solution. Columns: weights, zeros, drift, sine and
    /// cosine, change of every nonlinear parameter, and the measured output.
    pub(crate) grams: Vec<Gram>,
    pub(crate) solution: DVector<f64>,
    pub(crate) bounds: Vec<Bounds>,
    /// Penalty of the same unknowns.
    pub(crate) penalty: DMatrix<f64>,
}

/// Columns at one set of effects.
struct Assembly {
    /// Rows of each block: weights, linear extras, measured output.
    blocks: Vec<DMatrix<f64>>,
    grams: Vec<Gram>,
    total: Gram,
    solution: DVector<f64>,
    objective: f64,
}

const ITERATIONS: usize = 14;
/// Relative fall of the objective at which a fit has converged.
const TOLERANCE: f64 = 1e-5;

impl<'a> Problem<'a> {
    pub(crate) fn new(samples: &'a Samples, basis: &'a dyn Basis, blocks: &'a Blocks, zero_per_file: bool) -> Self {
        let raw = basis.columns(&samples.input, &samples.segments);
        let rows = |b: usize| blocks.used(b, samples);
        let squares: f64 =
            raw.iter().map(|c| (0..blocks.rows.len()).flat_map(rows).map(|k| c[k] * c[k]).sum::<f64>()).sum();
        let penalty = basis.penalty(squares / raw.len().max(1) as f64);
        Self { samples, basis, blocks, zero_per_file, raw, penalty }
    }

    fn zeros(&self) -> usize {
        if self.zero_per_file { self.samples.files() } else { 1 }
    }

    /// Linear columns besides the base's: zeros, drift, tone.
    fn extras(&self, effects: &Effects) -> Vec<Vec<f64>> {
        let s = self.samples;
        let mut columns = vec![vec![0.0; s.len()]; self.zeros()];
        for (segment, file) in s.segments.iter().zip(&s.file_of_segment) {
            let column = &mut columns[if self.zero_per_file { *file } else { 0 }];
            column[segment.clone()].fill(1.0);
        }
        if effects.drift.is_some() {
            columns.push(s.time.iter().map(|t| t - s.time[0]).collect());
        }
        if let Some(tone) = &effects.interference {
            let angle = |t: &f64| 2.0 * std::f64::consts::PI * (tone.hz * t).fract();
            columns.push(s.time.iter().map(|t| angle(t).sin()).collect());
            columns.push(s.time.iter().map(|t| angle(t).cos()).collect());
        }
        columns
    }

    fn bounds(&self, effects: &Effects) -> Vec<Bounds> {
        let mut bounds = self.basis.bounds();
        let extras =
            self.zeros() + usize::from(effects.drift.is_some()) + 2 * usize::from(effects.interference.is_some());
        bounds.extend(vec![Bounds::FREE; extras]);
        bounds
    }

    /// The base's penalty, zero for everything else.
    fn penalty(&self, unknowns: usize) -> DMatrix<f64> {
        let mut p = DMatrix::zeros(unknowns, unknowns);
        if let Some(own) = &self.penalty {
            p.view_mut((0, 0), own.shape()).copy_from(own);
        }
        p
    }

    /// The base's columns for what leads to the hysteresis; those of the drive as recorded are kept.
    fn columns(&self, path: &SignalPath<'_>, effects: &Effects) -> Cow<'_, [Vec<f64>]> {
        if effects.on_input_side() {
            Cow::Owned(self.basis.columns(&path.input_side(), &self.samples.segments))
        } else {
            Cow::Borrowed(&self.raw)
        }
    }

    fn assemble(&self, effects: &Effects) -> Result<Option<Assembly>, Error> {
        let path = SignalPath::new(self.samples, effects)?;
        let base = self.columns(&path, effects);
        let extras = self.extras(effects);
        let width = base.len() + extras.len() + 1;
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
        let mut filtered = Vec::new();
        for (c, column) in base.iter().enumerate() {
            filtered.clone_from(column);
            path.output_side(&mut filtered);
            put(c, &filtered);
        }
        for (c, column) in extras.iter().enumerate() {
            put(base.len() + c, column);
        }
        put(width - 1, &self.samples.output);
        let grams: Vec<Gram> = blocks.iter().map(|x| Gram { matrix: x.tr_mul(x), rows: x.nrows() }).collect();
        let total = Gram::sum(width, grams.iter());
        let penalty = self.penalty(width - 1);
        Ok(solve(&total, Some(&penalty), &self.bounds(effects)).map(|solution| {
            let objective = total.error(&solution) + (solution.transpose() * &penalty * &solution)[(0, 0)];
            Assembly { blocks, grams, total, solution, objective }
        }))
    }

    /// The output of the motion (without the sensor's zero, drift and tone) for given weights.
    pub(crate) fn motion(&self, effects: &Effects, weights: &[f64]) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, effects)?;
        let base = self.columns(&path, effects);
        let mut v = combine(&base, weights, self.samples.len());
        path.output_side(&mut v);
        Ok(v)
    }

    /// Change of the output with every nonlinear parameter, by forward differences.
    fn jacobian(&self, effects: &Effects, solution: &DVector<f64>) -> Result<Vec<Vec<f64>>, Error> {
        let weights = &solution.as_slice()[..self.raw.len()];
        let here = self.motion(effects, weights)?;
        let mut columns = Vec::new();
        let mut at = 0;
        while let Some((moved, step, effect)) = stepped(effects, at, self.samples) {
            let column = if effect == Effect::Interference {
                let first = solution.len() - 2;
                let (sine, cosine) = (solution[first], solution[first + 1]);
                let tone = effects.interference.unwrap_or_default();
                let slope = |t: &f64| {
                    let angle = 2.0 * std::f64::consts::PI * (tone.hz * t).fract();
                    2.0 * std::f64::consts::PI
                        * (t - self.samples.time[0])
                        * (sine * angle.cos() - cosine * angle.sin())
                };
                self.samples.time.iter().map(slope).collect()
            } else {
                let there = self.motion(&moved, weights)?;
                there.iter().zip(&here).map(|(a, b)| (a - b) / step).collect()
            };
            columns.push(column);
            at += 1;
        }
        Ok(columns)
    }

    /// Adds the Jacobian's columns to an assembly's normal equations, before the target.
    fn with_jacobian(&self, assembly: &Assembly, jacobian: &[Vec<f64>]) -> Vec<Gram> {
        let q = jacobian.len();
        let place = |b: usize| {
            let x = &assembly.blocks[b];
            let rows: Vec<usize> = self.blocks.used(b, self.samples).collect();
            let j = DMatrix::from_fn(rows.len(), q, |k, c| jacobian[c][rows[k]]);
            let n = x.ncols();
            let (cross, own) = (x.tr_mul(&j), j.tr_mul(&j));
            let g = &assembly.grams[b].matrix;
            // Old columns keep their place, the target moves behind the new ones.
            let old = |i: usize| {
                if i < n - 1 {
                    Some(i)
                } else if i == n - 1 + q {
                    Some(n - 1)
                } else {
                    None
                }
            };
            let matrix = DMatrix::from_fn(n + q, n + q, |r, c| match (old(r), old(c)) {
                (Some(r), Some(c)) => g[(r, c)],
                (Some(r), None) => cross[(r, c - (n - 1))],
                (None, Some(c)) => cross[(c, r - (n - 1))],
                (None, None) => own[(r - (n - 1), c - (n - 1))],
            });
            Gram { matrix, rows: x.nrows() }
        };
        (0..assembly.blocks.len()).map(place).collect()
    }

    /// Fits everything, searching from `start`. `None` if the equations cannot be solved.
    ///
    /// # Errors
    /// If a stage cannot be built at the start.
    pub(crate) fn fit(&self, start: &Effects) -> Result<Option<Fitted>, Error> {
        let mut effects = start.clone();
        let Some(mut here) = self.assemble(&effects)? else { return Ok(None) };
        let mut damping = 1e-3;
        let mut grams = self.with_jacobian(&here, &self.jacobian(&effects, &here.solution)?);
        for _ in 0..ITERATIONS {
            let q = nonlinear(&effects).len();
            if q == 0 {
                break;
            }
            let total = Gram::sum(here.total.matrix.ncols() + q, grams.iter());
            let Some((better, there)) = self.step(&effects, &here, &total, &mut damping)? else { break };
            let fall = (here.objective - there.objective) / here.objective.max(f64::MIN_POSITIVE);
            effects = better;
            here = there;
            grams = self.with_jacobian(&here, &self.jacobian(&effects, &here.solution)?);
            if fall < TOLERANCE {
                break;
            }
        }
        Ok(Some(self.finish(effects, &here, grams)))
    }

    /// One damped step that lowers the objective, or `None` if none does.
    fn step(
        &self,
        effects: &Effects,
        here: &Assembly,
        total: &Gram,
        damping: &mut f64,
    ) -> Result<Option<(Effects, Assembly)>, Error> {
        let values = nonlinear(effects);
        let (q, n) = (values.len(), here.solution.len());
        let mut bounds = self.bounds(effects);
        bounds.extend(values.iter().map(|(v, b)| Bounds { lower: b.lower - v, upper: b.upper - v }));
        for _ in 0..5 {
            let mut penalty = self.penalty(n + q);
            for i in n..n + q {
                penalty[(i, i)] = *damping * total.matrix[(i, i)];
            }
            if let Some(z) = solve(total, Some(&penalty), &bounds) {
                let mut trial = effects.clone();
                let mut i = 0;
                trial.visit_nonlinear(&mut |p| {
                    let limit = box_of(&p, self.samples);
                    *p.value = (*p.value + z[n + i]).clamp(limit.lower, limit.upper);
                    i += 1;
                });
                if let Some(there) = self.assemble(&trial)?.filter(|t| t.objective < here.objective) {
                    *damping = (*damping * 0.1).max(1e-9);
                    return Ok(Some((trial, there)));
                }
            }
            *damping *= 30.0;
        }
        Ok(None)
    }

    fn finish(&self, mut effects: Effects, at: &Assembly, grams: Vec<Gram>) -> Fitted {
        let p = self.raw.len();
        let z = at.solution.as_slice();
        let mut zeros = z[p..p + self.zeros()].to_vec();
        let mut next = p + self.zeros();
        if let Some(drift) = &mut effects.drift {
            drift.per_second = z[next];
            // The column started at the record's first instant, the stage's clock is the lab's.
            zeros.iter_mut().for_each(|x| *x -= z[next] * self.samples.time[0]);
            next += 1;
        }
        if let Some(tone) = &mut effects.interference {
            tone.amplitude = z[next].hypot(z[next + 1]);
            tone.phase = z[next + 1].atan2(z[next]);
        }
        let mut bounds = self.bounds(&effects);
        let values = nonlinear(&effects);
        bounds.extend(values.iter().map(|(v, b)| Bounds { lower: b.lower - v, upper: b.upper - v }));
        let unknowns = z.len() + values.len();
        Fitted {
            effects,
            weights: z[..p].to_vec(),
            zeros,
            squares: at.total.error(&at.solution),
            rows: at.total.rows,
            solution: at.solution.clone().resize_vertically(unknowns, 0.0),
            grams,
            bounds,
            penalty: self.penalty(unknowns),
        }
    }

    /// Solves the linear unknowns only, every nonlinear parameter as given.
    ///
    /// # Errors
    /// If a stage cannot be built.
    pub(crate) fn fit_linear(&self, effects: &Effects) -> Result<Option<Fitted>, Error> {
        let Some(here) = self.assemble(effects)? else { return Ok(None) };
        let q = nonlinear(effects).len();
        let columns = vec![vec![0.0; self.samples.len()]; q];
        let grams = self.with_jacobian(&here, &columns);
        Ok(Some(self.finish(effects.clone(), &here, grams)))
    }

    /// What separates a new column from those that a fit already has.
    pub(crate) fn projector(&self, fit: &Fitted) -> Result<Projector<'_>, Error> {
        let blocks = self.assemble(&fit.effects)?.map(|a| a.blocks).unwrap_or_default();
        let n = blocks.first().map_or(0, |x| x.ncols() - 1);
        let mut h = DMatrix::zeros(n, n);
        for x in &blocks {
            let own = x.columns(0, n);
            h += own.tr_mul(&own);
        }
        for i in 0..n {
            h[(i, i)] *= 1.0 + 1e-9;
        }
        Ok(Projector { problem: self, blocks, factor: h.cholesky() })
    }

    /// Measured minus fitted output, all rows.
    pub(crate) fn residual(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        let mut r = self.motion(&fit.effects, &fit.weights)?;
        let extras = self.extras(&fit.effects);
        let first = self.raw.len();
        for (c, column) in extras.iter().enumerate() {
            let z = fit.solution[first + c];
            r.iter_mut().zip(column).for_each(|(r, x)| *r += z * x);
        }
        r.iter_mut().zip(&self.samples.output).for_each(|(r, y)| *r = y - *r);
        Ok(r)
    }
}

/// Projects columns off the linear ones of a fit.
pub(crate) struct Projector<'a> {
    problem: &'a Problem<'a>,
    blocks: Vec<DMatrix<f64>>,
    factor: Option<nalgebra::Cholesky<f64, nalgebra::Dyn>>,
}

impl Projector<'_> {
    /// How much of Σ residual² a column would take, all linear unknowns refitted, and the factor at
    /// which it does.
    pub(crate) fn gain(&self, column: &[f64], residual: &[f64]) -> (f64, f64) {
        let Some(factor) = &self.factor else { return (0.0, 0.0) };
        let n = factor.l_dirty().ncols();
        let mut cross = DVector::zeros(n);
        let (mut own, mut with) = (0.0, 0.0);
        for (b, x) in self.blocks.iter().enumerate() {
            let rows = self.problem.blocks.used(b, self.problem.samples);
            let part = DVector::from_iterator(x.nrows(), rows.map(|k| column[k]));
            own += part.norm_squared();
            let rows = self.problem.blocks.used(b, self.problem.samples);
            with += rows.map(|k| column[k] * residual[k]).sum::<f64>();
            cross += x.columns(0, n).tr_mul(&part);
        }
        let left = own - cross.dot(&factor.solve(&cross));
        if left <= 1e-9 * own { (0.0, 0.0) } else { (with * with / left, with / left) }
    }
}

fn combine(columns: &[Vec<f64>], weights: &[f64], rows: usize) -> Vec<f64> {
    let mut v = vec![0.0; rows];
    for (column, w) in columns.iter().zip(weights) {
        v.iter_mut().zip(column).for_each(|(v, x)| *v += w * x);
    }
    v
}

/// Bounds of a nonlinear parameter for this record.
fn box_of(p: &crate::model::Parameter<'_>, samples: &Samples) -> Bounds {
    let nyquist = 0.5 / samples.period;
    let bounds = match (p.effect, p.name.starts_with("hz")) {
        (Effect::Resonance, true) => Bounds { lower: 2.0 / samples.longest_segment(), upper: 0.95 * nyquist },
        (Effect::Interference, true) => Bounds { lower: 2.0 / samples.longest_segment(), upper: nyquist },
        (Effect::Delay | Effect::Lag, _) => {
            Bounds { lower: 0.0, upper: p.upper.min(0.1 * samples.longest_segment()).min(4000.0 * samples.period) }
        }
        _ => Bounds { lower: p.lower, upper: p.upper },
    };
    // Segments of a few rows leave no room between the two.
    Bounds { upper: bounds.upper.max(bounds.lower), ..bounds }
}

/// Values of the nonlinear parameters and their bounds (those of the parameter; `step` narrows them
/// to the record's).
fn nonlinear(effects: &Effects) -> Vec<(f64, Bounds)> {
    let mut values = Vec::new();
    effects.clone().visit_nonlinear(&mut |p| values.push((*p.value, Bounds { lower: p.lower, upper: p.upper })));
    values
}

/// The effects with the `index`-th nonlinear parameter moved a little, and by how much.
fn stepped(effects: &Effects, index: usize, samples: &Samples) -> Option<(Effects, f64, Effect)> {
    let mut moved = effects.clone();
    let mut found = None;
    let mut i = 0;
    moved.visit_nonlinear(&mut |p| {
        if i == index {
            let step = match (p.effect, p.name.trim_end_matches("_2")) {
                (Effect::Delay | Effect::Lag, _) => 1e-3 * samples.period.max(*p.value),
                (Effect::Resonance, "hz") => 1e-5 * *p.value,
                (Effect::Resonance, "damping") => 1e-3 * *p.value + 1e-7,
                _ => 1e-5,
            };
            // Downwards where the upper bound is near: beyond it the stage may not exist.
            let step = if *p.value + step > p.upper { -step } else { step };
            *p.value += step;
            found = Some((step, p.effect));
        }
        i += 1;
    });
    found.map(|(step, effect)| (moved, step, effect))
}
