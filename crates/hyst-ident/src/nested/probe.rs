//! A first estimate of the gain of a cause, with the columns of the basis held as in an existing fit.
//!
//! Only the new parameters are searched. The weights follow through the existing columns: what those can imitate is
//! projected off. So an iteration costs one pass over the record for each new parameter instead of one for each column
//! of the basis.

use hyst_core::{CurveSide, Error};
use nalgebra::{DMatrix, DVector};

use super::bounds::{bounds_of, moved};
use super::motion::Point;
use super::projector::Projector;
use super::{Fitted, Hypothesis, Problem, SignalPath};
use crate::lsq::{Bounds, solve_near};

/// Maximum number of iterations of a probe.
const ITERATIONS: usize = 8;
/// Relative fall of the objective at which a probe has converged.
const TOLERANCE: f64 = 1e-4;
/// Number of damped steps that are tried in one iteration.
const TRIES: usize = 4;
/// Iterations of an exact fit, if the columns of the basis cannot be held.
const EXACT_ITERATIONS: usize = 3;

/// A fit, with the data that all probes from it share.
pub(crate) struct Prober<'a> {
    problem: &'a Problem<'a>,
    fit: &'a Fitted,
    pub(crate) projector: Projector<'a>,
    /// Output of the operator \[y\].
    operator: Vec<f64>,
}

/// Result of a probe.
#[derive(Clone)]
pub(crate) struct Probe {
    pub(crate) hypothesis: Hypothesis,
    /// Σ residual² over the rows that count.
    pub(crate) squares: f64,
}

/// Residual and its consequences at one set of the new parameters.
struct Place {
    hypothesis: Hypothesis,
    point: Point,
    /// Residual in the rows that count \[y\].
    residual: Vec<f64>,
    squares: f64,
}

impl<'a> Prober<'a> {
    /// # Errors
    /// If a stage cannot be built.
    pub(crate) fn new(problem: &'a Problem<'a>, fit: &'a Fitted) -> Result<Self, Error> {
        let (projector, operator) = (problem.projector(fit)?, problem.operator_output(fit)?);
        Ok(Self { problem, fit, projector, operator })
    }

    /// Searches the parameters of `start` that the fit does not have. Returns `None` if the equations cannot be solved.
    ///
    /// # Errors
    /// If a stage cannot be built at the start.
    pub(crate) fn probe(&self, start: &Hypothesis) -> Result<Option<Probe>, Error> {
        // Another saturation changes the weights and the slopes of all columns.
        let stop = |h: &Hypothesis| h.effects.limits(CurveSide::Output);
        if stop(start) != stop(&self.fit.hypothesis) {
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

    /// Returns the fit's linear unknowns in the layout of `h`, and the positions of those that the fit does not have.
    fn solution(&self, h: &Hypothesis) -> (DVector<f64>, Vec<usize>) {
        let before = self.problem.layout(&self.fit.hypothesis);
        before.mapped(&self.fit.solution, &self.problem.layout(h))
    }

    fn place(&self, h: &Hypothesis, z: &DVector<f64>) -> Result<Option<Place>, Error> {
        let problem = self.problem;
        let path = SignalPath::new(problem.samples, h)?;
        let point = match h.has_same_drive(&self.fit.hypothesis) {
            true => problem.point(h, &path, self.operator.clone(), z),
            false => problem.point_at(h, &path, z),
        };
        let residual = problem.residual_along(h, &path, &point.motion, z);
        let residual = problem.at_used_rows(|k| residual[k]);
        let projected = self.projector.projected(&DMatrix::from_column_slice(residual.len(), 1, &residual));
        Ok(projected.map(|gram| Place {
            hypothesis: h.clone(),
            point,
            residual,
            squares: gram.matrix[(0, 0)].max(0.0),
        }))
    }

    /// Takes one damped step that lowers the error; returns `None` if there is none.
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
        let at_used_rows = |column: &[f64]| problem.at_used_rows(|k| column[k]);
        let mut beside = problem.other_columns(h, &path, Some(&here.point), &at_used_rows);
        beside.retain(|(place, _)| places.contains(place));
        beside.sort_by_key(|(place, _)| *place);
        columns.extend(beside.into_iter().map(|(_, column)| column));
        columns.push(here.residual.clone());
        let all = DMatrix::from_fn(here.residual.len(), columns.len(), |k, c| columns[c][k]);
        let Some(gram) = self.projector.projected(&all) else { return Ok(None) };
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
                        let limit = bounds_of(&p, problem.samples);
                        *p.value = moved(*p.value, change[at], limit);
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

/// Returns the indices of the parameters of `start` that the `known` hypothesis does not have.
fn new_parameters(known: &Hypothesis, start: &Hypothesis) -> Vec<usize> {
    let names = |h: &Hypothesis| {
        let mut names = Vec::new();
        h.clone().visit_nonlinear(&mut |p| names.push((p.cause, p.name)));
        names
    };
    let known = names(known);
    names(start).into_iter().enumerate().filter(|(_, name)| !known.contains(name)).map(|(at, _)| at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Samples;
    use crate::base::ScreeningBasis;
    use crate::lsq::Blocks;
    use crate::model::{CreepBank, Effects};
    use hyst_core::{CreepParams, DriftParams, LagParams, TemperatureParams, play};

    /// Play operators under a drive of several rates. The drive is late by 4 ms if `late`; `also` adds a further output
    /// in each row \[y\].
    fn samples(late: bool, also: impl Fn(usize, f64) -> f64) -> Samples {
        let rows = 6000;
        let drive = |t: f64| 50.0 * (1.0 - (5.0 * t * (1.0 + t)).cos()) * (0.6 + 0.4 * (1.1 * t).cos());
        let input: Vec<f64> = (0..rows).map(|k| drive(1e-3 * f64::from(k))).collect();
        let (mut v, mut before, mut plays) = (0.0, 0.0, [0.0; 6]);
        let output = input.iter().enumerate().map(|(k, u)| {
            // The mean of both rows: with the drive at either row the lag would be half a period off.
            let between = 0.5 * (before + u);
            before = *u;
            v = if late { v + (between - v) * (1.0 - (-0.25f64).exp()) } else { *u };
            plays.iter_mut().enumerate().for_each(|(i, p)| *p = play(*p, v, 3.0 * (i + 1) as f64));
            let y = 0.1 * v + 0.01 * plays.iter().sum::<f64>();
            y + also(k, y) + 2e-3 * (1e4 * (y + 0.37 * k as f64)).sin()
        });
        let output = output.collect();
        Samples::of_columns(1e-3, input, output)
    }

    /// Returns the results of a probe and of a full fit from the same start.
    fn both(samples: &Samples, start: Effects) -> (Probe, Fitted, f64) {
        let basis = ScreeningBasis::for_samples(samples, false, None);
        let blocks = Blocks::new(samples, 40, 3000);
        let problem = Problem::new(samples, &basis, &blocks, false);
        let from = problem.fit(&Hypothesis::default()).unwrap().unwrap();
        let prober = Prober::new(&problem, &from).unwrap();
        let probe = prober.probe(&Hypothesis::of(start.clone())).unwrap().unwrap();
        let fit = problem.fit(&Hypothesis::of(start)).unwrap().unwrap();
        (probe, fit, from.squares)
    }

    #[test]
    fn a_probe_finds_the_parameters_of_a_full_fit() {
        let lag = Effects { lag: Some(LagParams { seconds: 1e-3 }), ..Effects::default() };
        let (probe, fit, before) = both(&samples(true, |_, _| 0.0), lag);
        let seconds = |h: &Hypothesis| h.effects.lag.unwrap().seconds;
        // The columns are held at a drive without lag: an eighth of second order remains.
        assert!(probe.squares < 0.15 * before, "{} of {before}", probe.squares);
        let (probed, fitted) = (seconds(&probe.hypothesis), seconds(&fit.hypothesis));
        assert!((probed / fitted - 1.0).abs() < 0.1 && (fitted / 4e-3 - 1.0).abs() < 0.05, "{probed} {fitted}");
    }

    /// A linear amplitude is found in the first step; only the time constant is searched.
    #[test]
    fn a_probe_finds_a_settling_drift() {
        let settles = |k: usize, _: f64| 0.4 * (1.0 - (-1e-3 * k as f64 / 1.5).exp());
        let drift = DriftParams { seconds: 0.8, ..DriftParams::default() };
        let (probe, fit, before) = both(&samples(false, settles), Effects { drift: Some(drift), ..Effects::default() });
        assert!(probe.squares < 0.1 * before && probe.squares < 1.5 * fit.squares, "{} {}", probe.squares, fit.squares);
        let seconds = probe.hypothesis.effects.drift.unwrap().seconds;
        assert!((seconds / 1.5 - 1.0).abs() < 0.1, "{seconds} s");
    }

    #[test]
    fn a_gain_over_temperature_and_a_creep_are_found() {
        let degc = |k: usize| 23.0 + 4.0 * (9e-4 * k as f64).sin();
        let warm = Samples {
            temperature: Some((0..6000).map(degc).collect()),
            ..samples(false, |k, y| 0.01 * (degc(k) - 23.0) * y)
        };
        let gain = TemperatureParams { reference_degc: 23.0, ..TemperatureParams::default() };
        let (probe, ..) = both(&warm, Effects { temperature: Some(gain), ..Effects::default() });
        let per_kelvin = probe.hypothesis.effects.temperature.unwrap().per_kelvin;
        assert!((per_kelvin / 0.01 - 1.0).abs() < 0.05, "{per_kelvin}");
        // Without creep in the record, the shares stay at zero.
        let bank: CreepBank = CreepParams { seconds: vec![0.2, 2.0], shares: vec![0.0, 0.0] };
        let (probe, _, before) = both(&samples(false, |_, _| 0.0), Effects { creep: Some(bank), ..Effects::default() });
        assert!(probe.squares > 0.9 * before, "{} of {before}", probe.squares);
    }

    #[test]
    fn only_the_new_parameters_are_searched() {
        let lag = Some(LagParams { seconds: 1e-3 });
        let known = Hypothesis::of(Effects { lag, ..Effects::default() });
        let drift = Some(DriftParams { seconds: 0.5, ..DriftParams::default() });
        let start = Hypothesis::of(Effects { lag, drift, ..Effects::default() });
        assert_eq!(new_parameters(&known, &start), [1]);
        assert!(new_parameters(&start, &start).is_empty());
    }
}
