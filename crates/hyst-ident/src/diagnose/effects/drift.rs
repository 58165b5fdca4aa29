//! Drift: the zero of the sensor moves with time, whatever the drive does.

use hyst_core::{DriftParams, Error};

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use crate::criteria::MIN_DRIFT_TIME;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::evidence::slow;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::digits::{short, signed};
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem};
use crate::samples::Samples;
use crate::settle::windows;

pub(super) struct Drift;

impl Diagnosable for Drift {
    fn effect(&self) -> Effect {
        Effect::Drift
    }

    fn kind(&self) -> EffectKind {
        EffectKind::Time
    }

    fn columns(&self, scan: &Scan<'_>) -> Result<Option<Vec<Vec<f64>>>, Error> {
        let time = &scan.problem.samples.time;
        let whole = time[time.len() - 1] - time[0];
        let passed = |t: &f64| (t - time[0]) / whole;
        let settles = |times: f64| time.iter().map(|t| 1.0 - (-times * passed(t)).exp()).collect();
        Ok(Some(vec![time.iter().map(passed).collect(), settles(4.0), settles(16.0)]))
    }

    /// A line; a settling drift with a quarter of the record or a shorter time constant; or both.
    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        let time = &scan.problem.samples.time;
        let since_s = time[0];
        let whole = time[time.len() - 1] - since_s;
        let laws = [(0.0, 0.0), (0.0, 0.25 * whole), (0.0, 0.06 * whole), (f64::MIN_POSITIVE, 0.25 * whole)];
        let drift = |(per_second, seconds)| DriftParams { per_second, seconds, since_s, ..DriftParams::default() };
        Ok(laws.map(|law| scan.with(&|e| e.drift = Some(drift(law)))).into())
    }

    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        let time = &limits.scan.problem.samples.time;
        let whole = time[time.len() - 1] - time[0];
        let size = limits.size(1.0, f64::INFINITY, limits.least, &|way| {
            Ok(time.iter().map(|t| way * (t - time[0]) / whole).collect())
        })?;
        Ok(Some(Limit::of(size, limits.output, "linear drift of the zero over the record".into())))
    }

    fn is_plausible(&self, problem: &Problem<'_>, fit: &Fitted) -> bool {
        let samples = problem.samples;
        fit.hypothesis.effects.drift.is_none_or(|p| {
            p.seconds == 0.0
                || p.seconds > MIN_DRIFT_TIME * samples.duration() && outlasts_the_start(samples, p.seconds)
        })
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        effects.drift.is_some_and(|p| match p.seconds > 0.0 {
            // Of a bent line only the sum of the parts is determined.
            true if p.per_second != 0.0 => false,
            true => unsure("drift.settling", p.settling) || unsure("drift.seconds", p.seconds),
            false => unsure("drift.per_second", p.per_second),
        })
    }

    fn law(&self, model: &Model) -> Option<&'static str> {
        Some(if model.effects.drift?.seconds > 0.0 { "exponential" } else { "line" })
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let (first, last) = (*context.samples.time.first()?, *context.samples.time.last()?);
        let p = context.extended.effects.drift?;
        let settles = match p.seconds > 0.0 {
            true => format!(" and settles with a time constant of {} s", short(p.seconds)),
            false => String::new(),
        };
        Some(format!(
            "the zero moves by {} {} over the {:.0} s of the record{settles}",
            signed(p.at(last) - p.at(first)),
            context.symbol(),
            last - first
        ))
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        let Some(p) = context.extended.effects.drift else { return };
        let unit = &context.model.output.unit;
        if p.seconds == 0.0 || p.per_second != 0.0 {
            put("drift", "per_second", p.per_second, &format!("{unit}/s"));
        }
        if p.seconds > 0.0 {
            put("drift", "settling", p.settling, unit);
            put("drift", "seconds", p.seconds, "s");
        }
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        vec![slow::drift(model, scene)]
    }
}

/// Returns whether a settling process with this time constant \[s\] outlasts the unknown memory from before the record.
/// The unknown start settles too, until the drive has erased it.
fn outlasts_the_start(samples: &Samples, seconds: f64) -> bool {
    let begins_at_rest = samples.pasts.first().is_none_or(Vec::is_empty);
    let rows = windows(samples).first().copied().unwrap_or(0);
    begins_at_rest || seconds > rows as f64 * samples.period_of(0)
}
