//! Saturation: the output stops at a limit while the drive continues, or the drive at a limit of its amplifier.

use hyst_core::{CurveSide, Error, SaturationParams};

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use crate::Samples;
use crate::criteria::{MAX_SHARP_KNEE, MAX_STOP_DISTANCE, MIN_STOP_ROWS};
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::map;
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::diagnose::single_loop::only_one_loop;
use crate::diagnose::trial_parameters::stops;
use crate::digits::short;
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem, shown_motion};
use crate::statistics::range;

/// Depths of the limit that are tried, as shares of the stroke.
const DEPTHS: [f64; 3] = [0.01, 0.04, 0.15];
/// Ratio of successive depths of the limit of detection that are tried.
const DEPTH_RATIO: f64 = 1.3;
/// Smallest depth of the limit of detection, as a share of the stroke.
const MIN_DEPTH_SHARE: f64 = 1e-3;

pub(super) struct Saturation;

impl Diagnosable for Saturation {
    fn effect(&self) -> Effect {
        Effect::Saturation
    }

    fn kind(&self) -> EffectKind {
        EffectKind::OutputShape
    }

    fn hidden(&self, problem: &Problem<'_>) -> Option<&'static str> {
        only_one_loop(problem)
    }

    fn columns(&self, scan: &Scan<'_>) -> Result<Option<Vec<Vec<f64>>>, Error> {
        let (low, high) = range(scan.motion.iter().copied());
        let beyond = |share: f64| {
            let depth = share * (high - low);
            let upper = scan.motion.iter().map(|m| (high - depth - m).min(0.0)).collect();
            let lower = scan.motion.iter().map(|m| (low + depth - m).max(0.0)).collect();
            [upper, lower]
        };
        Ok(Some(match stops(scan.problem.samples, scan.from) {
            None => Vec::new(),
            Some(_) => DEPTHS.into_iter().flat_map(beyond).collect(),
        }))
    }

    /// No start has limits at both ends: a screening basis that bends towards both ends may have no saturation. None
    /// limits the drive: such a limit is searched before (`rail.rs`).
    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        let stops = stops(scan.problem.samples, scan.from).into_iter().flat_map(|[upper, lower, _]| [upper, lower]);
        Ok(stops.map(|stop| scan.with(&|e| e.saturation = Some(stop))).collect())
    }

    /// The limit is for an upper saturation limit: its distance below the highest output.
    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        let (low, high) = range(limits.scan.motion.iter().copied());
        let mut depth = MIN_DEPTH_SHARE * (high - low);
        while depth < high - low {
            let ends: Vec<f64> = limits.scan.motion.iter().map(|m| (high - depth - m).min(0.0)).collect();
            if limits.scan.left(&ends) >= limits.least {
                let meaning = "distance of the upper saturation limit below the highest output".into();
                return Ok(Some(Limit::of(Some(depth), limits.output, meaning)));
            }
            depth *= DEPTH_RATIO;
        }
        Ok(Some(Limit::imitated()))
    }

    fn is_plausible(&self, problem: &Problem<'_>, fit: &Fitted) -> bool {
        let stop = fit.hypothesis.effects.limits(CurveSide::Output);
        stop.is_none_or(|p| has_sharp_limit(problem.samples, fit, &p))
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, span: f64) -> bool {
        let Some(p) = effects.saturation else { return false };
        let span = match p.side {
            CurveSide::Output => span,
            CurveSide::Input => p.high - p.low,
        };
        ["saturation.low", "saturation.high"].iter().any(|limit| unsure(limit, span))
    }

    fn law(&self, model: &Model) -> Option<&'static str> {
        model.effects.saturation.map(|p| match p.side {
            CurveSide::Output => "knee",
            CurveSide::Input => "drive-limit",
        })
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let (name, limit) = closer_limit(context)?;
        let limit = short(limit);
        Some(match context.extended.effects.saturation?.side {
            CurveSide::Output => {
                format!("the output stops at {limit} {} at its {name} end while the drive continues", context.symbol())
            }
            CurveSide::Input => format!(
                "the actuator does not follow the drive beyond {limit} {} at its {name} end, whatever the output is there",
                context.extended.input.symbol()
            ),
        })
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        if let (Some(p), Some((name, _))) = (context.extended.effects.saturation, closer_limit(context)) {
            let (name, value) = if name == "upper" { ("high", p.high) } else { ("low", p.low) };
            let unit = match p.side {
                CurveSide::Output => &context.model.output.unit,
                CurveSide::Input => context.extended.input.symbol(),
            };
            put("saturation", name, value, unit);
            put("saturation", "knee", p.knee, "1");
        }
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        match model.effects.limits(CurveSide::Input) {
            Some(_) => map::rail(scene),
            None => map::stop(scene),
        }
    }
}

/// Returns the end at which the motion or the drive is limited, and the value of the sensor or of the drive there.
fn closer_limit(context: &Context<'_>) -> Option<(&'static str, f64)> {
    let p = context.extended.effects.saturation?;
    let ((low, high), zero) = match p.side {
        CurveSide::Output => {
            let (zero, output) = (context.extended.zero, &context.extended.output);
            ((output.low - zero, output.high - zero), zero)
        }
        CurveSide::Input => (context.samples.input_range(), 0.0),
    };
    // The limit that is closer, or exceeded further.
    Some(if p.high - high < low - p.low { ("upper", p.high + zero) } else { ("lower", p.low + zero) })
}

/// Returns whether the output reaches one of the limits and stays there for some rows.
fn has_sharp_limit(samples: &Samples, fit: &Fitted, p: &SaturationParams) -> bool {
    p.knee < MAX_SHARP_KNEE && is_close_to_limit(samples, fit, p, 0.0)
}

/// Returns whether the output comes so close to a limit that it follows the motion by less than half, for some rows. A
/// soft limit counts on a base that does not bend by itself.
pub(in crate::diagnose) fn has_soft_limit(samples: &Samples, fit: &Fitted, p: &SaturationParams) -> bool {
    // In a knee of width w the slope is 1 − x² at the fraction x of it.
    let halved = (1.0 - 0.5f64.sqrt()) * p.knee * (p.high - p.low);
    is_close_to_limit(samples, fit, p, halved)
}

/// Returns whether some rows are closer to a limit than a share of the motion's span, or than `least` \[y\].
fn is_close_to_limit(samples: &Samples, fit: &Fitted, p: &SaturationParams, least: f64) -> bool {
    let shown = shown_motion(samples, fit);
    let (low, high) = range(shown.iter().copied());
    let near = least.max(MAX_STOP_DISTANCE * (high - low));
    let touched = shown.iter().filter(|y| (p.high - **y).min(**y - p.low) < near).count();
    touched as f64 > MIN_STOP_ROWS * shown.len() as f64
}
