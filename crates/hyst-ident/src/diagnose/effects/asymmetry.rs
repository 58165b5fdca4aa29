//! Asymmetry: a memoryless curve before or behind the hysteresis. It is searched on the model's own base (`shape.rs`),
//! because the screening basis bends by itself.

use hyst_core::{AsymmetryParams, CurveSide, Error};

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::map;
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::diagnose::single_loop::only_one_loop;
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem};

pub(super) struct Asymmetry;

impl Diagnosable for Asymmetry {
    fn effect(&self) -> Effect {
        Effect::Asymmetry
    }

    fn kind(&self) -> EffectKind {
        EffectKind::OutputShape
    }

    fn hidden(&self, problem: &Problem<'_>) -> Option<&'static str> {
        only_one_loop(problem)
    }

    fn starts(&self, _scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        Ok(Vec::new())
    }

    fn limit(&self, _limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        Ok(None)
    }

    fn is_plausible(&self, _problem: &Problem<'_>, _fit: &Fitted) -> bool {
        true
    }

    /// A curve has several parameters, one of which may be unused.
    fn is_undetermined(&self, _effects: &Effects, _unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        false
    }

    /// A piecewise linear curve has no law.
    fn law(&self, _model: &Model) -> Option<&'static str> {
        None
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let p = context.extended.effects.asymmetry.as_ref()?;
        let (low, high) = slopes(p);
        let side = match p.side {
            CurveSide::Output => "behind",
            CurveSide::Input => "before",
        };
        Some(format!(
            "the curve {side} the hysteresis has slope {low:.3} at its lower end and {high:.3} at its upper end"
        ))
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        let Some(p) = &context.extended.effects.asymmetry else { return };
        let unit = match p.side {
            CurveSide::Input => context.extended.input.symbol(),
            CurveSide::Output => &context.model.output.unit,
        };
        for (i, (s, c)) in p.thresholds.iter().zip(&p.weights).enumerate() {
            put("asymmetry", &format!("thresholds[{i}]"), *s, unit);
            put("asymmetry", &format!("weights[{i}]"), *c, "1");
        }
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        map::curve(model, scene).into_iter().collect()
    }
}

/// Returns the slopes of a curve at its two ends.
fn slopes(p: &AsymmetryParams<Vec<f64>>) -> (f64, f64) {
    let end = |rising: bool| {
        let zones = p.thresholds.iter().zip(&p.weights).filter(|(s, _)| (**s >= 0.0) == rising);
        1.0 + zones.map(|(_, c)| c).sum::<f64>()
    };
    (end(false), end(true))
}
