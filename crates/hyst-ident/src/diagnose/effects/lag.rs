//! Lag: a first-order low-pass, such as that of an amplifier that charges the actuator's capacitance.

use hyst_core::{Error, LagParams};
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

pub(super) struct Lag;

fn set(effects: &mut Effects, seconds: f64) {
    effects.lag = Some(LagParams { seconds });
}

impl Diagnosable for Lag {
    fn effect(&self) -> Effect {
        Effect::Lag
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
        late::limit(limits, "time constant of a first-order lag", &set)
    }

    fn is_plausible(&self, problem: &Problem<'_>, fit: &Fitted) -> bool {
        fit.hypothesis.effects.lag.is_none_or(|p| late::is_long_enough(problem, fit, p.seconds))
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        effects.lag.is_some_and(|p| unsure("lag.seconds", p.seconds))
    }

    fn law(&self, _model: &Model) -> Option<&'static str> {
        Some("first-order")
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let corner_hz = 1.0 / (2.0 * std::f64::consts::PI * context.extended.effects.lag?.seconds);
        Some(format!("the phase follows a first-order lag with a corner frequency of {corner_hz:.1} Hz"))
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        if let Some(p) = context.extended.effects.lag {
            put("lag", "seconds", p.seconds, "s");
        }
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        let Some(LagParams { seconds }) = model.effects.lag else { return Vec::new() };
        let one = Complex::new(1.0, 0.0);
        let filter = Filter {
            effect: Effect::Lag,
            phase_says: "A first-order lag shifts the phase towards −90°, by −45° at its corner frequency.",
            gain_says: "A first-order lag lowers the gain to 0.71 at its corner frequency, and more above it.",
            response: Some(&|w| one / Complex::new(1.0, w * seconds)),
        };
        response_pictures(&filter, scene)
    }
}
