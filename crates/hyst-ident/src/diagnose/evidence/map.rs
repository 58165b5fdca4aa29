//! What depends on a quantity of the same moment: temperature, load, rate, or the output itself.

use hyst_core::CurveSide;

use super::bins::Bins;
use super::drive::{Branch, branches, rates};
use super::{Axis, NAMED, Picture, Role, Scene, View, WITH, WITHOUT};
use crate::model::{Effect, Model};
use crate::nested::warmth;

/// Points over a quantity's range.
const POINTS: usize = 12;
/// Points over the output's range.
const FINE: usize = 40;
/// Decades of rate that are shown, and points in each.
const DECADES: f64 = 4.0;
const PER_DECADE: f64 = 6.0;

fn both<'a>(scene: &'a Scene<'_>) -> [(Role, &'static str, &'a View); 2] {
    [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)]
}

/// Draws what was found through the points of a picture's first curve.
fn named(picture: &mut Picture, of: impl Fn(f64) -> f64) {
    if let Some(x) = picture.curves.first().map(|c| c.x.clone()) {
        let y: Vec<f64> = x.iter().map(|x| of(*x)).collect();
        picture.line(Role::Reference, NAMED, &x, &y);
    }
}

/// The temperature that acts in each row \[°C\], behind its thermal lag where the model has one, and what its axis is called.
fn acting_temperature(model: &Model, scene: &Scene<'_>) -> Option<(Vec<f64>, Axis)> {
    let measured = scene.samples.temperature.as_ref()?;
    let Some(p) = model.effects.temperature.filter(|p| p.seconds > 0.0) else {
        return Some((measured.clone(), Axis::new("temperature", "°C")));
    };
    let degc = warmth(&scene.samples, &p).ok()??.kelvin.into_iter().map(|kelvin| p.reference_degc + kelvin).collect();
    Some((degc, Axis::new("temperature behind its thermal lag", "°C")))
}

/// By how much the measured motion is larger than the predicted one, over temperature.
///
/// In each stretch of temperature the slope of the residual over the motion: the sensor's zero has no part in it.
pub(super) fn gain_over_temperature(model: &Model, scene: &Scene<'_>) -> Option<Picture> {
    let (degc, x) = acting_temperature(model, scene)?;
    let bins = Bins::over(scene.rows().map(|k| degc[k]), POINTS)?;
    let y = Axis::new("gain, measured over predicted, less 1", "%");
    let caption = "Slope of the residual over the motion, at each temperature. A gain that follows temperature lies along a straight \
        line without it, and about zero with it; what both share is the base's own misfit.";
    let mut picture = Picture::new(Some(Effect::Temperature), "Gain over temperature", x, y, caption);
    for (role, name, view) in both(scene) {
        let rows = scene.rows().map(|k| (degc[k], scene.without.predicted[k], 100.0 * view.residual[k]));
        picture.points(role, name, bins.slopes(rows));
    }
    if let Some(p) = model.effects.temperature {
        named(&mut picture, |t| 100.0 * p.per_kelvin * (t - p.reference_degc));
    }
    Some(picture)
}

/// The residual over temperature, where the model expands.
pub(super) fn expansion_over_temperature(model: &Model, scene: &Scene<'_>) -> Option<Picture> {
    let p = model.effects.temperature.filter(|p| p.expansion != 0.0)?;
    let (degc, x) = acting_temperature(model, scene)?;
    let bins = Bins::over(scene.rows().map(|k| degc[k]), POINTS)?;
    let caption = "Means at each temperature. What expands lies along a straight line without it, whose slope is the expansion, and level \
        with it; what both share is the base's own misfit.";
    let title = "Expansion over temperature";
    let mut picture = Picture::new(Some(Effect::Temperature), title, x, scene.residual_axis(), caption);
    for (role, name, view) in both(scene) {
        picture.points(role, name, bins.means(scene.rows().map(|k| (degc[k], view.residual[k]))));
    }
    named(&mut picture, |t| p.expansion * (t - p.reference_degc));
    Some(picture)
}

/// The residual over the load.
pub(super) fn over_load(model: &Model, scene: &Scene<'_>) -> Option<Picture> {
    let load = scene.samples.load.as_deref()?;
    let bins = Bins::over(scene.rows().map(|k| load[k]), POINTS)?;
    let caption = "Means at each load. An actuator that yields lies along a straight line without it, whose slope is the compliance, \
        and level with it; what both share is the base's own misfit.";
    let x = Axis::new("load", "N");
    let mut picture = Picture::new(Some(Effect::Load), "Deflection over load", x, scene.residual_axis(), caption);
    for (role, name, view) in both(scene) {
        picture.points(role, name, bins.means(scene.rows().map(|k| (load[k], view.residual[k]))));
    }
    if let Some(p) = model.effects.load {
        named(&mut picture, |newtons| p.per_newton * newtons);
    }
    Some(picture)
}

/// How far the measurement stays behind the prediction, over the rate of the drive.
pub(super) fn trailing(scene: &Scene<'_>) -> Option<Picture> {
    let rates = rates(&scene.samples);
    let fastest = scene.rows().map(|k| rates[k].abs()).fold(0.0, f64::max);
    let bins = Bins::of_ratio(fastest / 10f64.powf(DECADES), fastest, PER_DECADE)?;
    let x = Axis::new("rate of the drive", &format!("{}/s", scene.drive_unit)).log();
    let y = Axis::new("measured stays behind by", scene.unit);
    let caption = "Half the width that loops have beyond the predicted one, averaged at each rate. Loops that widen with the rate rise to \
        the right without it, and stay level with it.";
    let mut picture = Picture::new(Some(Effect::RateDependence), "Width of loops over rate", x, y, caption);
    for (role, name, view) in both(scene) {
        let behind = |k: usize| (rates[k].abs(), -view.residual[k] * rates[k].signum());
        picture.points(role, name, bins.means(scene.rows().filter(|k| rates[*k] != 0.0).map(behind)));
    }
    Some(picture)
}

/// The residual over the output, or over the drive where the curve is before the hysteresis, rising and falling apart.
pub(super) fn curve(model: &Model, scene: &Scene<'_>) -> Option<Picture> {
    let branches = branches(&scene.samples);
    let before = model.effects.curve(CurveSide::Input).is_some();
    let at = |k: usize| if before { scene.samples.input[k] } else { scene.without.predicted[k] };
    let bins = Bins::over(scene.rows().map(at), FINE)?;
    let (title, x, caption) = if before {
        let caption = "Means at each drive. A curve before the hysteresis bends the loop and makes its branches, rising (line) and falling \
            (points), wider where it is steep: without it they are bent and apart, with it they are level.";
        ("Residual over the drive", Axis::new("drive", scene.drive_unit), caption)
    } else {
        let caption = "Means at each output. A curve behind the hysteresis bends both branches alike, rising (line) and \
            falling (points): without it they lie on one bent curve, with it they are level.";
        ("Residual over the output", Axis::new("predicted without it", scene.unit), caption)
    };
    let mut picture = Picture::new(Some(Effect::Asymmetry), title, x, scene.residual_axis(), caption);
    for (role, name, view) in both(scene) {
        let on = |branch: Branch| {
            let rows = scene.rows().filter(|k| branches[*k] == branch);
            bins.means(rows.map(|k| (at(k), view.residual[k])).collect::<Vec<_>>().into_iter())
        };
        let (rising, falling) = (on(Branch::Rising), on(Branch::Falling));
        picture.line(role, &format!("{name}, rising"), &rising.0, &rising.1);
        picture.points(role, &format!("{name}, falling"), falling);
    }
    Some(picture)
}

/// What is measured, and what is left, over what would be without the stop.
pub(super) fn stop(scene: &Scene<'_>) -> Vec<Picture> {
    let at = |k: usize| scene.without.predicted[k];
    let Some(bins) = Bins::over(scene.rows().map(at), FINE) else { return Vec::new() };
    let caption = "Means at each output. A stop holds the measurement while the prediction without it goes on: the points leave the \
        straight line and stay level, and the model with it follows them.";
    let x = || Axis::new("predicted without it", scene.unit);
    let y = Axis::new("output", scene.unit);
    let mut motion = Picture::new(Some(Effect::Saturation), "Where the motion stops", x(), y, caption);
    let straight = bins.means(scene.rows().map(|k| (at(k), at(k))));
    let with = bins.means(scene.rows().map(|k| (at(k), scene.with.predicted[k])));
    motion.line(Role::Without, WITHOUT, &straight.0, &straight.1);
    motion.line(Role::With, WITH, &with.0, &with.1);
    motion.points(Role::Measured, "measured", bins.means(scene.rows().map(|k| (at(k), scene.samples.output[k]))));
    let caption =
        "The same as what is left: without it the residual runs away beyond the stop, with it it stays near zero.";
    let title = "Residual over the output";
    let mut left = Picture::new(Some(Effect::Saturation), title, x(), scene.residual_axis(), caption);
    for (role, name, view) in both(scene) {
        left.points(role, name, bins.means(scene.rows().map(|k| (at(k), view.residual[k]))));
    }
    vec![motion, left]
}
