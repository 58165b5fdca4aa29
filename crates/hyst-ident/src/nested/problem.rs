//! One fit: columns, Jacobian, damped Gauss-Newton.

use std::sync::{Arc, OnceLock};

use hyst_core::{CurveSide, Error, HARMONIC_PARTS};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::assembly::{Assembly, Point};
use super::bounds::{bounds_of, stepped};
use super::columns::{may_be_kept, passes};
use super::cross_validation::{cross_validate, folds_by_experiment, folds_interleaved, unpredictable};
use super::{Cause, Hypothesis, Layout, Projector, SignalPath, initial};
use crate::Samples;
use crate::base::{Basis, Drag};
use crate::lsq::{Blocks, Bordered, Bounds, Gram, Share, held, solve_near};
use crate::memory;
use crate::model::Effect;
use crate::repetition::only_loop;
use crate::samples::range;
use crate::settle;

/// A record, a basis and the division of the rows into blocks.
pub(crate) struct Problem<'a> {
    pub(crate) samples: &'a Samples,
    pub(crate) basis: &'a dyn Basis,
    pub(crate) blocks: &'a Blocks,
    /// The rows of each block that count.
    pub(super) used: Vec<Vec<usize>>,
    /// One zero for each file instead of one for all.
    pub(crate) zero_per_file: bool,
    /// Whether load, temperature (but its gain), drift and tone keep the values of the hypothesis instead of being solved.
    linear_effects_fixed: bool,
    /// Whether a widening may be tried. Next to an operator without play operators its weights would take up misfit.
    pub(crate) may_widen: bool,
    /// Columns of the basis for the recorded drive, if they fit into memory.
    pub(super) raw: Option<Vec<Vec<f64>>>,
    /// Number of columns of the basis.
    pub(super) width: usize,
    /// Whether the weight of each column is zero because no row moves it; the start-up windows of segments with start-up
    /// rows do not count.
    resting: Vec<bool>,
    penalty: Option<DMatrix<f64>>,
    /// Frequency of the loop \[Hz\], if the record only repeats one loop.
    pub(crate) only_loop: Option<f64>,
    /// Blocks that the other folds cannot predict; computed on first use.
    unpredictable: OnceLock<Vec<bool>>,
}

/// Folds of the cross-validation.
const FOLDS: usize = 8;
/// Number of stretches of a record with a single segment; each is left out once.
const STRETCHES: usize = 4;

/// Highest frequency of a harmonic, in sample rates.
const MAX_HARMONIC_FREQUENCY: f64 = 0.475;
/// Weight of the assumption of rest, relative to the rows that show the initial deviations.
const INITIAL_PENALTY: f64 = 1e-3;
/// Minimum amplitude of a harmonic, in standard deviations of its estimate from white noise.
const MIN_HARMONIC: f64 = 4.0;

/// A converged fit.
#[derive(Clone)]
pub(crate) struct Fitted {
    pub(crate) hypothesis: Hypothesis,
    pub(crate) weights: Vec<f64>,
    /// One zero, or one for each file.
    pub(crate) zeros: Vec<f64>,
    /// Σ residual² over the rows that count.
    pub(crate) squares: f64,
    pub(crate) rows: usize,
    /// Contribution of each block to the normal equations at the solution. Columns: the linear unknowns in the order of
    /// their [`Layout`], the derivatives with respect to the nonlinear parameters, and the measured output. This is
    /// most of the memory of a fit, so copies share it.
    pub(crate) shares: Arc<[Share]>,
    pub(crate) solution: DVector<f64>,
    pub(crate) bounds: Vec<Bounds>,
    /// Penalty of the same unknowns.
    pub(crate) penalty: DMatrix<f64>,
}

const ITERATIONS: usize = 14;
/// Relative fall of the objective at which a fit has converged.
const TOLERANCE: f64 = 1e-5;

impl Fitted {
    /// Returns the RMS of the residual over the rows that count \[y\].
    pub(crate) fn rmse(&self) -> f64 {
        (self.squares / self.rows.max(1) as f64).sqrt()
    }

    /// Returns the positions of the linear unknowns.
    pub(crate) fn layout(&self) -> Layout {
        let of = |initial| Layout::of(&self.hypothesis, self.weights.len(), self.zeros.len(), initial);
        let linear = self.solution.len() - self.hypothesis.nonlinear().len();
        of(linear - of(0).len())
    }
}

impl<'a> Problem<'a> {
    pub(crate) fn new(samples: &'a Samples, basis: &'a dyn Basis, blocks: &'a Blocks, zero_per_file: bool) -> Self {
        let width = basis.len();
        let used: Vec<Vec<usize>> = (0..blocks.rows.len()).map(|b| blocks.used(b, samples).collect()).collect();
        let kept = may_be_kept(samples, width);
        let rows = || used.iter().flatten();
        // The first rise of a segment with start-up rows does not show the weight of an operator that only this rise moves.
        let unknown = basis.is_zero_unless_moved().then(|| settle::unknown_beginnings(samples));
        let rests = |c: &Vec<f64>| {
            unknown.as_ref().is_some_and(|unknown| {
                let mut shown = rows().filter(|k| !unknown[**k]).map(|k| c[*k]);
                shown.next().is_some_and(|first| shown.all(|x| x == first))
            })
        };
        let made: Vec<(f64, Vec<bool>, Vec<Vec<f64>>)> = passes(basis, samples.len())
            .into_par_iter()
            .map(|of| {
                let Samples { input, segments, pasts, .. } = samples;
                let columns = memory::columns(basis, of, input, segments, pasts, &Drag::NONE);
                let squares = columns.iter().flat_map(|c| rows().map(|k| c[*k] * c[*k])).sum();
                let resting = columns.iter().map(rests).collect();
                (squares, resting, if kept { columns } else { Vec::new() })
            })
            .collect();
        let squares: f64 = made.iter().map(|(squares, ..)| squares).sum();
        let resting = made.iter().flat_map(|(_, resting, _)| resting).copied().collect();
        let raw = kept.then(|| made.into_iter().flat_map(|(.., columns)| columns).collect());
        let penalty = basis.penalty(squares / width.max(1) as f64);
        let only_loop = only_loop(samples);
        let unpredictable = OnceLock::new();
        Self {
            samples,
            basis,
            blocks,
            used,
            zero_per_file,
            linear_effects_fixed: false,
            may_widen: basis.may_widen(),
            raw,
            width,
            resting,
            penalty,
            only_loop,
            unpredictable,
        }
    }

    /// Fixes load, temperature (but its gain), drift and tone at the values of the hypothesis. On a coarse base they would take up its
    /// misfit.
    pub(crate) fn with_linear_effects_fixed(self) -> Self {
        Self { linear_effects_fixed: true, ..self }
    }

    /// Allows a widening only if another problem of the same model does.
    pub(crate) fn widening_as(self, other: &Self) -> Self {
        Self { may_widen: other.may_widen, ..self }
    }

    /// Uses the unpredictable blocks of a problem with another basis over the same rows, so that the errors are
    /// comparable.
    pub(crate) fn with_blocks_of(self, other: &Self) -> Self {
        Self { unpredictable: OnceLock::from(other.unpredictable().to_vec()), ..self }
    }

    /// Returns the course of a wandering zero: times \[s\], evenly over the rows of the record, and heights \[y\].
    pub(crate) fn wandered_zero(&self, fit: &Fitted) -> Vec<(f64, f64)> {
        let heights = &fit.solution.as_slice()[self.layout(&fit.hypothesis).zero_hats];
        let (steps, last) = (heights.len().saturating_sub(1).max(1), self.samples.len().saturating_sub(1));
        heights.iter().enumerate().map(|(j, height)| (self.samples.time[j * last / steps], *height)).collect()
    }

    fn unpredictable(&self) -> &[bool] {
        if let Some(known) = self.unpredictable.get() {
            return known;
        }
        // The same for all trials that are compared: the effects hardly change what moves the base. Computed outside of
        // the cell, because a thread that waits inside may execute another job that enters here again.
        let found = self.unpredictable_in(&folds_interleaved(self.blocks, FOLDS));
        self.unpredictable.get_or_init(|| found)
    }

    /// Returns the blocks that move the base where no block of another fold does.
    fn unpredictable_in(&self, folds: &[Vec<usize>]) -> Vec<bool> {
        let base = self.assemble(&Hypothesis::default(), None).ok().flatten();
        base.map_or_else(
            || vec![false; self.blocks.rows.len()],
            |base| {
                let penalty = self.penalty(&Hypothesis::default(), &base.linear.total, base.solution.len());
                let shares: Vec<Share> = base.linear.blocks.into_iter().map(Share::of).collect();
                unpredictable(&shares, &penalty, folds)
            },
        )
    }

    /// Returns Σ residual² of the whole record for two fits of this problem, each experiment predicted by a fit to the
    /// others. Returns `None` if the equations cannot be solved or nothing is predictable.
    pub(crate) fn transferred(&self, fits: [&Fitted; 2]) -> Option<[f64; 2]> {
        let folds = folds_by_experiment(self.blocks, self.samples, STRETCHES);
        let unpredictable = self.unpredictable_in(&folds);
        let [first, second] = fits.map(|fit| cross_validate(fit, &folds, &unpredictable));
        Some([first?.iter().sum(), second?.iter().sum()])
    }

    /// Returns Σ residual² of each block, predicted from the other folds; `None` if the equations cannot be solved.
    pub(crate) fn cross_validated(&self, fit: &Fitted) -> Option<Vec<f64>> {
        cross_validate(fit, &folds_interleaved(self.blocks, FOLDS), self.unpredictable())
    }

    pub(super) fn zeros(&self) -> usize {
        if self.zero_per_file { self.samples.files() } else { 1 }
    }

    pub(super) fn bounds(&self, h: &Hypothesis) -> Vec<Bounds> {
        let mut bounds = self.basis.bounds();
        // Nothing separates the weight of an operator that rests from the sensor's zero.
        let resting = bounds.iter_mut().zip(&self.resting).filter(|(_, rests)| **rests);
        resting.for_each(|(bound, _)| *bound = Bounds::fixed(0.0));
        let layout = self.layout(h);
        bounds.resize(layout.len(), Bounds::FREE);
        // A loop that narrows with rate is another effect.
        bounds[layout.widening.clone()].fill(Bounds::above(0.0));
        // A decreasing curve has no inverse.
        bounds[layout.zones.clone()].fill(Bounds::above(-0.9));
        if h.initial_state {
            let farthest = initial::farthest(self.samples);
            bounds[layout.initial.clone()].fill(Bounds { lower: -farthest, upper: farthest });
        }
        if h.effects.drift.is_some_and(|p| p.seconds > 0.0 && p.per_second == 0.0) {
            // A law that only settles has no slope.
            bounds[layout.drift.start] = Bounds::fixed(0.0);
        }
        if let Some(tone) = &h.effects.interference {
            // Frequencies above half the sample rate would alias.
            for (i, bound) in bounds[layout.tone.clone()].iter_mut().enumerate() {
                let order = 1 + i / 2;
                if order > 1 && order as f64 * tone.hz > MAX_HARMONIC_FREQUENCY / self.samples.period {
                    *bound = Bounds::fixed(0.0);
                }
            }
        }
        if self.linear_effects_fixed {
            let e = &h.effects;
            let load = e.load.iter().map(|p| p.per_newton);
            let drift = e.drift.iter().flat_map(|p| [p.per_second, p.settling]);
            let tone = e.interference.iter().flat_map(|p| {
                [p.phase.cos(), p.phase.sin()].map(|part| p.amplitude * part).into_iter().chain(p.harmonics)
            });
            let held = [
                (layout.load, load.collect::<Vec<f64>>()),
                (layout.expansion, e.temperature.iter().map(|p| p.expansion).collect()),
                (layout.direct, e.temperature.iter().map(|p| p.direct).collect()),
                (layout.drift, drift.collect()),
                (layout.tone, tone.collect()),
            ];
            for (at, values) in held {
                bounds[at].iter_mut().zip(values).for_each(|(b, value)| *b = Bounds::fixed(value));
            }
        }
        bounds
    }

    /// Returns the penalty: that of the basis, one that keeps initial deviations at zero where no row shows them, and
    /// zero for everything else.
    pub(super) fn penalty(&self, h: &Hypothesis, total: &Gram, unknowns: usize) -> DMatrix<f64> {
        let mut p = DMatrix::zeros(unknowns, unknowns);
        if let Some(own) = &self.penalty {
            p.view_mut((0, 0), own.shape()).copy_from(own);
        }
        for c in self.layout(h).initial {
            p[(c, c)] = INITIAL_PENALTY * total.matrix[(c, c)];
        }
        p
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
        let there = Problem {
            samples,
            basis: over.as_deref().unwrap_or(self.basis),
            used: Vec::new(),
            raw: None,
            resting: Vec::new(),
            penalty: None,
            only_loop: None,
            unpredictable: OnceLock::new(),
            ..*self
        };
        // Fewer files have fewer zeros. Zeros are no part of the motion.
        let (solution, _) = self.layout(&fit.hypothesis).mapped(&fit.solution, &there.layout(&fit.hypothesis));
        there.motion(&fit.hypothesis, &solution)
    }

    /// Returns the output of the operator, before any curve behind it.
    pub(crate) fn operator_output(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, &fit.hypothesis)?;
        Ok(self.point_at(&fit.hypothesis, &path, &fit.solution).operator)
    }

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
    fn with_jacobian(&self, assembly: &Assembly, jacobian: &[Vec<f64>]) -> Gram {
        let mut bordered = Bordered::zeros(assembly.linear.total.matrix.ncols(), jacobian.len());
        assembly.linear.blocks.iter().zip(self.in_blocks(jacobian)).for_each(|(x, j)| bordered.add(x, &j));
        bordered.around(&assembly.linear.total)
    }

    /// Returns the same for each block.
    fn shares(&self, assembly: &Assembly, jacobian: &[Vec<f64>]) -> Arc<[Share]> {
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

    /// Divides columns over the rows that count into blocks.
    fn in_blocks(&self, columns: &[Vec<f64>]) -> impl Iterator<Item = DMatrix<f64>> {
        let mut next = 0;
        self.used.iter().map(move |rows| {
            let first = next;
            next += rows.len();
            DMatrix::from_fn(rows.len(), columns.len(), |k, c| columns[c][first + k])
        })
    }

    /// Fits all unknowns, searching the nonlinear ones from `start`. Returns `None` if the equations cannot be solved.
    ///
    /// # Errors
    /// If a stage cannot be built at the start.
    pub(crate) fn fit(&self, start: &Hypothesis) -> Result<Option<Fitted>, Error> {
        self.fit_in(start, ITERATIONS)
    }

    /// Fits with at most this many iterations.
    pub(super) fn fit_in(&self, start: &Hypothesis, iterations: usize) -> Result<Option<Fitted>, Error> {
        let mut h = start.clone();
        let Some(mut here) = self.assemble(&h, None)? else { return Ok(None) };
        let mut damping = 1e-3;
        let mut jacobian = self.jacobian(&h, &here.solution)?;
        for _ in 0..iterations {
            self.samples.stop.check();
            if jacobian.is_empty() {
                break;
            }
            let total = self.with_jacobian(&here, &jacobian);
            let Some((better, there)) = self.step(&h, &here, &total, &mut damping)? else { break };
            let fall = (here.objective - there.objective) / here.objective.max(f64::MIN_POSITIVE);
            (h, here) = (better, there);
            jacobian = self.jacobian(&h, &here.solution)?;
            if fall < TOLERANCE {
                break;
            }
        }
        Ok(Some(self.finish(h, &here, &jacobian)))
    }

    /// Takes one damped step that lowers the objective; returns `None` if there is none.
    fn step(
        &self,
        h: &Hypothesis,
        here: &Assembly,
        total: &Gram,
        damping: &mut f64,
    ) -> Result<Option<(Hypothesis, Assembly)>, Error> {
        let values = h.nonlinear();
        let (q, n) = (values.len(), here.solution.len());
        let mut bounds = self.bounds(h);
        bounds.extend(values.iter().map(|(v, b)| Bounds { lower: b.lower - v, upper: b.upper - v }));
        let still = here.solution.clone().resize_vertically(n + q, 0.0);
        for _ in 0..5 {
            let mut penalty = self.penalty(h, total, n + q);
            for i in n..n + q {
                penalty[(i, i)] = *damping * total.matrix[(i, i)];
            }
            if let Some(z) = solve_near(total, Some(&penalty), &bounds, Some(&still)) {
                let mut trial = h.clone();
                let mut i = 0;
                trial.visit_nonlinear(&mut |p| {
                    let limit = bounds_of(&p, self.samples);
                    *p.value = (*p.value + z[n + i]).clamp(limit.lower, limit.upper);
                    i += 1;
                });
                // Crossing saturation limits cannot be assembled.
                let there = self.assemble(&trial, Some(here)).ok().flatten();
                if let Some(there) = there.filter(|t| t.objective < here.objective) {
                    *damping = (*damping * 0.1).max(1e-9);
                    return Ok(Some((trial, there)));
                }
            }
            *damping *= 30.0;
        }
        Ok(None)
    }

    fn finish(&self, mut h: Hypothesis, at: &Assembly, jacobian: &[Vec<f64>]) -> Fitted {
        let layout = self.layout(&h);
        let z = at.solution.as_slice();
        let mut zeros = z[layout.zeros.clone()].to_vec();
        if let Some(drift) = &mut h.effects.drift {
            let has_slope = drift.per_second != 0.0;
            let per_second = z[layout.drift.start];
            drift.per_second = if has_slope && per_second == 0.0 { f64::MIN_POSITIVE } else { per_second };
            drift.settling = z[layout.drift.clone()].get(1).copied().unwrap_or(0.0);
            // The column starts at the record's first instant, the stage uses the lab clock.
            zeros.iter_mut().for_each(|x| *x -= z[layout.drift.start] * self.samples.time[0]);
        }
        if let Some(tone) = &mut h.effects.interference {
            let (sine, cosine) = (z[layout.tone.start], z[layout.tone.start + 1]);
            tone.amplitude = sine.hypot(cosine);
            tone.phase = cosine.atan2(sine);
            // A harmonic that noise alone can produce is dropped.
            let rows = at.linear.total.rows.max(1) as f64;
            let least = MIN_HARMONIC * (2.0 * at.linear.total.error(&at.solution)).sqrt() / rows;
            let parts = &z[layout.tone.start + 2..layout.tone.end];
            for (kept, found) in tone.harmonics.chunks_exact_mut(2).zip(parts.chunks_exact(2)) {
                kept.copy_from_slice(if found[0].hypot(found[1]) < least { &[0.0; 2] } else { found });
            }
        }
        if let Some(load) = &mut h.effects.load {
            load.per_newton = z[layout.load.start];
        }
        if let (Some(temperature), [expansion]) = (&mut h.effects.temperature, &z[layout.expansion.clone()]) {
            // Exactly zero would mean that there is no expansion.
            temperature.expansion = if *expansion == 0.0 { f64::MIN_POSITIVE } else { *expansion };
        }
        if let (Some(temperature), [direct]) = (&mut h.effects.temperature, &z[layout.direct.clone()]) {
            temperature.direct = if *direct == 0.0 { f64::MIN_POSITIVE } else { *direct };
        }
        if let Some(widening) = &mut h.effects.widening {
            widening.weights = z[layout.widening.clone()].to_vec();
        }
        if let Some(curve) = h.effects.asymmetry.as_mut().filter(|p| p.side == CurveSide::Output) {
            curve.weights = z[layout.zones.clone()].to_vec();
        }
        let mut bounds = self.bounds(&h);
        let values = h.nonlinear();
        bounds.extend(values.iter().map(|(v, b)| Bounds { lower: b.lower - v, upper: b.upper - v }));
        let unknowns = z.len() + values.len();
        let penalty = self.penalty(&h, &at.linear.total, unknowns);
        Fitted {
            hypothesis: h,
            weights: z[layout.weights].to_vec(),
            zeros,
            squares: at.linear.total.error(&at.solution),
            rows: at.linear.total.rows,
            solution: at.solution.clone().resize_vertically(unknowns, 0.0),
            shares: self.shares(at, jacobian),
            bounds,
            penalty,
        }
    }

    /// Solves the linear unknowns only, with every nonlinear parameter as given.
    ///
    /// # Errors
    /// If a stage cannot be built.
    pub(crate) fn fit_linear(&self, h: &Hypothesis) -> Result<Option<Fitted>, Error> {
        let Some(here) = self.assemble(h, None)? else { return Ok(None) };
        let columns = vec![self.at_used_rows(|_| 0.0); h.nonlinear().len()];
        Ok(Some(self.finish(h.clone(), &here, &columns)))
    }

    /// Returns the same fit with the derivatives with respect to its nonlinear parameters, on which their standard errors
    /// depend.
    ///
    /// # Errors
    /// If a stage cannot be built.
    pub(crate) fn with_slopes(&self, fit: &Fitted) -> Result<Option<Fitted>, Error> {
        self.fit_in(&fit.hypothesis, 0)
    }

    /// Returns a projector that removes the part of a column that a fit can imitate, nonlinear parameters included.
    pub(crate) fn projector(&self, fit: &Fitted) -> Result<Projector<'_>, Error> {
        let Some(at) = self.assemble(&fit.hypothesis, None)? else { return Ok(Projector::new(self, Vec::new())) };
        let jacobian = self.jacobian(&fit.hypothesis, &at.solution)?;
        let beside = |(x, j): (&DMatrix<f64>, DMatrix<f64>)| {
            let (linear, slopes) = (x.ncols() - 1, j.ncols());
            let mut all = x.clone().insert_columns(linear, slopes, 0.0);
            all.columns_mut(linear, slopes).copy_from(&j);
            all
        };
        let blocks = at.linear.blocks.iter().zip(self.in_blocks(&jacobian)).map(beside);
        let mut blocks: Vec<DMatrix<f64>> = blocks.collect();
        // An unknown at a bound cannot move to first order, so it imitates nothing.
        let mut held = held(at.solution.iter(), &self.bounds(&fit.hypothesis));
        fit.hypothesis.clone().visit_nonlinear(&mut |p| {
            let limit = bounds_of(&p, self.samples);
            held.push(*p.value <= limit.lower || *p.value >= limit.upper);
        });
        for x in &mut blocks {
            (0..held.len()).filter(|i| held[*i]).for_each(|i| x.column_mut(i).fill(0.0));
        }
        Ok(Projector::new(self, blocks))
    }

    /// Returns measured minus fitted output in all rows.
    pub(crate) fn residual(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        self.residual_of(&fit.hypothesis, &fit.solution)
    }
}
