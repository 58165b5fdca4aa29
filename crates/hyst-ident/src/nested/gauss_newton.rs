//! One fit: damped Gauss-Newton steps of the nonlinear parameters, with the linear unknowns solved at each.

use hyst_core::{CurveSide, Error};

use super::assembly::Assembly;
use super::bounds::{bounds_of, moved};
use super::{Fitted, Hypothesis, Problem};
use crate::lsq::{Bounds, Gram, solve_near};

/// Maximum number of iterations.
const ITERATIONS: usize = 14;
/// Fall of the objective at which a fit has converged, in residual variances of a row. A parameter that is one standard
/// error off costs one of them.
const TOLERANCE: f64 = 0.1;
/// Minimum amplitude of a harmonic, in standard deviations of its estimate from white noise.
const MIN_HARMONIC: f64 = 4.0;

impl Problem<'_> {
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
            let least_fall = TOLERANCE * here.objective / total.rows.max(1) as f64;
            let Some((better, there)) = self.step(&h, &here, &total, least_fall, &mut damping)? else { break };
            let fall = here.objective - there.objective;
            (h, here) = (better, there);
            jacobian = self.jacobian(&h, &here.solution)?;
            if fall < least_fall {
                break;
            }
        }
        Ok(Some(self.finish(h, &here, &jacobian)))
    }

    /// Takes one damped step that lowers the objective. Returns `None` if there is none, or if the equations predict a
    /// fall below `least_fall`.
    fn step(
        &self,
        h: &Hypothesis,
        here: &Assembly,
        total: &Gram,
        least_fall: f64,
        damping: &mut f64,
    ) -> Result<Option<(Hypothesis, Assembly)>, Error> {
        let values = h.nonlinear();
        let (q, n) = (values.len(), here.solution.len());
        let mut bounds = self.bounds(h);
        bounds.extend(values.iter().map(|(v, b)| Bounds { lower: b.lower - v, upper: b.upper - v }));
        let still = here.solution.clone().resize_vertically(n + q, 0.0);
        let penalty = self.penalty(h, total, n + q);
        for _ in 0..5 {
            let mut damped = penalty.clone();
            for i in n..n + q {
                damped[(i, i)] = *damping * total.matrix[(i, i)];
            }
            if let Some(z) = solve_near(total, Some(&damped), &bounds, Some(&still)) {
                let predicted = total.error(&z) + (z.transpose() * &penalty * &z)[(0, 0)];
                if here.objective - predicted < least_fall {
                    return Ok(None);
                }
                let mut trial = h.clone();
                let mut i = 0;
                trial.visit_nonlinear(&mut |p| {
                    let limit = bounds_of(&p, self.samples);
                    *p.value = moved(*p.value, z[n + i], limit);
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

    /// Returns the fit, with the linear unknowns written into its hypothesis.
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

    /// Returns the same fit with the derivatives with respect to its nonlinear parameters, on which their standard
    /// errors depend.
    ///
    /// # Errors
    /// If a stage cannot be built.
    pub(crate) fn with_slopes(&self, fit: &Fitted) -> Result<Option<Fitted>, Error> {
        self.fit_in(&fit.hypothesis, 0)
    }
}
