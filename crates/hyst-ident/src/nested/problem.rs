//! One fit: columns, Jacobian, damped Gauss-Newton.

use std::sync::{Arc, OnceLock};

use hyst_core::{CurveSide, Error, HARMONIC_PARTS};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::assembly::{Assembly, Point};
use super::bounds::{box_of, stepped};
use super::columns::{may_be_kept, passes};
use super::cross_validation::{cross_validate, folds_by_experiment, folds_interleaved, unpredictable};
use super::{Cause, Hypothesis, Layout, Projector, SignalPath, owed};
use crate::Samples;
use crate::base::{Basis, Drag};
use crate::lsq::{Blocks, Bordered, Bounds, Gram, Share, held, solve_near};
use crate::memory;
use crate::model::Effect;
use crate::repetition::only_loop;
use crate::samples::range;

/// A record, a base and how rows are cut into blocks.
pub(crate) struct Problem<'a> {
    pub(crate) samples: &'a Samples,
    pub(crate) basis: &'a dyn Basis,
    pub(crate) blocks: &'a Blocks,
    /// The rows of each block that count.
    pub(super) used: Vec<Vec<usize>>,
    /// One zero for each file instead of one for all.
    pub(crate) zero_per_file: bool,
    /// Whether load, drift and tone are what a hypothesis says, though they could be solved for.
    holds: bool,
    /// Whether thresholds that grow with the rate may be tried: of what an operator beside plays misses, their weights would take a part.
    pub(crate) may_widen: bool,
    /// The base's columns for the drive as it was recorded, if they are few enough to be kept.
    pub(super) raw: Option<Vec<Vec<f64>>>,
    /// How many columns the base has.
    pub(super) width: usize,
    penalty: Option<DMatrix<f64>>,
    /// Frequency of the one loop that the record repeats \[Hz\], if it does nothing else.
    pub(crate) only_loop: Option<f64>,
    /// Blocks that the other folds cannot predict, once somebody has asked.
    unpredictable: OnceLock<Vec<bool>>,
}

/// Folds of the cross-validation.
const FOLDS: usize = 8;
/// Stretches of a record that has a single segment, each left out once where whole experiments are.
const STRETCHES: usize = 4;

/// Highest frequency of a harmonic, in sample rates.
const HIGHEST_TONE: f64 = 0.475;
/// Weight of the expectation that all was at rest, in that of the rows that show it was not.
const OWED: f64 = 1e-3;
/// Standard deviations of white noise that both parts of a harmonic together have to exceed.
const MIN_HARMONIC: f64 = 4.0;

/// A fit that has converged.
#[derive(Clone)]
pub(crate) struct Fitted {
    pub(crate) hypothesis: Hypothesis,
    pub(crate) weights: Vec<f64>,
    /// One zero, or one for each file.
    pub(crate) zeros: Vec<f64>,
    /// Σ residual² over the rows that count.
    pub(crate) squares: f64,
    pub(crate) rows: usize,
    /// What each block adds to the normal equations at the solution. Columns: the linear unknowns in the order of their
    /// [`Layout`], change of every nonlinear parameter, and the measured output. Most of the memory of a fit, so its copies share them.
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
    /// Root mean square of what is left in the rows that count \[y\].
    pub(crate) fn rmse(&self) -> f64 {
        (self.squares / self.rows.max(1) as f64).sqrt()
    }

    /// Where each of its linear unknowns stands.
    pub(crate) fn layout(&self) -> Layout {
        let of = |owed| Layout::of(&self.hypothesis, self.weights.len(), self.zeros.len(), owed);
        let linear = self.solution.len() - self.hypothesis.nonlinear().len();
        of(linear - of(0).len())
    }
}

impl<'a> Problem<'a> {
    pub(crate) fn new(samples: &'a Samples, basis: &'a dyn Basis, blocks: &'a Blocks, zero_per_file: bool) -> Self {
        let width = basis.len();
        let used: Vec<Vec<usize>> = (0..blocks.rows.len()).map(|b| blocks.used(b, samples).collect()).collect();
        let kept = may_be_kept(samples, width);
        let made: Vec<(f64, Vec<Vec<f64>>)> = passes(basis, samples.len())
            .into_par_iter()
            .map(|of| {
                let Samples { input, segments, pasts, .. } = samples;
                let columns = memory::columns(basis, of, input, segments, pasts, &Drag::NONE);
                let squares = columns.iter().flat_map(|c| used.iter().flatten().map(|k| c[*k] * c[*k])).sum();
                (squares, if kept { columns } else { Vec::new() })
            })
            .collect();
        let squares: f64 = made.iter().map(|(squares, _)| squares).sum();
        let raw = kept.then(|| made.into_iter().flat_map(|(_, columns)| columns).collect());
        let penalty = basis.penalty(squares / width.max(1) as f64);
        let only_loop = only_loop(samples);
        let unpredictable = OnceLock::new();
        Self {
            samples,
            basis,
            blocks,
            used,
            zero_per_file,
            holds: false,
            may_widen: basis.may_widen(),
            raw,
            width,
            penalty,
            only_loop,
            unpredictable,
        }
    }

    /// Keeps what load, drift and tone add as a hypothesis says it: solved on a coarse base, they would take up its misfit.
    pub(crate) fn holding(self) -> Self {
        Self { holds: true, ..self }
    }

    /// Tries thresholds that grow only where another problem of the same model does.
    pub(crate) fn widening_as(self, other: &Self) -> Self {
        Self { may_widen: other.may_widen, ..self }
    }

    /// Counts the same blocks as unpredictable as another base over the same rows: only then their errors can be compared.
    pub(crate) fn beside(self, other: &Self) -> Self {
        Self { unpredictable: OnceLock::from(other.unpredictable().to_vec()), ..self }
    }

    /// Where a zero that wanders goes: times \[s\], evenly over the record's rows, and heights \[y\].
    pub(crate) fn wandered_zero(&self, fit: &Fitted) -> Vec<(f64, f64)> {
        let heights = &fit.solution.as_slice()[self.layout(&fit.hypothesis).zero_hats];
        let (steps, last) = (heights.len().saturating_sub(1).max(1), self.samples.len().saturating_sub(1));
        heights.iter().enumerate().map(|(j, height)| (self.samples.time[j * last / steps], *height)).collect()
    }

    fn unpredictable(&self) -> &[bool] {
        if let Some(known) = self.unpredictable.get() {
            return known;
        }
        // The same for all that are compared: what moves the base depends little on the effects. Found outside of the cell: a thread that
        // waits for others in here may come by again with another job.
        let found = self.unpredictable_in(&folds_interleaved(self.blocks, FOLDS));
        self.unpredictable.get_or_init(|| found)
    }

    /// Blocks that move the base where no block of another fold does.
    fn unpredictable_in(&self, folds: &[Vec<usize>]) -> Vec<bool> {
        let base = self.assemble(&Hypothesis::default(), None).ok().flatten();
        base.map_or_else(
            || vec![false; self.blocks.rows.len()],
            |base| {
                let penalty = self.penalty(&Hypothesis::default(), &base.total, base.solution.len());
                let shares: Vec<Share> = base.blocks.into_iter().map(Share::of).collect();
                unpredictable(&shares, &penalty, folds)
            },
        )
    }

    /// Σ residual² of the whole record, each experiment predicted by a fit to the others, for two fits of this problem. `None` if the
    /// equations cannot be solved, or if nothing is predictable.
    pub(crate) fn transferred(&self, fits: [&Fitted; 2]) -> Option<[f64; 2]> {
        let folds = folds_by_experiment(self.blocks, self.samples, STRETCHES);
        let unpredictable = self.unpredictable_in(&folds);
        let [first, second] = fits.map(|fit| cross_validate(fit, &folds, &unpredictable));
        Some([first?.iter().sum(), second?.iter().sum()])
    }

    /// Σ residual² of each block, predicted from others. `None` if the equations cannot be solved.
    pub(crate) fn cross_validated(&self, fit: &Fitted) -> Option<Vec<f64>> {
        cross_validate(fit, &folds_interleaved(self.blocks, FOLDS), self.unpredictable())
    }

    pub(super) fn zeros(&self) -> usize {
        if self.zero_per_file { self.samples.files() } else { 1 }
    }

    pub(super) fn bounds(&self, h: &Hypothesis) -> Vec<Bounds> {
        let mut bounds = self.basis.bounds();
        let layout = self.layout(h);
        bounds.resize(layout.len(), Bounds::FREE);
        // Loops that narrow are another effect.
        bounds[layout.widening.clone()].fill(Bounds::above(0.0));
        // A curve that falls would have no inverse.
        bounds[layout.zones.clone()].fill(Bounds::above(-0.9));
        if h.goes_on {
            let farthest = owed::farthest(self.samples);
            bounds[layout.owed.clone()].fill(Bounds { lower: -farthest, upper: farthest });
        }
        if h.effects.drift.is_some_and(|p| p.seconds > 0.0 && p.per_second == 0.0) {
            // A law that only settles.
            bounds[layout.drift.start] = Bounds::fixed(0.0);
        }
        if let Some(tone) = &h.effects.interference {
            // What lies beyond half the sample rate would appear as another tone.
            for (i, bound) in bounds[layout.tone.clone()].iter_mut().enumerate() {
                let order = 1 + i / 2;
                if order > 1 && order as f64 * tone.hz > HIGHEST_TONE / self.samples.period {
                    *bound = Bounds::fixed(0.0);
                }
            }
        }
        if self.holds {
            let e = &h.effects;
            let load = e.load.iter().map(|p| p.per_newton);
            let drift = e.drift.iter().flat_map(|p| [p.per_second, p.settling]);
            let tone = e.interference.iter().flat_map(|p| {
                [p.phase.cos(), p.phase.sin()].map(|part| p.amplitude * part).into_iter().chain(p.harmonics)
            });
            let held = [
                (layout.load, load.collect::<Vec<f64>>()),
                (layout.expansion, e.temperature.iter().map(|p| p.expansion).collect()),
                (layout.drift, drift.collect()),
                (layout.tone, tone.collect()),
            ];
            for (at, values) in held {
                bounds[at].iter_mut().zip(values).for_each(|(b, value)| *b = Bounds::fixed(value));
            }
        }
        bounds
    }

    /// The base's penalty, that which keeps what goes on from before at zero where no row shows it, and zero for everything else.
    pub(super) fn penalty(&self, h: &Hypothesis, total: &Gram, unknowns: usize) -> DMatrix<f64> {
        let mut p = DMatrix::zeros(unknowns, unknowns);
        if let Some(own) = &self.penalty {
            p.view_mut((0, 0), own.shape()).copy_from(own);
        }
        for c in self.layout(h).owed {
            p[(c, c)] = OWED * total.matrix[(c, c)];
        }
        p
    }

    /// The output of the motion (without the sensor's zero, drift and tone, and without any wandering).
    pub(crate) fn motion(&self, h: &Hypothesis, solution: &DVector<f64>) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let motion = self.point_at(h, &path, solution).motion;
        Ok(motion.into_iter().map(|m| path.stopped(m).0).collect())
    }

    /// What a fit of this problem says of the motion in other rows, as the sensor would show it without zero, drift and tone.
    pub(crate) fn motion_in(&self, fit: &Fitted, samples: &Samples) -> Result<Vec<f64>, Error> {
        let over = self.basis.over(samples);
        let there = Problem {
            samples,
            basis: over.as_deref().unwrap_or(self.basis),
            used: Vec::new(),
            raw: None,
            penalty: None,
            only_loop: None,
            unpredictable: OnceLock::new(),
            ..*self
        };
        // Fewer files have fewer zeros, which are no part of the motion.
        let (solution, _) = self.layout(&fit.hypothesis).carried(&fit.solution, &there.layout(&fit.hypothesis));
        there.motion(&fit.hypothesis, &solution)
    }

    /// The output of the operator alone, before any curve behind it.
    pub(crate) fn operator_output(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, &fit.hypothesis)?;
        Ok(self.point_at(&fit.hypothesis, &path, &fit.solution).operator)
    }

    /// Change of the output in the rows that count with every nonlinear parameter, by forward differences.
    pub(super) fn jacobian(&self, h: &Hypothesis, solution: &DVector<f64>) -> Result<Vec<Vec<f64>>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let point = self.point_at(h, &path, solution);
        let all: Vec<usize> = (0..h.nonlinear().len()).collect();
        self.jacobian_at(h, &path, &point, &all)
    }

    /// The same of the parameters with these numbers, around a course of the motion.
    pub(super) fn jacobian_at(
        &self,
        h: &Hypothesis,
        path: &SignalPath<'_>,
        point: &Point,
        of: &[usize],
    ) -> Result<Vec<Vec<f64>>, Error> {
        let Point { operator, motion, solution } = point;
        let here = self.thinned(|k| path.stopped(motion[k]).0);
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
                return Ok(self.thinned(|k| -height * passed(k) / drift.seconds * (-passed(k)).exp()));
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
                return Ok(self.thinned(|k| slope(self.samples.time[k])));
            }
            let path = SignalPath::new(self.samples, &moved)?;
            // What follows the operator leaves its output as it is.
            let there = match moved.drives_alike(h) {
                true => self.point(&moved, &path, operator.clone(), solution),
                false => self.point_at(&moved, &path, solution),
            };
            let there = self.thinned(|k| path.stopped(there.motion[k]).0);
            Ok(there.iter().zip(&here).map(|(a, b)| (a - b) / step).collect())
        };
        // Of several errors the first one, whichever thread was quicker.
        let columns: Vec<Result<Vec<f64>, Error>> = of.par_iter().map(|at| column(*at)).collect();
        columns.into_iter().collect()
    }

    /// The normal equations of an assembly with the Jacobian's columns before the target.
    fn with_jacobian(&self, assembly: &Assembly, jacobian: &[Vec<f64>]) -> Gram {
        let mut bordered = Bordered::zeros(assembly.total.matrix.ncols(), jacobian.len());
        assembly.blocks.iter().zip(self.in_blocks(jacobian)).for_each(|(x, j)| bordered.add(x, &j));
        bordered.around(&assembly.total)
    }

    /// The same of each block.
    fn shares(&self, assembly: &Assembly, jacobian: &[Vec<f64>]) -> Arc<[Share]> {
        let jacobian: Vec<DMatrix<f64>> = self.in_blocks(jacobian).collect();
        let of = |(x, j): (&DMatrix<f64>, &DMatrix<f64>)| {
            // The target stays the last column.
            let (linear, further) = (x.ncols() - 1, j.ncols());
            let mut rows = x.clone().insert_columns(linear, further, 0.0);
            rows.columns_mut(linear, further).copy_from(j);
            Share::of(rows)
        };
        assembly.blocks.par_iter().zip(&jacobian).map(of).collect::<Vec<_>>().into()
    }

    /// Columns over the rows that count, cut into blocks.
    fn in_blocks(&self, columns: &[Vec<f64>]) -> impl Iterator<Item = DMatrix<f64>> {
        let mut next = 0;
        self.used.iter().map(move |rows| {
            let first = next;
            next += rows.len();
            DMatrix::from_fn(rows.len(), columns.len(), |k, c| columns[c][first + k])
        })
    }

    /// Fits everything, searching from `start`. `None` if the equations cannot be solved.
    ///
    /// # Errors
    /// If a stage cannot be built at the start.
    pub(crate) fn fit(&self, start: &Hypothesis) -> Result<Option<Fitted>, Error> {
        self.fit_in(start, ITERATIONS)
    }

    /// The same in at most this many iterations.
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

    /// One damped step that lowers the objective, or `None` if none does.
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
                    let limit = box_of(&p, self.samples);
                    *p.value = (*p.value + z[n + i]).clamp(limit.lower, limit.upper);
                    i += 1;
                });
                // Two limits that cross make no stop.
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
            let goes_on = drift.per_second != 0.0;
            let per_second = z[layout.drift.start];
            drift.per_second = if goes_on && per_second == 0.0 { f64::MIN_POSITIVE } else { per_second };
            drift.settling = z[layout.drift.clone()].get(1).copied().unwrap_or(0.0);
            // The column started at the record's first instant, the stage's clock is the lab's.
            zeros.iter_mut().for_each(|x| *x -= z[layout.drift.start] * self.samples.time[0]);
        }
        if let Some(tone) = &mut h.effects.interference {
            let (sine, cosine) = (z[layout.tone.start], z[layout.tone.start + 1]);
            tone.amplitude = sine.hypot(cosine);
            tone.phase = cosine.atan2(sine);
            // A harmonic that noise alone could make is none.
            let rows = at.total.rows.max(1) as f64;
            let least = MIN_HARMONIC * (2.0 * at.total.error(&at.solution)).sqrt() / rows;
            let parts = &z[layout.tone.start + 2..layout.tone.end];
            for (kept, found) in tone.harmonics.chunks_exact_mut(2).zip(parts.chunks_exact(2)) {
                kept.copy_from_slice(if found[0].hypot(found[1]) < least { &[0.0; 2] } else { found });
            }
        }
        if let Some(load) = &mut h.effects.load {
            load.per_newton = z[layout.load.start];
        }
        if let (Some(temperature), [expansion]) = (&mut h.effects.temperature, &z[layout.expansion.clone()]) {
            // Nothing but zero is none.
            temperature.expansion = if *expansion == 0.0 { f64::MIN_POSITIVE } else { *expansion };
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
        let penalty = self.penalty(&h, &at.total, unknowns);
        Fitted {
            hypothesis: h,
            weights: z[layout.weights].to_vec(),
            zeros,
            squares: at.total.error(&at.solution),
            rows: at.total.rows,
            solution: at.solution.clone().resize_vertically(unknowns, 0.0),
            shares: self.shares(at, jacobian),
            bounds,
            penalty,
        }
    }

    /// Solves the linear unknowns only, every nonlinear parameter as given.
    ///
    /// # Errors
    /// If a stage cannot be built.
    pub(crate) fn fit_linear(&self, h: &Hypothesis) -> Result<Option<Fitted>, Error> {
        let Some(here) = self.assemble(h, None)? else { return Ok(None) };
        let columns = vec![self.thinned(|_| 0.0); h.nonlinear().len()];
        Ok(Some(self.finish(h.clone(), &here, &columns)))
    }

    /// What separates a new column from all that a fit has, its nonlinear parameters too.
    pub(crate) fn projector(&self, fit: &Fitted) -> Result<Projector<'_>, Error> {
        let Some(at) = self.assemble(&fit.hypothesis, None)? else { return Ok(Projector::new(self, Vec::new())) };
        let jacobian = self.jacobian(&fit.hypothesis, &at.solution)?;
        let beside = |(x, j): (&DMatrix<f64>, DMatrix<f64>)| {
            let (linear, slopes) = (x.ncols() - 1, j.ncols());
            let mut all = x.clone().insert_columns(linear, slopes, 0.0);
            all.columns_mut(linear, slopes).copy_from(&j);
            all
        };
        let blocks = at.blocks.iter().zip(self.in_blocks(&jacobian)).map(beside);
        let mut blocks: Vec<DMatrix<f64>> = blocks.collect();
        // What is held at a bound imitates nothing: to first order it cannot move.
        let mut held = held(at.solution.iter(), &self.bounds(&fit.hypothesis));
        fit.hypothesis.clone().visit_nonlinear(&mut |p| {
            let limit = box_of(&p, self.samples);
            held.push(*p.value <= limit.lower || *p.value >= limit.upper);
        });
        for x in &mut blocks {
            (0..held.len()).filter(|i| held[*i]).for_each(|i| x.column_mut(i).fill(0.0));
        }
        Ok(Projector::new(self, blocks))
    }

    /// Measured minus fitted output, all rows.
    pub(crate) fn residual(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        self.residual_of(&fit.hypothesis, &fit.solution)
    }
}
