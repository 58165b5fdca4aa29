//! Group score tests: by how much further columns would lower the error of a fit.
//!
//! To first order a cause adds some columns to the output. The part of them that a fit cannot imitate determines by how
//! much they would lower Σ residual²; this takes linear algebra only.

use hyst_core::Error;

use crate::model::{Effects, Widening};
use crate::nested::{Fitted, HATS, Hypothesis, Prober, Problem, SignalPath, hat};

/// Minimum first-order gain of a cause, as a share of the gain that an effect needs.
const MIN_GAIN_SHARE: f64 = 0.05;

/// A fit, prepared for testing further columns.
pub(super) struct Scan<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) from: &'a Fitted,
    pub(super) residual: Vec<f64>,
    pub(super) motion: Vec<f64>,
    pub(super) prober: Prober<'a>,
    /// Required gain in Σ residual².
    pub(super) least_gain: f64,
    pub(super) promising: f64,
}

impl<'a> Scan<'a> {
    /// Prepares a fit to which a cause with a gain of at least `least` (Σ residual²) is to be added.
    pub(super) fn new(problem: &'a Problem<'a>, from: &'a Fitted, least: f64) -> Result<Self, Error> {
        Ok(Self {
            residual: problem.residual(from)?,
            motion: problem.motion(&from.hypothesis, &from.solution)?,
            prober: Prober::new(problem, from)?,
            least_gain: least,
            promising: MIN_GAIN_SHARE * least,
            problem,
            from,
        })
    }

    /// Returns the gain of a column and its best factor, if the gain is promising and the factor positive.
    pub(super) fn gain(&self, column: &[f64]) -> Option<(f64, f64)> {
        let (gain, amplitude) = self.prober.projector.gain(column, &self.residual);
        (amplitude > 0.0 && gain >= self.promising).then_some((gain, amplitude))
    }

    /// Returns Σ squares of the part of a column that the fit cannot imitate.
    pub(super) fn left(&self, column: &[f64]) -> f64 {
        self.prober.projector.unexplained(column)
    }

    /// Returns the change of the motion with another hypothesis.
    pub(super) fn moved(&self, h: &Hypothesis) -> Result<Vec<f64>, Error> {
        let mut moved = self.problem.motion(h, &self.from.solution)?;
        moved.iter_mut().zip(&self.motion).for_each(|(a, b)| *a -= b);
        Ok(moved)
    }

    /// Returns the fit's hypothesis with other effects.
    pub(super) fn with(&self, change: &dyn Fn(&mut Effects)) -> Hypothesis {
        let mut h = self.from.hypothesis.clone();
        change(&mut h.effects);
        h
    }

    /// Returns the change of the motion with other effects.
    pub(super) fn moved_with(&self, change: &dyn Fn(&mut Effects)) -> Result<Vec<f64>, Error> {
        self.moved(&self.with(change))
    }

    /// Returns the joint gain of some columns in Σ residual².
    pub(super) fn joint_gain(&self, columns: &[Vec<f64>]) -> f64 {
        self.prober.projector.joint_gain(columns, &self.residual)
    }

    /// Returns the joint gain of the play operators of a widening.
    pub(super) fn gain_of_widening(&self, widening: &Widening) -> Result<f64, Error> {
        let mut h = self.from.hypothesis.clone();
        h.effects.widening = Some(widening.clone());
        let path = SignalPath::new(self.problem.samples, &h)?;
        let mut columns = path.widening().to_vec();
        path.output_side_of(&mut columns);
        Ok(self.joint_gain(&columns))
    }

    /// Returns the change of the motion by stages behind it.
    pub(super) fn behind(&self, effects: Effects) -> Result<Vec<f64>, Error> {
        let mut moved = self.motion.clone();
        SignalPath::new(self.problem.samples, &Hypothesis::of(effects))?.output_side(&mut moved);
        moved.iter_mut().zip(&self.motion).for_each(|(a, b)| *a -= b);
        Ok(moved)
    }

    /// Returns a course times the drive, row by row.
    pub(super) fn times_drive(&self, course: &[f64]) -> Vec<f64> {
        course.iter().zip(&self.problem.samples.input).map(|(x, u)| x * u).collect()
    }

    /// Returns the columns of a wander over the record: hat functions times `of` in each row.
    pub(super) fn hats(&self, of: &dyn Fn(usize) -> f64) -> Vec<Vec<f64>> {
        let rows = self.problem.samples.len();
        let share = |k: usize| k as f64 / rows.max(2) as f64;
        (0..HATS).map(|j| (0..rows).map(|k| hat(j, share(k)) * of(k)).collect()).collect()
    }
}
