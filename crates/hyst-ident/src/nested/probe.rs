//! A first estimate of what a cause would take, the base's columns held where a fit has left them.
//!
//! Only the new parameters are searched. The weights follow through the columns that the fit has already: what those imitate is projected off, so
//! that an iteration costs one pass over the record for each new parameter instead of one for each column of the base.

use hyst_core::Error;
use nalgebra::{DMatrix, DVector};

use super::assembly::Point;
use super::bounds::box_of;
use super::{Fitted, Hypothesis, Problem, Projector, SignalPath};
use crate::lsq::{Bounds, solve_near};

/// Iterations of a probe.
const ITERATIONS: usize = 8;
/// Relative fall of the objective at which it has converged.
const TOLERANCE: f64 = 1e-4;
/// Damped steps that are tried in one iteration.
const TRIES: usize = 4;
/// Iterations of an exact fit where the base's columns cannot be held.
const EXACT_ITERATIONS: usize = 3;

/// A fit, with what all probes from it share.
pub(crate) struct Vantage<'a> {
    problem: &'a Problem<'a>,
    fit: &'a Fitted,
    pub(crate) projector: Projector<'a>,
    /// Output of the operator \[y\].
    operator: Vec<f64>,
}

/// Where a probe has come to.
pub(crate) struct Probe {
    pub(crate) hypothesis: Hypothesis,
    /// Σ residual² over the rows that count.
    pub(crate) squares: f64,
}

/// Residual and what follows from it, at one set of the new parameters.
struct Place {
    hypothesis: Hypothesis,
    point: Point,
    /// In the rows that count \[y\].
    residual: Vec<f64>,
    squares: f64,
}

impl<'a> Vantage<'a> {
    /// # Errors
    /// If a stage cannot be built.
    pub(crate) fn new(problem: &'a Problem<'a>, fit: &'a Fitted) -> Result<Self, Error> {
        let (projector, operator) = (problem.projector(fit)?, problem.operator_output(fit)?);
        Ok(Self { problem, fit, projector, operator })
    }

    /// Searches what `start` holds beyond the fit. `None` if the equations cannot be solved.
    ///
    /// # Errors
    /// If a stage cannot be built at the start.
    pub(crate) fn probe(&self, start: &Hypothesis) -> Result<Option<Probe>, Error> {
        // Behind a stop the weights are others, and so is what the columns show.
        if start.effects.saturation != self.fit.hypothesis.effects.saturation {
            let fit = self.problem.fit_in(start, EXACT_ITERATIONS)?;
            return Ok(fit.map(|fit| Probe { hypothesis: fit.hypothesis, squares: fit.squares }));
        }
        let new = new_parameters(&self.fit.hypothesis, start);
        let (mut z, places) = self.solution(start);
        let Some(mut here) = self.place(start, &z)? else { return Ok(None) };
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            let Some((there, solution)) = self.step(&here, &z, &new, &places, &mut damping)? else { break };
            let fall = 1.0 - there.squares / here.squares.max(f64::MIN_POSITIVE);
            (here, z) = (there, solution);
            if fall < TOLERANCE {
                break;
            }
        }
        Ok(Some(Probe { hypothesis: here.hypothesis, squares: here.squares }))
    }

    /// The fit's linear unknowns in the layout of `h`, and the places of those that it does not have.
    fn solution(&self, h: &Hypothesis) -> (DVector<f64>, Vec<usize>) {
        let (before, layout) = (self.problem.layout(&self.fit.hypothesis), self.problem.layout(h));
        let mut z = DVector::zeros(layout.len());
        let mut places = Vec::new();
        for (from, to) in before.kinds().into_iter().zip(layout.kinds()) {
            if from.len() == to.len() {
                z.rows_mut(to.start, to.len()).copy_from(&self.fit.solution.rows(from.start, from.len()));
            } else {
                places.extend(to);
            }
        }
        (z, places)
    }

    fn place(&self, h: &Hypothesis, z: &DVector<f64>) -> Result<Option<Place>, Error> {
        let problem = self.problem;
        let path = SignalPath::new(problem.samples, h)?;
        let point = match h.drives_alike(&self.fit.hypothesis) {
            true => problem.point(h, &path, self.operator.clone(), z),
            false => problem.point_at(h, &path, z),
        };
        let residual = problem.residual_along(h, &path, &point.motion, z);
        let residual = problem.thinned(|k| residual[k]);
        let off = self.projector.off(&DMatrix::from_column_slice(residual.len(), 1, &residual));
        Ok(off.map(|gram| Place { hypothesis: h.clone(), point, residual, squares: gram.matrix[(0, 0)].max(0.0) }))
    }

    /// One damped step that lowers the error, or `None` if none does.
    fn step(
        &self,
        here: &Place,
        z: &DVector<f64>,
        new: &[usize],
        places: &[usize],
        damping: &mut f64,
    ) -> Result<Option<(Place, DVector<f64>)>, Error> {
        let (problem, h) = (self.problem, &here.hypothesis);
        let path = SignalPath::new(problem.samples, h)?;
        let mut columns = problem.jacobian_at(h, &path, &here.point, new)?;
        let thinned = |column: &[f64]| problem.thinned(|k| column[k]);
        let mut beside = problem.beside_base(h, &path, Some(&here.point), &thinned);
        beside.retain(|(place, _)| places.contains(place));
        beside.sort_by_key(|(place, _)| *place);
        columns.extend(beside.into_iter().map(|(_, column)| column));
        columns.push(here.residual.clone());
        let all = DMatrix::from_fn(here.residual.len(), columns.len(), |k, c| columns[c][k]);
        let Some(gram) = self.projector.off(&all) else { return Ok(None) };
        let values = h.nonlinear();
        let linear = problem.bounds(h);
        let around = |value: f64, b: Bounds| Bounds { lower: b.lower - value, upper: b.upper - value };
        let bounds: Vec<Bounds> = new
            .iter()
            .map(|at| around(values[*at].0, values[*at].1))
            .chain(places.iter().map(|at| around(z[*at], linear[*at])))
            .collect();
        for _ in 0..TRIES {
            let mut penalty = DMatrix::zeros(bounds.len(), bounds.len());
            for i in 0..new.len() {
                penalty[(i, i)] = *damping * gram.matrix[(i, i)];
            }
            if let Some(change) = solve_near(&gram, Some(&penalty), &bounds, None) {
                let mut there = h.clone();
                let mut i = 0;
                there.visit_nonlinear(&mut |p| {
                    if let Some(at) = new.iter().position(|n| *n == i) {
                        let limit = box_of(&p, problem.samples);
                        *p.value = (*p.value + change[at]).clamp(limit.lower, limit.upper);
                    }
                    i += 1;
                });
                let mut solution = z.clone();
                places.iter().enumerate().for_each(|(i, at)| solution[*at] += change[new.len() + i]);
                let place = self.place(&there, &solution).ok().flatten();
                if let Some(place) = place.filter(|place| place.squares < here.squares) {
                    *damping = (*damping * 0.1).max(1e-9);
                    return Ok(Some((place, solution)));
                }
            }
            *damping *= 30.0;
        }
        Ok(None)
    }
}

/// Numbers of the parameters of `start` that a hypothesis does not have.
fn new_parameters(known: &Hypothesis, start: &Hypothesis) -> Vec<usize> {
    let names = |h: &Hypothesis| {
        let mut names = Vec::new();
        h.clone().visit_nonlinear(&mut |p| names.push((p.cause, p.name)));
        names
    };
    let known = names(known);
    names(start).into_iter().enumerate().filter(|(_, name)| !known.contains(name)).map(|(at, _)| at).collect()
}
