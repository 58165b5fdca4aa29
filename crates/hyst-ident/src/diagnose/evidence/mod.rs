//! Evidence to check by eye: the trace of each named effect in the residual of a model without it, compared with the
//! residual with it; the whole model before and after; and the breakdown of the remainder.
//!
//! "Without" is the extended model minus that one stage. Nothing is refitted, so the picture shows the contribution of
//! that stage alone. Residuals are measured − predicted, over the rows that are no start-up rows.

mod bins;
mod density;
mod drive;
pub(super) mod frequency;
mod general;
pub(super) mod map;
pub(super) mod picture;
mod residual_parts;
pub(super) mod scene;
pub(super) mod slow;

pub use picture::{Axis, Curve, MOST_POINTS, Mark, Picture, Role, Style};
pub use residual_parts::{Breakdown, Part};
pub(super) use scene::Material;

use super::effects;
use crate::Samples;
use crate::fit::FitError;
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
        let law = effects::of(*effect);
        scene.without = View::of(&scene.samples, &simulate(&law.without(m.extended), m.train, m.zero)?);
        pictures.extend(law.pictures(m.extended, &scene).into_iter().filter(Picture::shows));
    }
    let breakdowns = residual_parts::breakdowns(&scene);
    let places = residual_parts::places(&scene, &breakdowns);
    Ok(Evidence { pictures, breakdowns, places })
}

#[cfg(test)]
mod tests;
