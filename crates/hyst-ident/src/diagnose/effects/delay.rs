//! Delay: the output repeats the drive a fixed time later.

use hyst_core::{DelayParams, Error};
use nalgebra::Complex;

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use super::late;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::frequency::{Filter, response_pictures};
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem};

pub(super) struct Delay;

fn set(effects: &mut Effects, seconds: f64) {
    effects.delay = Some(DelayParams { seconds });
}

impl Diagnosable for Delay {
    fn effect(&self) -> Effect {
        Effect::Delay
    }

    fn kind(&self) -> EffectKind {
        EffectKind::LinearDynamics
    }

    fn is_late(&self) -> bool {
        true
    }

    fn columns(&self, scan: &Scan<'_>) -> Result<Option<Vec<Vec<f64>>>, Error> {
        late::columns(scan, &set)
    }

    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        late::starts(scan, &set)
    }

    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        late::limit(limits, "delay of the output, the same at every frequency", &set)
    }

    fn is_plausible(&self, problem: &Problem<'_>, fit: &Fitted) -> bool {
        fit.hypothesis.effects.delay.is_none_or(|p| late::is_long_enough(problem, fit, p.seconds))
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        effects.delay.is_some_and(|p| unsure("delay.seconds", p.seconds))
    }

    fn law(&self, _model: &Model) -> Option<&'static str> {
        Some("dead-time")
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let seconds = context.extended.effects.delay?.seconds;
        Some(format!("the output is delayed by {:.3} ms at every frequency", 1e3 * seconds))
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        if let Some(p) = context.extended.effects.delay {
            put("delay", "seconds", p.seconds, "s");
        }
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        let Some(DelayParams { seconds }) = model.effects.delay else { return Vec::new() };
        let filter = Filter {
            effect: Effect::Delay,
            phase_says: "A dead time shifts the phase in proportion to frequency.",
            gain_says: "A dead time does not change the gain.",
            response: Some(&|w| Complex::from_polar(1.0, -w * seconds)),
        };
        response_pictures(&filter, scene)
    }
}
