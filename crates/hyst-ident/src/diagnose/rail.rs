//! Searches for a limit of the drive: an amplifier that gives less voltage than it is asked for.
//!
//! With a limited drive a rate-independent operator is another operator of the same kind, which a rich basis
//! represents. So no search on such a basis finds the limit, and a base model that is coarser only seems too coarse. But
//! the record shows the limit by itself: beyond it the output does not follow the drive, and just inside it does. The
//! limit is searched first. All further steps see the limited drive.

use std::ops::Range;

use hyst_core::{Error, SaturationParams};

use super::own_model::{OwnModel, SHAPE_ROWS};
use super::search::Named;
use super::trial::Trial;
use super::trial_parameters::{KNEE, UNUSED_LIMIT_DISTANCE};
use super::{score, shape};
use crate::criteria::{HALF, MIN_STD_ERRORS, MIN_STOP_ROWS, MINOR_SHARE};
use crate::fit::FitError;
use crate::lsq::{BLOCKS, Blocks};
use crate::model::{Effect, Effects};
use crate::nested::{Fitted, Hypothesis, SignalPath};
use crate::noise::noise_floor;
use crate::samples::Samples;

/// Depths of the limits that are tried: the smallest and the largest as a share of the drive's range, and the ratio of
/// successive ones.
const DEPTHS: std::ops::RangeInclusive<f64> = 0.01..=0.7;
const DEPTH_RATIO: f64 = 1.2;

/// A limit of the drive.
pub(super) struct Rail {
    pub(super) limits: SaturationParams,
    /// The model's base with it.
    pub(super) fit: Fitted,
    pub(super) named: Named,
}

impl Rail {
    /// Returns the drive that the amplifier gives \[u\].
    pub(super) fn given(&self, samples: &Samples) -> Result<Vec<f64>, Error> {
        let limited = Hypothesis::of(Effects { saturation: Some(self.limits), ..Effects::default() });
        Ok(SignalPath::new(samples, &limited)?.input_side().to_vec())
    }
}

impl OwnModel<'_> {
    /// Returns the limit of the drive that the record shows, if the model's base with what it already contains
    /// (`known`) predicts better with it than without it, and than with a limit of the motion.
    pub(super) fn rail(&self, known: &Hypothesis, seed: u64) -> Result<Option<Rail>, FitError> {
        if known.effects.saturation.is_some() {
            return Ok(None);
        }
        let starts: Vec<SaturationParams> =
            starts(self.samples).filter(|limits| hides_the_drive(self.samples, limits)).collect();
        if starts.is_empty() {
            return Ok(None);
        }
        let stage = |e| self.stage(e);
        let blocks = Blocks::new(self.samples, BLOCKS, SHAPE_ROWS);
        let problem = self.on(self.basis, &blocks).with_linear_effects_fixed();
        let Some(plain) = shape::plain(&problem, known).map_err(stage)? else { return Ok(None) };
        let mut best: Option<(SaturationParams, Trial)> = None;
        for start in starts {
            let Some(fit) = shape::from_limits(&problem, &plain.fit, start).map_err(stage)? else { continue };
            let Some(limits) = fit.hypothesis.effects.saturation else { continue };
            let is_better = best.as_ref().is_none_or(|(_, best)| fit.squares < best.fit.squares);
            if is_better && hides_the_drive(self.samples, &limits) {
                best = Trial::of(&problem, fit).map(|trial| (limits, trial)).or(best);
            }
        }
        let Some((limits, with)) = best else { return Ok(None) };
        let noise = noise_floor(&problem.residual(&with.fit).map_err(stage)?, &self.samples.segments);
        let judgement = score::judge(&problem, &plain, &with, noise, seed);
        let stops = shape::stopped(&problem, &plain.fit).map_err(stage)?;
        let is_a_stop = stops.iter().any(|stop| stop.squares < with.fit.squares);
        if is_a_stop || !judgement.accepted() {
            return Ok(None);
        }
        let (cv_without, cv_with) = (plain.cv_rmse(), with.cv_rmse());
        let named = Named { effect: Effect::Saturation, cv_without, cv_with, rivals: Vec::new(), judgement };
        let fit = problem.with_slopes(&with.fit).map_err(stage)?.unwrap_or(with.fit);
        Ok(Some(Rail { limits, fit, named }))
    }
}

/// Returns limits at one end of the drive, inside its range; the limit at the other end is far away.
fn starts(samples: &Samples) -> impl Iterator<Item = SaturationParams> {
    let (low, high) = samples.input_range();
    let far = UNUSED_LIMIT_DISTANCE * (high - low);
    let shares = std::iter::successors(Some(*DEPTHS.start()), |share| Some(share * DEPTH_RATIO));
    let depths = shares.take_while(|share| share <= DEPTHS.end()).map(move |share| share * (high - low));
    depths.filter(|depth| *depth > 0.0).flat_map(move |depth| {
        let (lower, upper) = (low + depth, high - depth);
        [SaturationParams::before(upper - far, upper, KNEE), SaturationParams::before(lower, lower + far, KNEE)]
    })
}

/// Sums of a straight line through some runs of rows, each about its own means.
#[derive(Default)]
struct Slope {
    rows: usize,
    uu: f64,
    uy: f64,
    yy: f64,
}

impl Slope {
    /// Adds a run of consecutive rows.
    fn add(&mut self, samples: &Samples, run: Range<usize>) {
        let n = run.len() as f64;
        let mean = |of: &[f64]| of[run.clone()].iter().sum::<f64>() / n;
        let (u, y) = (mean(&samples.input), mean(&samples.output));
        for k in run.clone() {
            let (du, dy) = (samples.input[k] - u, samples.output[k] - y);
            self.rows += 1;
            self.uu += du * du;
            self.uy += du * dy;
            self.yy += dy * dy;
        }
    }

    /// Returns the slope \[y/u\] and its standard error; `None` without a change of the drive.
    fn value(&self) -> Option<(f64, f64)> {
        let slope = self.uy / self.uu;
        let left = (self.yy - slope * self.uy).max(0.0) / self.rows.max(1) as f64;
        slope.is_finite().then(|| (slope, (left / self.uu).sqrt()))
    }
}

/// Returns the slope of the output over the drive in the runs of settled rows whose drive satisfies `counts`.
fn slope(samples: &Samples, counts: impl Fn(f64) -> bool) -> Slope {
    let mut slope = Slope::default();
    let is_in = |k: usize| counts(samples.input[k]) && !samples.settling[k];
    for segment in &samples.segments {
        let mut start = segment.start;
        while start < segment.end {
            let end = (start..segment.end).find(|k| is_in(*k) != is_in(start)).unwrap_or(segment.end);
            if is_in(start) {
                slope.add(samples, start..end);
            }
            start = end;
        }
    }
    slope
}

/// Returns whether the output ignores the drive beyond one of the limits: its slope over the drive there is a minor
/// part of the slope in a range of the same width just inside the limit, and that one is no small part of the gain of
/// the whole record.
fn hides_the_drive(samples: &Samples, p: &SaturationParams) -> bool {
    let (low, high) = samples.input_range();
    let knee = p.knee * (p.high - p.low);
    let least = HALF * samples.output_span() / (high - low);
    // With the drive turned around, the lower limit is an upper one.
    [(p.high, high, 1.0), (-p.low, -low, -1.0)].into_iter().any(|(limit, end, sign)| {
        let width = end - limit;
        if width <= knee {
            return false;
        }
        let beyond = slope(samples, |u| sign * u > limit);
        let inside = slope(samples, |u| (limit - knee - width..limit - knee).contains(&(sign * u)));
        let is_seen = beyond.rows as f64 > MIN_STOP_ROWS * samples.len() as f64;
        let (Some((beyond, error)), Some((inside, _))) = (beyond.value(), inside.value()) else { return false };
        is_seen && inside.abs() >= least && beyond.abs() + MIN_STD_ERRORS * error <= MINOR_SHARE * inside.abs()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_core::{Build, Env, Saturation, Stage};

    /// A triangle wave of growing amplitude and the output of `law`, with some noise.
    fn samples(law: impl Fn(f64) -> f64) -> Samples {
        let wave = |x: f64| (x - 4.0 * (x / 4.0).floor() - 2.0).abs() - 1.0;
        let input: Vec<f64> = (0..4000).map(|k| 12.5e-3 * f64::from(k) * wave(f64::from(k) / 100.0)).collect();
        let noise = |k: usize| 0.02 * (7.3 * k as f64).sin();
        let output = input.iter().enumerate().map(|(k, u)| law(*u) + noise(k)).collect();
        Samples::of_columns(1e-3, input, output)
    }

    #[test]
    fn only_a_sharp_limit_of_the_drive_hides_it() {
        let rail = SaturationParams::before(-300.0, 40.0, 1e-3);
        let limits: Saturation<f64> = rail.build(&()).unwrap();
        let limited = |u: f64| 0.2 * limits.step(&mut (), &Env::default(), u);
        assert!(hides_the_drive(&samples(limited), &rail));
        assert!(hides_the_drive(&samples(|u| -limited(-u)), &SaturationParams::before(-40.0, 300.0, 1e-3)));
        // The output goes on, with the same slope, with a smaller one, and into a soft saturation.
        assert!(!hides_the_drive(&samples(|u| 0.2 * u), &rail));
        assert!(!hides_the_drive(&samples(|u| limited(u) + 0.05 * (u - 40.0).max(0.0)), &rail));
        assert!(!hides_the_drive(&samples(|u| 8.0 * (u / 40.0).tanh()), &rail));
        // The drive does not go beyond the limit.
        assert!(!hides_the_drive(&samples(limited), &SaturationParams::before(-300.0, 60.0, 1e-3)));
    }
}
