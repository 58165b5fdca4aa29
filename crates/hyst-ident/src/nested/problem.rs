//! One fit: columns, Jacobian, damped Gauss-Newton.

use std::sync::OnceLock;

use hyst_core::Error;
use nalgebra::{DMatrix, DVector};

use super::assembly::Assembly;
use super::bounds::{box_of, stepped};
use super::columns::may_be_kept;
use super::cross_validation::{cross_validate, folds_interleaved, unpredictable};
use super::{Hypothesis, Projector, SignalPath};
use crate::Samples;
use crate::base::{Basis, Drag};
use crate::lsq::{Blocks, Bounds, Gram, solve};
use crate::model::Effect;
use crate::repetition::only_loop;
use crate::samples::range;

/// A record, a base and how rows are cut into blocks.
pub(crate) struct Problem<'a> {
    pub(crate) samples: &'a Samples,
    pub(crate) basis: &'a dyn Basis,
    pub(crate) blocks: &'a Blocks,
    /// One zero for each file instead of one for all.
    pub(crate) zero_per_file: bool,
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
    /// Normal equations of each block at the solution. Columns: the linear unknowns in the order of their
    /// [`Layout`](super::Layout), change of every nonlinear parameter, and the measured output.
    pub(crate) grams: Vec<Gram>,
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
}

impl<'a> Problem<'a> {
    pub(crate) fn new(samples: &'a Samples, basis: &'a dyn Basis, blocks: &'a Blocks, zero_per_file: bool) -> Self {
        let width = basis.len();
        let mut raw = may_be_kept(samples, width).then(|| Vec::with_capacity(width));
        let mut squares = 0.0;
        basis.columns(&samples.input, &samples.segments, &Drag::NONE, &mut |_, column| {
            squares += blocks.all_used(samples).map(|k| column[k] * column[k]).sum::<f64>();
            raw.iter_mut().for_each(|raw| raw.push(column.to_vec()));
        });
        let penalty = basis.penalty(squares / width.max(1) as f64);
        let only_loop = only_loop(samples);
        let unpredictable = OnceLock::new();
        Self { samples, basis, blocks, zero_per_file, raw, width, penalty, only_loop, unpredictable }
    }

    /// Counts the same blocks as unpredictable as another base over the same rows: only then their errors can be compared.
    pub(crate) fn beside(self, other: &Self) -> Self {
        Self { unpredictable: OnceLock::from(other.unpredictable().to_vec()), ..self }
    }

    fn unpredictable(&self) -> &[bool] {
        // The same for all that are compared: what moves the base depends little on the effects.
        self.unpredictable.get_or_init(|| {
            let base = self.assemble(&Hypothesis::default(), None).ok().flatten();
            let folds = folds_interleaved(self.blocks, FOLDS);
            base.map_or_else(
                || vec![false; self.blocks.rows.len()],
                |base| unpredictable(&base.grams, &self.penalty(base.solution.len()), &folds),
            )
        })
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
        // A curve that falls would have no inverse.
        bounds[layout.zones].fill(Bounds::above(-0.9));
        bounds
    }

    /// The base's penalty, zero for everything else.
    pub(super) fn penalty(&self, unknowns: usize) -> DMatrix<f64> {
        let mut p = DMatrix::zeros(unknowns, unknowns);
        if let Some(own) = &self.penalty {
            p.view_mut((0, 0), own.shape()).copy_from(own);
        }
        p
    }

    /// The output of the motion (without the sensor's zero, drift and tone, and without any wandering).
    pub(crate) fn motion(&self, h: &Hypothesis, solution: &DVector<f64>) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, h)?;
        let base = self.columns(&path, h);
        let mut motion = self.point(h, &path, &base, solution).motion;
        motion.iter_mut().for_each(|m| *m = path.stopped(*m).0);
        Ok(motion)
    }

    /// The output of the operator alone, before any curve behind it.
    pub(crate) fn operator_output(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        let path = SignalPath::new(self.samples, &fit.hypothesis)?;
        let base = self.columns(&path, &fit.hypothesis);
        Ok(self.point(&fit.hypothesis, &path, &base, &fit.solution).operator)
    }

    /// Change of the output with every nonlinear parameter, by forward differences.
    fn jacobian(&self, h: &Hypothesis, solution: &DVector<f64>) -> Result<Vec<Vec<f64>>, Error> {
        let here = self.motion(h, solution)?;
        let reached = range(here.iter().copied());
        let mut columns = Vec::new();
        let mut at = 0;
        while let Some((moved, step, effect)) = stepped(h, at, self.samples, reached) {
            let column = if step == 0.0 {
                vec![0.0; self.samples.len()]
            } else if effect == Effect::Interference {
                let first = self.layout(h).tone.start;
                let (sine, cosine) = (solution[first], solution[first + 1]);
                let tone = h.effects.interference.unwrap_or_default();
                let slope = |t: &f64| {
                    let angle = 2.0 * std::f64::consts::PI * (tone.hz * t).fract();
                    2.0 * std::f64::consts::PI
                        * (t - self.samples.time[0])
                        * (sine * angle.cos() - cosine * angle.sin())
                };
                self.samples.time.iter().map(slope).collect()
            } else {
                let there = self.motion(&moved, solution)?;
                there.iter().zip(&here).map(|(a, b)| (a - b) / step).collect()
            };
            columns.push(column);
            at += 1;
        }
        Ok(columns)
    }

    /// Adds the Jacobian's columns to an assembly's normal equations, before the target.
    pub(super) fn with_jacobian(&self, assembly: &Assembly, jacobian: &[Vec<f64>]) -> Vec<Gram> {
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
    pub(crate) fn fit(&self, start: &Hypothesis) -> Result<Option<Fitted>, Error> {
        let mut h = start.clone();
        let Some(mut here) = self.assemble(&h, None)? else { return Ok(None) };
        let mut damping = 1e-3;
        let mut grams = self.with_jacobian(&here, &self.jacobian(&h, &here.solution)?);
        for _ in 0..ITERATIONS {
            let q = h.nonlinear().len();
            if q == 0 {
                break;
            }
            let total = Gram::sum(here.total.matrix.ncols() + q, grams.iter());
            let Some((better, there)) = self.step(&h, &here, &total, &mut damping)? else { break };
            let fall = (here.objective - there.objective) / here.objective.max(f64::MIN_POSITIVE);
            h = better;
            here = there;
            grams = self.with_jacobian(&here, &self.jacobian(&h, &here.solution)?);
            if fall < TOLERANCE {
                break;
            }
        }
        Ok(Some(self.finish(h, &here, grams)))
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
        for _ in 0..5 {
            let mut penalty = self.penalty(n + q);
            for i in n..n + q {
                penalty[(i, i)] = *damping * total.matrix[(i, i)];
            }
            if let Some(z) = solve(total, Some(&penalty), &bounds) {
                let mut trial = h.clone();
                let mut i = 0;
                trial.visit_nonlinear(&mut |p| {
                    let limit = box_of(&p, self.samples);
                    *p.value = (*p.value + z[n + i]).clamp(limit.lower, limit.upper);
                    i += 1;
                });
                // Two limits that cross make no stop.
                let there = self.assemble(&trial, here.point.as_ref()).ok().flatten();
                if let Some(there) = there.filter(|t| t.objective < here.objective) {
                    *damping = (*damping * 0.1).max(1e-9);
                    return Ok(Some((trial, there)));
                }
            }
            *damping *= 30.0;
        }
        Ok(None)
    }

    fn finish(&self, mut h: Hypothesis, at: &Assembly, grams: Vec<Gram>) -> Fitted {
        let layout = self.layout(&h);
        let z = at.solution.as_slice();
        let mut zeros = z[layout.zeros.clone()].to_vec();
        if let Some(drift) = &mut h.effects.drift {
            drift.per_second = z[layout.drift.start];
            // The column started at the record's first instant, the stage's clock is the lab's.
            zeros.iter_mut().for_each(|x| *x -= z[layout.drift.start] * self.samples.time[0]);
        }
        if let Some(tone) = &mut h.effects.interference {
            let (sine, cosine) = (z[layout.tone.start], z[layout.tone.start + 1]);
            tone.amplitude = sine.hypot(cosine);
            tone.phase = cosine.atan2(sine);
        }
        if let Some(load) = &mut h.effects.load {
            load.per_newton = z[layout.load.start];
        }
        if let Some(curve) = &mut h.effects.asymmetry {
            curve.weights = z[layout.zones.clone()].to_vec();
        }
        let mut bounds = self.bounds(&h);
        let values = h.nonlinear();
        bounds.extend(values.iter().map(|(v, b)| Bounds { lower: b.lower - v, upper: b.upper - v }));
        let unknowns = z.len() + values.len();
        Fitted {
            hypothesis: h,
            weights: z[layout.weights].to_vec(),
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
    pub(crate) fn fit_linear(&self, h: &Hypothesis) -> Result<Option<Fitted>, Error> {
        let Some(here) = self.assemble(h, None)? else { return Ok(None) };
        let columns = vec![vec![0.0; self.samples.len()]; h.nonlinear().len()];
        let grams = self.with_jacobian(&here, &columns);
        Ok(Some(self.finish(h.clone(), &here, grams)))
    }

    /// What separates a new column from those that a fit already has.
    pub(crate) fn projector(&self, fit: &Fitted) -> Result<Projector<'_>, Error> {
        let blocks = self.assemble(&fit.hypothesis, None)?.map(|a| a.blocks).unwrap_or_default();
        Ok(Projector::new(self, blocks))
    }

    /// Measured minus fitted output, all rows.
    pub(crate) fn residual(&self, fit: &Fitted) -> Result<Vec<f64>, Error> {
        self.residual_of(&fit.hypothesis, &fit.solution)
    }
}
