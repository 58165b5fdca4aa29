//! Evidence to check by eye: the trace of each named effect in the residual of a model without it, compared with the
//! residual with it; the whole model before and after; and the breakdown of the remainder.
//!
//! "Without" is the extended model minus that one stage. Nothing is refitted, so the picture shows the contribution of
//! that stage alone. Residuals are measured − predicted, over the rows that are no start-up rows.

mod bins;
mod density;
mod drive;
mod frequency;
mod general;
mod map;
mod picture;
mod residual_parts;
mod scene;
mod slow;

pub use picture::{Axis, Curve, MOST_POINTS, Mark, Picture, Role, Style};
pub use residual_parts::{Breakdown, Part};
pub(super) use scene::Material;

use crate::Samples;
use crate::fit::FitError;
use crate::model::{Base, Effect, Model};
use crate::record::OutputUnit;
use crate::simulate::simulate;
use scene::{Scene, View};

/// The evidence.
pub(super) struct Evidence {
    pub(super) pictures: Vec<Picture>,
    pub(super) breakdowns: Vec<Breakdown>,
    pub(super) places: Vec<String>,
}

/// Collects the pictures of every named effect and of the whole model, and the breakdown of the remainder.
pub(super) fn collect(m: &Material<'_>) -> Result<Evidence, FitError> {
    let unit = OutputUnit::of_suffix(&m.extended.output.unit).map_or(m.extended.output.unit.as_str(), |u| u.symbol());
    let mut samples = Samples::from_record(m.train);
    samples.settling.clone_from(&m.after.settling);
    let mut scene = Scene {
        with: View::of(&samples, m.after),
        without: View::of(&samples, m.before),
        samples,
        unit,
        drive_unit: m.extended.input.symbol(),
        noise: m.noise,
    };
    let mut pictures = general::pictures(m, &scene);
    for effect in m.named {
        scene.without = View::of(&scene.samples, &simulate(&without_effect(m.extended, *effect), m.train, m.zero)?);
        pictures.extend(of_effect(*effect, m.extended, &scene).into_iter().filter(Picture::shows));
    }
    let breakdowns = residual_parts::breakdowns(&scene);
    let places = residual_parts::places(&scene, &breakdowns);
    Ok(Evidence { pictures, breakdowns, places })
}

/// Returns the model without one effect; without all modes if the effect is a resonance.
fn without_effect(model: &Model, effect: Effect) -> Model {
    let mut less = model.clone();
    match (effect, &model.base) {
        (Effect::RateDependence, Base::ViscousPi(p)) => less.base = Base::Pi(p.pi.clone()),
        (Effect::Resonance, _) => less.effects.resonances.clear(),
        _ => less.effects = less.effects.without(effect),
    }
    less
}

/// Returns the pictures of an effect.
fn of_effect(effect: Effect, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
    match effect {
        Effect::Delay | Effect::Lag => frequency::response_pictures(effect, model, scene),
        Effect::RateDependence => {
            let mut pictures = map::trailing(scene).into_iter().collect::<Vec<_>>();
            pictures.extend(frequency::response_pictures(effect, model, scene));
            pictures
        }
        Effect::Asymmetry => map::curve(model, scene).into_iter().collect(),
        Effect::Temperature => {
            let pictures = [map::gain_over_temperature(model, scene), map::expansion_over_temperature(model, scene)];
            pictures.into_iter().flatten().collect()
        }
        Effect::Creep => vec![slow::creep(scene)],
        Effect::Load => map::over_load(model, scene).into_iter().collect(),
        Effect::Resonance => {
            let modes: Vec<(f64, f64)> = model.effects.resonances.iter().map(|m| (m.hz, m.damping)).collect();
            let mut pictures: Vec<Picture> = frequency::ring_down(scene, &modes).into_iter().collect();
            pictures.push(frequency::modes(scene, &modes));
            pictures.extend(frequency::response_pictures(effect, model, scene));
            pictures
        }
        Effect::Saturation => map::stop(scene),
        Effect::Drift => vec![slow::drift(model, scene)],
        Effect::Interference => {
            let Some(tone) = model.effects.interference else { return Vec::new() };
            let mut pictures: Vec<Picture> = frequency::folded(scene, &tone).into_iter().collect();
            pictures.push(frequency::tone(scene, tone.hz));
            pictures
        }
    }
}

#[cfg(test)]
mod tests;
