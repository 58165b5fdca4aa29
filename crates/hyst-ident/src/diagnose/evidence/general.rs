//! Pictures of the whole model before and after: loops, residuals over time, spectra.

use super::density::Density;
use super::drive::clock;
use super::frequency::spectrum;
use super::picture::{Axis, Picture, Role};
use super::scene::{Material, Scene, View, settled_segments};
use crate::Samples;
use crate::record::Record;
use crate::simulate::Simulation;

/// Names of the curves of the given and of the extended model.
const BEFORE: &str = "before";
const AFTER: &str = "after";

/// Returns all pictures of the whole model; `scene.without` is the given model.
pub(super) fn pictures(m: &Material<'_>, scene: &Scene<'_>) -> Vec<Picture> {
    let mut pictures = Vec::new();
    let changed = m.before.predicted != m.after.predicted;
    let (shown, before, after) = match m.test.zip(m.tests) {
        Some((record, (before, after))) => (record, before, after),
        None => (m.train, m.before, m.after),
    };
    pictures.extend(loops(shown, before, after, m, scene));
    pictures.push(over_time(m.train, m.before, m.after, "training record", changed, scene));
    if let Some((record, (before, after))) = m.test.zip(m.tests) {
        pictures.push(over_time(record, before, after, "test record", changed, scene));
    }
    let caption = "Power above the noise floor is not noise. Narrow peaks are modes or tones; a rise to the left is a slow error.";
    let of = |view: &View| Density::of(&scene.samples, &view.residual);
    let before = of(&scene.without).filter(|_| changed);
    let mut picture = spectrum(
        scene,
        None,
        caption,
        [(Role::Without, BEFORE, before), (Role::With, name(AFTER, changed), of(&scene.with))],
    );
    picture.title = "Spectrum of the residual, training record".into();
    pictures.push(picture);
    pictures.retain(Picture::shows);
    pictures
}

/// Returns the name of a curve; without an extension there is only one model.
fn name(name: &'static str, changed: bool) -> &'static str {
    if changed { name } else { "the model" }
}

/// Maximum number of rows of a loop, so that it stays readable.
const MAX_LOOP_ROWS: usize = 8000;

/// Returns the segment with the largest motion over the drive, and its residual.
fn loops(
    record: &Record,
    before: &Simulation,
    after: &Simulation,
    m: &Material<'_>,
    scene: &Scene<'_>,
) -> Vec<Picture> {
    let mut samples = Samples::from_record(record);
    samples.settling.clone_from(&after.settling);
    let width = |s: &std::ops::Range<usize>| {
        let (low, high) = crate::statistics::range(samples.output[s.clone()].iter().copied());
        high - low
    };
    let segments = settled_segments(&samples);
    let widest = segments.iter().map(&width).fold(0.0, f64::max);
    // The first of the segments with equal motion, up to noise.
    let Some(rows) = segments.iter().find(|s| width(s) >= 0.95 * widest && !s.is_empty()) else { return Vec::new() };
    let rows = rows.start..rows.end.min(rows.start + MAX_LOOP_ROWS);
    let changed = m.before.predicted != m.after.predicted;
    let which = if m.test.is_some() { "test record" } else { "training record" };
    let seconds = (samples.time[rows.start], samples.time[rows.end - 1]);
    let part = format!("{which}, {:.1} to {:.1} s", seconds.0, seconds.1);
    let drive = || Axis::new("drive", scene.drive_unit);
    let u = &samples.input[rows.clone()];

    let caption = format!("Measured and predicted output over the drive ({part}).");
    let mut whole = Picture::new(None, "Loops", drive(), Axis::new("output", scene.unit), caption);
    whole.path(Role::Measured, "measured", u, &samples.output[rows.clone()]);
    let caption = format!("Residual over the same loops ({part}).");
    let mut left = Picture::new(None, "Residual over the drive", drive(), scene.residual_axis(), caption);
    for (role, name, simulation) in [(Role::Without, BEFORE, before), (Role::With, name(AFTER, changed), after)]
        .into_iter()
        .skip(usize::from(!changed))
    {
        let predicted = &simulation.predicted[rows.clone()];
        let residual: Vec<f64> = samples.output[rows.clone()].iter().zip(predicted).map(|(y, p)| y - p).collect();
        whole.path(role, name, u, predicted);
        left.path(role, name, u, &residual);
    }
    vec![whole, left]
}

/// Returns the residual of a record over lab time.
fn over_time(
    record: &Record,
    before: &Simulation,
    after: &Simulation,
    which: &str,
    changed: bool,
    scene: &Scene<'_>,
) -> Picture {
    let samples = Samples::from_record(record);
    let clock = clock(&samples);
    let caption =
        "Measured − predicted at every row, without start-up rows. Long records: minimum and maximum per pixel.";
    let title = format!("Residual over time, {which}");
    let mut picture = Picture::new(None, &title, Axis::new("lab time", "s"), scene.residual_axis(), caption);
    for (role, name, simulation) in [(Role::Without, BEFORE, before), (Role::With, name(AFTER, changed), after)]
        .into_iter()
        .skip(usize::from(!changed))
    {
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for (i, s) in samples.segments.iter().enumerate() {
            for k in s.clone().filter(|k| !after.settling[*k]) {
                x.push(clock[k]);
                y.push(samples.output[k] - simulation.predicted[k]);
            }
            // Interrupt the line at the gap.
            x.push(clock[s.end - 1] + 0.5 * samples.period_of(i));
            y.push(f64::NAN);
        }
        picture.line(role, name, &x, &y);
    }
    picture
}
