//! Creep: the output continues to move after the drive has stopped.

use hyst_core::{CreepParams, Error};

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use crate::criteria::HALF;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::evidence::slow;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::diagnose::trial_parameters::{PER_DECADE, bank};
use crate::model::{Effect, Effects, Model, creep_share};
use crate::nested::{Fitted, Hypothesis, Problem};
use crate::samples::Samples;

/// Minimum number of rows of a hold.
const MIN_HOLD_ROWS: usize = 50;
/// Largest limit of detection: continued motion per decade, as a share of the step.
const MAX_LIMIT: f64 = 1.0;

pub(super) struct Creep;

impl Diagnosable for Creep {
    fn effect(&self) -> Effect {
        Effect::Creep
    }

    fn kind(&self) -> EffectKind {
        EffectKind::SlowMemory
    }

    fn columns(&self, scan: &Scan<'_>) -> Result<Option<Vec<Vec<f64>>>, Error> {
        // Each element separately: the search may use any of them.
        let all = bank(scan.problem.samples, scan.problem.only_loop, 0.01 / PER_DECADE);
        let one = |i: usize| {
            let shares = (0..all.shares.len()).map(|j| if i == j { all.shares[j] } else { 0.0 }).collect();
            let creep = Some(CreepParams { shares, seconds: all.seconds.clone() });
            scan.behind(Effects { creep, ..Effects::default() })
        };
        (0..all.shares.len()).step_by(2).map(one).collect::<Result<_, _>>().map(Some)
    }

    /// From zero and from an ordinary creep: a lag and a creep can block each other in a local minimum.
    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        let Problem { samples, only_loop, .. } = scan.problem;
        Ok([0.0, 0.01].map(|share| scan.with(&|e| e.creep = Some(bank(samples, *only_loop, share)))).into())
    }

    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        let Problem { samples, only_loop, .. } = limits.scan.problem;
        let size = limits.size(1e-3, MAX_LIMIT, limits.least, &|decade| {
            let creep = Some(bank(samples, *only_loop, decade / PER_DECADE));
            limits.scan.behind(Effects { creep, ..Effects::default() })
        })?;
        Ok(Some(Limit::of(size, "1", "continued motion per decade of time, as a share of the step".into())))
    }

    fn is_plausible(&self, _problem: &Problem<'_>, fit: &Fitted) -> bool {
        fit.hypothesis.effects.creep.as_ref().is_none_or(|p| p.total() > 0.0 && p.total() < HALF)
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        effects.creep.as_ref().is_some_and(|p| unsure("creep.total", p.total()))
    }

    /// A bank of relaxations has no law.
    fn law(&self, _model: &Model) -> Option<&'static str> {
        None
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let (p, (hold, holds)) = (context.extended.effects.creep.as_ref()?, longest_hold(context.samples));
        let shares = p.seconds.iter().zip(&p.shares);
        let share: f64 = shares.map(|(tau, share)| share * (1.0 - (-hold / tau).exp())).sum();
        let share = 100.0 * share;
        Some(match holds {
            true => format!(
                "in the longest hold ({hold:.2} s) the output continues to move by {share:.1} % of the step before it"
            ),
            false => format!(
                "the drive has no hold; in {hold:.2} s (the longest segment) the output would continue to move by {share:.1} % of a step"
            ),
        })
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        let Some(p) = &context.extended.effects.creep else { return };
        for (tau, share) in p.seconds.iter().zip(&p.shares).filter(|(_, share)| **share > 0.0) {
            put("creep", &creep_share(*tau), *share, "1");
        }
        put("creep", "total", p.total(), "1");
    }

    fn pictures(&self, _model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        vec![slow::creep(scene)]
    }
}

/// Returns the longest hold of the drive \[s\] and `true`; without a hold, the longest segment \[s\] and `false`.
fn longest_hold(samples: &Samples) -> (f64, bool) {
    let (low, high) = samples.input_range();
    let still = |a: f64, b: f64| (a - b).abs() <= 1e-6 * (high - low);
    let holds = samples.segments.iter().enumerate().flat_map(|(i, s)| {
        let runs = samples.input[s.clone()].chunk_by(move |a, b| still(*a, *b)).map(<[f64]>::len);
        runs.filter(|rows| *rows > MIN_HOLD_ROWS).map(move |rows| samples.period_of(i) * (rows - 1) as f64)
    });
    match holds.reduce(f64::max) {
        Some(longest) => (longest, true),
        None => (samples.longest_segment(), false),
    }
}
