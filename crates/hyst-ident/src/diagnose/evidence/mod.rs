//! Evidence that a person can check: for each named effect the trace that it leaves in the record where the model does not have
//! it, beside what is left with it; the whole model before and after; and where what is left lives.
//!
//! "Without" is the extended model less that one stage, everything else kept: nothing is fitted again, so what the picture shows is
//! the stage's own part. Residuals are measured − predicted, over the rows that are no start-up transient.

mod bins;
mod density;
mod drive;
mod frequency;
mod general;
mod left;
mod map;
mod picture;
mod slow;

use std::ops::Range;

pub use left::{Breakdown, Part};
pub use picture::{Axis, Curve, MOST_POINTS, Mark, Picture, Role, Style};

use crate::Samples;
use crate::fit::FitError;
use crate::model::{Base, Effect, Model};
use crate::record::{OutputUnit, Record};
use crate::simulate::{Simulation, Zero, simulate};

/// What evidence is taken from.
pub(super) struct Material<'a> {
    pub(super) extended: &'a Model,
    pub(super) named: &'a [Effect],
    pub(super) train: &'a Record,
    pub(super) test: Option<&'a Record>,
    pub(super) before: &'a Simulation,
    pub(super) after: &'a Simulation,
    pub(super) tests: Option<&'a (Simulation, Simulation)>,
    pub(super) zero: Zero,
    pub(super) noise: f64,
}

/// What a person can check.
pub(super) struct Evidence {
    pub(super) pictures: Vec<Picture>,
    pub(super) breakdowns: Vec<Breakdown>,
    pub(super) places: Vec<String>,
}

/// Pictures of every named effect and of the whole, and where what is left lives.
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
        scene.without = View::of(&scene.samples, &simulate(&lacking(m.extended, *effect), m.train, m.zero)?);
        pictures.extend(of_effect(*effect, m.extended, &scene).into_iter().filter(Picture::shows));
    }
    let breakdowns = left::breakdowns(&scene);
    let places = left::places(&scene, &breakdowns);
    Ok(Evidence { pictures, breakdowns, places })
}

/// The training record, and what two models make of it.
struct Scene<'a> {
    samples: Samples,
    without: View,
    with: View,
    /// Output's unit as a person writes it.
    unit: &'a str,
    drive_unit: &'a str,
    /// Noise floor \[output unit\].
    noise: f64,
}

/// What one model makes of a record.
struct View {
    predicted: Vec<f64>,
    /// Measured − predicted.
    residual: Vec<f64>,
}

impl View {
    fn of(samples: &Samples, simulation: &Simulation) -> Self {
        let residual = samples.output.iter().zip(&simulation.predicted).map(|(y, p)| y - p).collect();
        Self { predicted: simulation.predicted.clone(), residual }
    }
}

impl Scene<'_> {
    /// Rows that are no start-up transient.
    fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.samples.len()).filter(|k| !self.samples.settling[*k])
    }

    /// An axis of the residual.
    fn residual_axis(&self) -> Axis {
        Axis::new("measured − predicted", self.unit)
    }
}

/// Segments less their start-up rows.
fn settled_segments(samples: &Samples) -> Vec<Range<usize>> {
    let settled = |s: &Range<usize>| {
        let unsettled = samples.settling[s.clone()].iter().rposition(|settling| *settling).map_or(0, |last| last + 1);
        s.start + unsettled..s.end
    };
    samples.segments.iter().map(settled).collect()
}

/// The same model without one effect; without all modes where the effect is a resonance.
fn lacking(model: &Model, effect: Effect) -> Model {
    let mut less = model.clone();
    match (effect, &model.base) {
        (Effect::RateDependence, Base::ViscousPi(p)) => less.base = Base::Pi(p.pi.clone()),
        (Effect::Resonance, _) => less.effects.resonances.clear(),
        _ => less.effects = less.effects.without(effect),
    }
    less
}

/// The traces that an effect leaves.
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

/// The name of what the extended model leaves, in every picture.
const WITH: &str = "with it";
/// The name of what the same model leaves without the effect.
const WITHOUT: &str = "without it";
/// The name of what the parameters that were found would leave.
const NAMED: &str = "as named";

#[cfg(test)]
mod tests;
