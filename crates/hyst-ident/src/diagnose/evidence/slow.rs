//! Slow evidence: creep after the drive has stopped, drift on the lab clock.

use super::bins::Bins;
use super::drive::{Hold, clock, holds};
use super::picture::{Axis, Picture, Role};
use super::scene::{NAMED, Scene, View, WITH, WITHOUT};
use crate::model::{Effect, Model};

/// Points per decade of time.
const PER_DECADE: f64 = 6.0;
/// Maximum number of smoothed points over a record.
const MAX_MEANS: f64 = 400.0;

/// Returns the continued motion after the drive has stopped, over the logarithm of time, as a share of the step before.
///
/// Over all holds, the change of the residual since the stop is regressed on the step, `Σ r s / Σ s²` at each time.
/// Noise and the creep of earlier steps average out. A record without holds shows its mean over time instead.
pub(in crate::diagnose) fn creep(scene: &Scene<'_>) -> Picture {
    let found = holds(&scene.samples);
    let longest = found.iter().map(|h| h.rows.len() as f64 * periods(scene, h)).fold(0.0, f64::max);
    // The first bin is the reference of the others.
    let bins = Bins::of_ratio(1.5, longest, PER_DECADE);
    let (x, y) = (Axis::new("time since the drive stopped", "s").log(), Axis::new("continued motion", "% of the step"));
    let caption = "Average over all holds of the drive. Creep continues for decades of time in the direction of the step: the curve \
        without it rises, the curve with it stays near zero.";
    let mut picture = Picture::new(Some(Effect::Creep), "After the drive has stopped", x, y, caption);
    if let Some(bins) = bins {
        for (role, name, view) in [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)] {
            picture.points(role, name, after_steps(scene, &found, &bins, view));
        }
    }
    if picture.shows() {
        return picture;
    }
    let caption = "Means over one second or more. With a cycling drive, creep shows as a mean that moves for minutes, ever more \
        slowly: without it the residual bends, with it the residual stays level.";
    let mut picture = over_time(scene, Some(Effect::Creep), "Mean over time", caption);
    for curve in &mut picture.curves {
        let first = curve.y.first().copied().unwrap_or(0.0);
        curve.y.iter_mut().for_each(|y| *y -= first);
    }
    picture
}

/// Returns the regression of the residual's change on the step before \[%\], over time \[s\].
fn after_steps(scene: &Scene<'_>, found: &[Hold], bins: &Bins, view: &View) -> (Vec<f64>, Vec<f64>) {
    let settling = &scene.samples.settling;
    let mut sums = vec![(0.0, 0.0, 0.0, 0.0); bins.count()];
    for hold in found.iter().filter(|h| !settling[h.rows.start]) {
        let step = scene.without.predicted[hold.rows.start] - scene.without.predicted[hold.before];
        let since = |k: usize| (k - hold.rows.start + 1) as f64 * periods(scene, hold);
        let means = bins.means(hold.rows.clone().map(|k| (since(k), view.residual[k])));
        let Some(start) = means.1.first().copied() else { continue };
        for (rows, residual) in means.0.into_iter().zip(means.1) {
            if let Some(sum) = bins.index(rows).and_then(|i| sums.get_mut(i)) {
                *sum = (sum.0 + rows, sum.1 + 1.0, sum.2 + (residual - start) * step, sum.3 + step * step);
            }
        }
    }
    let used = sums.into_iter().filter(|s| s.3 > 0.0);
    used.map(|(rows, n, rs, ss)| (rows / n * scene.samples.period, 100.0 * rs / ss)).unzip()
}

/// Returns the sample period in a hold, in units of the record's shortest sample period.
fn periods(scene: &Scene<'_>, hold: &Hold) -> f64 {
    scene.samples.period_at(hold.rows.start) / scene.samples.period
}

/// Returns the mean residual over lab time, which shows the drift of the sensor's zero.
pub(in crate::diagnose) fn drift(model: &Model, scene: &Scene<'_>) -> Picture {
    let caption = "Mean residual over one second or more, on the lab clock with the breaks between segments, without the drift and \
        with it.";
    let mut picture = over_time(scene, Some(Effect::Drift), "Mean over time", caption);
    if let (Some(p), Some(shown)) = (model.effects.drift, picture.curves.first()) {
        let x = shown.x.clone();
        // Concatenated files have separate clocks.
        if scene.samples.files() == 1 {
            let y: Vec<f64> = x.iter().map(|t| p.at(*t)).collect();
            picture.line(Role::Reference, NAMED, &x, &y);
        }
    }
    picture
}

fn over_time(scene: &Scene<'_>, effect: Option<Effect>, title: &str, caption: &str) -> Picture {
    let clock = clock(&scene.samples);
    let seconds = clock.last().zip(clock.first()).map_or(0.0, |(b, a)| b - a);
    // A short record has shorter bins.
    let width = (seconds / MAX_MEANS).max(f64::min(1.0, seconds / 20.0));
    let mut picture = Picture::new(effect, title, Axis::new("lab time", "s"), scene.residual_axis(), caption);
    if let Some(bins) = Bins::over(clock.iter().copied(), (seconds / width).ceil().max(1.0) as usize) {
        for (role, name, view) in [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)] {
            picture.points(role, name, bins.means(scene.rows().map(|k| (clock[k], view.residual[k]))));
        }
    }
    picture
}
