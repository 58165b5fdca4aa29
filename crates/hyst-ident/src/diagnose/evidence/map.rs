//! Evidence over a quantity of the same instant: temperature, load, rate, or the output.

use hyst_core::CurveSide;

use super::bins::Bins;
use super::drive::{Branch, branches, rates};
use super::picture::{Axis, Picture, Role};
use super::scene::{NAMED, Scene, View, WITH, WITHOUT};
use crate::model::{Effect, Model};
use crate::nested::thermal_state;

/// Number of points over the range of a quantity.
const POINTS: usize = 12;
/// Number of points over the range of the output.
const FINE: usize = 40;
/// Number of decades of rate that are shown, and points per decade.
const DECADES: f64 = 4.0;
const PER_DECADE: f64 = 6.0;

fn both<'a>(scene: &'a Scene<'_>) -> [(Role, &'static str, &'a View); 2] {
    [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)]
}

/// Draws the named effect at the points of a picture's first curve.
fn named(picture: &mut Picture, of: impl Fn(f64) -> f64) {
    if let Some(x) = picture.curves.first().map(|c| c.x.clone()) {
        let y: Vec<f64> = x.iter().map(|x| of(*x)).collect();
        picture.line(Role::Reference, NAMED, &x, &y);
    }
}

/// Returns the effective temperature in each row \[°C\], behind the model's thermal lag if it has one, and its axis.
fn acting_temperature(model: &Model, scene: &Scene<'_>) -> Option<(Vec<f64>, Axis)> {
    let measured = scene.samples.temperature.as_ref()?;
    let Some(p) = model.effects.temperature.filter(|p| p.seconds > 0.0) else {
        return Some((measured.clone(), Axis::new("temperature", "°C")));
    };
    let degc =
        thermal_state(&scene.samples, &p).ok()??.kelvin.into_iter().map(|kelvin| p.reference_degc + kelvin).collect();
    Some((degc, Axis::new("temperature behind its thermal lag", "°C")))
}

/// Returns the gain error over temperature.
///
/// The gain error is the slope of the residual over the motion in each bin of temperature, so the sensor's zero has no
/// influence.
pub(in crate::diagnose) fn gain_over_temperature(model: &Model, scene: &Scene<'_>) -> Option<Picture> {
    let (degc, x) = acting_temperature(model, scene)?;
    let bins = Bins::over(scene.rows().map(|k| degc[k]), POINTS)?;
    let y = Axis::new("gain, measured over predicted, minus 1", "%");
    let caption = "Slope of the residual over the motion, at each temperature. A temperature-dependent gain is a straight line without \
        it, and near zero with it; a part common to both is misfit of the base model.";
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

/// Returns the residual over temperature, if the model expands.
pub(in crate::diagnose) fn expansion_over_temperature(model: &Model, scene: &Scene<'_>) -> Option<Picture> {
    let p = model.effects.temperature.filter(|p| p.expansion != 0.0)?;
    let (degc, x) = acting_temperature(model, scene)?;
    let bins = Bins::over(scene.rows().map(|k| degc[k]), POINTS)?;
    let caption = "Means at each temperature. Thermal expansion is a straight line without it, whose slope is the expansion, and level \
        with it; a part common to both is misfit of the base model.";
    let title = "Expansion over temperature";
    let mut picture = Picture::new(Some(Effect::Temperature), title, x, scene.residual_axis(), caption);
    for (role, name, view) in both(scene) {
        picture.points(role, name, bins.means(scene.rows().map(|k| (degc[k], view.residual[k]))));
    }
    named(&mut picture, |t| p.expansion * (t - p.reference_degc));
    Some(picture)
}

/// Returns the residual over the load.
pub(in crate::diagnose) fn over_load(model: &Model, scene: &Scene<'_>) -> Option<Picture> {
    let load = scene.samples.load.as_deref()?;
    let bins = Bins::over(scene.rows().map(|k| load[k]), POINTS)?;
    let caption = "Means at each load. A compliant actuator shows a straight line without it, whose slope is the compliance, \
        and level with it; a part common to both is misfit of the base model.";
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

/// Returns the lag of the measured behind the predicted output, over the rate of the drive.
pub(in crate::diagnose) fn trailing(scene: &Scene<'_>) -> Option<Picture> {
    let rates = rates(&scene.samples);
    let fastest = scene.rows().map(|k| rates[k].abs()).fold(0.0, f64::max);
    let bins = Bins::of_ratio(fastest / 10f64.powf(DECADES), fastest, PER_DECADE)?;
    let x = Axis::new("rate of the drive", &format!("{}/s", scene.drive_unit)).log();
    let y = Axis::new("lag of the measured output", scene.unit);
    let caption = "Half of the loop width in excess of the predicted one, averaged at each rate. Rate-dependent hysteresis rises to \
        the right without it, and is level with it.";
    let mut picture = Picture::new(Some(Effect::RateDependence), "Width of loops over rate", x, y, caption);
    for (role, name, view) in both(scene) {
        let behind = |k: usize| (rates[k].abs(), -view.residual[k] * rates[k].signum());
        picture.points(role, name, bins.means(scene.rows().filter(|k| rates[*k] != 0.0).map(behind)));
    }
    Some(picture)
}

/// Returns the residual over the output (over the drive for a curve before the hysteresis), rising and falling branches
/// apart.
pub(in crate::diagnose) fn curve(model: &Model, scene: &Scene<'_>) -> Option<Picture> {
    let branches = branches(&scene.samples);
    let before = model.effects.curve(CurveSide::Input).is_some();
    let at = |k: usize| if before { scene.samples.input[k] } else { scene.without.predicted[k] };
    let bins = Bins::over(scene.rows().map(at), FINE)?;
    let (title, x, caption) = if before {
        let caption = "Means at each drive. A curve before the hysteresis bends the loop and moves its branches, rising (line) and falling \
            (points), further apart where it is steep: without it they are bent and apart, with it they are level.";
        ("Residual over the drive", Axis::new("drive", scene.drive_unit), caption)
    } else {
        let caption = "Means at each output. A curve behind the hysteresis bends both branches alike, rising (line) and \
            falling (points): without it they follow one bent curve, with it they are level.";
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

/// Returns the measured output and the residual over the drive, with and without a limit of the drive.
pub(in crate::diagnose) fn rail(scene: &Scene<'_>) -> Vec<Picture> {
    let at = |k: usize| scene.samples.input[k];
    let Some(bins) = Bins::over(scene.rows().map(at), FINE) else { return Vec::new() };
    let caption = "Means at each drive. Beyond a limit of the drive the measured output stays while the prediction without the \
        limit continues; the prediction with it stays too.";
    let x = || Axis::new("drive", scene.drive_unit);
    let y = Axis::new("output", scene.unit);
    let mut motion = Picture::new(Some(Effect::Saturation), "Where the drive ends", x(), y, caption);
    let means = |of: &[f64]| bins.means(scene.rows().map(|k| (at(k), of[k])));
    for (role, name, view) in both(scene) {
        let line = means(&view.predicted);
        motion.line(role, name, &line.0, &line.1);
    }
    motion.points(Role::Measured, "measured", means(&scene.samples.output));
    let caption = "Means of the residual at each drive. Without the limit the residual grows beyond it.";
    let title = "Residual over the drive";
    let mut left = Picture::new(Some(Effect::Saturation), title, x(), scene.residual_axis(), caption);
    for (role, name, view) in both(scene) {
        left.points(role, name, means(&view.residual));
    }
    vec![motion, left]
}

/// Returns the measured output and the residual over the output predicted without the saturation limit.
pub(in crate::diagnose) fn stop(scene: &Scene<'_>) -> Vec<Picture> {
    let at = |k: usize| scene.without.predicted[k];
    let Some(bins) = Bins::over(scene.rows().map(at), FINE) else { return Vec::new() };
    let caption = "Means at each output. A saturation limit stops the measured output while the prediction without it continues: the points leave \
        the straight line and stay level, and the model with it follows them.";
    let x = || Axis::new("predicted without it", scene.unit);
    let y = Axis::new("output", scene.unit);
    let mut motion = Picture::new(Some(Effect::Saturation), "Where the motion stops", x(), y, caption);
    let straight = bins.means(scene.rows().map(|k| (at(k), at(k))));
    let with = bins.means(scene.rows().map(|k| (at(k), scene.with.predicted[k])));
    motion.line(Role::Without, WITHOUT, &straight.0, &straight.1);
    motion.line(Role::With, WITH, &with.0, &with.1);
    motion.points(Role::Measured, "measured", bins.means(scene.rows().map(|k| (at(k), scene.samples.output[k]))));
    let caption = "The same for the residual: without it the residual grows beyond the limit, with it the residual stays near zero.";
    let title = "Residual over the output";
    let mut left = Picture::new(Some(Effect::Saturation), title, x(), scene.residual_axis(), caption);
    for (role, name, view) in both(scene) {
        left.points(role, name, bins.means(scene.rows().map(|k| (at(k), view.residual[k]))));
    }
    vec![motion, left]
}
