//! Load: a measured force bends the actuator, and may change its gain.

use hyst_core::{Error, LoadParams};

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::map;
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::digits::signed;
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem, SignalPath};
use crate::statistics::range;

pub(super) struct Load;

impl Diagnosable for Load {
    fn effect(&self) -> Effect {
        Effect::Load
    }

    fn kind(&self) -> EffectKind {
        EffectKind::Load
    }

    fn hidden(&self, problem: &Problem<'_>) -> Option<&'static str> {
        match &problem.samples.load {
            None => Some("the load was not recorded"),
            Some(newtons) => {
                let (low, high) = range(newtons.iter().copied());
                (high <= low).then_some("the load did not change")
            }
        }
    }

    fn columns(&self, scan: &Scan<'_>) -> Result<Option<Vec<Vec<f64>>>, Error> {
        let gain = |load: &Vec<f64>| load.iter().zip(&scan.motion).map(|(f, m)| f * m).collect();
        Ok(Some(scan.problem.samples.load.iter().flat_map(|load| [load.clone(), gain(load)]).collect()))
    }

    /// Only a deflection, or also a change of the gain. A change of exactly zero means none.
    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        let gains = [0.0, f64::MIN_POSITIVE];
        let with = |gain_per_newton| scan.with(&|e| e.load = Some(LoadParams { per_newton: 0.0, gain_per_newton }));
        Ok(gains.map(with).into())
    }

    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        let Scan { problem, from, .. } = &limits.scan;
        let Some(load) = &problem.samples.load else { return Ok(None) };
        let path = SignalPath::new(problem.samples, &from.hypothesis)?;
        let size = limits.size(1.0, f64::INFINITY, limits.least, &|per_newton| {
            let mut column: Vec<f64> = load.iter().map(|f| per_newton * f).collect();
            path.structure(&mut column);
            Ok(column)
        })?;
        let unit = format!("{}/N", limits.output);
        Ok(Some(Limit::of(size, &unit, "deflection of the output per newton of load".into())))
    }

    fn is_plausible(&self, _problem: &Problem<'_>, _fit: &Fitted) -> bool {
        true
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        effects.load.is_some_and(|p| {
            let changes_the_gain = p.gain_per_newton != 0.0 && !unsure("load.gain_per_newton", p.gain_per_newton);
            unsure("load.per_newton", p.per_newton) && !changes_the_gain
        })
    }

    fn law(&self, model: &Model) -> Option<&'static str> {
        Some(if model.effects.load?.gain_per_newton != 0.0 { "compliance-and-gain" } else { "compliance" })
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let p = context.extended.effects.load?;
        let stiffens = match p.gain_per_newton {
            0.0 => String::new(),
            gain => format!(", and the gain changes by {:+.3} % per N", 100.0 * gain),
        };
        Some(format!("the output moves by {} {} per N of load{stiffens}", signed(p.per_newton), context.symbol()))
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        let Some(p) = context.extended.effects.load else { return };
        put("load", "per_newton", p.per_newton, &format!("{}/N", context.model.output.unit));
        if p.gain_per_newton != 0.0 {
            put("load", "gain_per_newton", p.gain_per_newton, "1/N");
        }
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        map::over_load(model, scene).into_iter().collect()
    }
}
