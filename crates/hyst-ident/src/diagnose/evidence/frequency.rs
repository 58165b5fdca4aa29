//! What shows over frequency: dead time and lag, modes, tones.

use std::f64::consts::TAU;

use super::bins::Bins;
use super::density::{Density, white};
use super::drive::{Hold, holds, rates};
use super::{Axis, Picture, Role, Scene, View, WITH, WITHOUT};
use crate::linear::{ResponseLine, WelchOptions, response};
use crate::model::Effect;

/// Lines of a response are shown where their phase is known this well \[rad\].
const KNOWN: f64 = 0.05;
/// Points for each decade of frequency.
const PER_DECADE: f64 = 16.0;

/// Gain and phase of the measured output against the predicted one, over frequency (H₁).
pub(super) fn response_pictures(effect: Effect, scene: &Scene<'_>) -> Vec<Picture> {
    let caption = match effect {
        Effect::Resonance => {
            "A mode lets the gain rise towards its frequency and turns the phase there, as far as the drive reaches. With it the phase \
             stays at zero and the gain at 1."
        }
        Effect::Delay => {
            "A dead time turns the phase in proportion to frequency, and leaves the gain at 1. With it the phase stays at zero."
        }
        Effect::Lag => {
            "A first-order lag turns the phase towards −90° and lets the gain fall beyond its corner. With it the phase stays at zero \
             and the gain at 1."
        }
        _ => {
            "Plays that drag turn the phase and lower the gain the more, the faster the drive. With it the phase stays at zero and \
             the gain at 1."
        }
    };
    let hz = || Axis::new("frequency", "Hz").log();
    let measured = "measured over predicted";
    let phase_axis = Axis::new(&format!("phase, {measured}"), "°");
    let gain_axis = Axis::new(&format!("gain, {measured}"), "");
    let mut phase = Picture::new(Some(effect), "Phase over frequency", hz(), phase_axis, caption);
    let mut gain = Picture::new(Some(effect), "Gain over frequency", hz(), gain_axis, caption);
    for (role, name, view) in [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)] {
        let lines = lines(scene, view);
        let over = |f: &dyn Fn(&ResponseLine) -> f64| averaged(&lines, f);
        phase.points(role, name, over(&|l| l.phase.to_degrees()));
        gain.points(role, name, over(&|l| l.gain));
    }
    vec![phase, gain]
}

/// Lines of the response that are known well.
fn lines(scene: &Scene<'_>, view: &View) -> Vec<ResponseLine> {
    let mut samples = scene.samples.clone();
    samples.segments = super::settled_segments(&scene.samples);
    samples.input.clone_from(&view.predicted);
    // A record that is too short for it has no such picture.
    let found = response(&samples, &WelchOptions::default()).map(|r| r.lines).unwrap_or_default();
    found.into_iter().filter(|l| l.phase_std_error < KNOWN).collect()
}

/// Means over stretches of frequency, each line weighted by what is known of it.
fn averaged(lines: &[ResponseLine], f: &dyn Fn(&ResponseLine) -> f64) -> (Vec<f64>, Vec<f64>) {
    let ends = lines.first().zip(lines.last()).and_then(|(a, b)| Bins::of_ratio(a.hz, b.hz, PER_DECADE));
    let Some(bins) = ends else { return Default::default() };
    let mut sums = vec![(0.0, 0.0, 0.0); bins.count()];
    for line in lines {
        if let Some(sum) = bins.index(line.hz).and_then(|i| sums.get_mut(i)) {
            let weight = line.phase_std_error.max(1e-6).powi(-2);
            *sum = (sum.0 + weight, sum.1 + weight * line.hz, sum.2 + weight * f(line));
        }
    }
    sums.into_iter().filter(|s| s.0 > 0.0).map(|(w, hz, y)| (hz / w, y / w)).unzip()
}

/// A picture of the residual's spectrum: what the curves are of, and the density of each.
pub(super) fn spectrum(
    scene: &Scene<'_>,
    effect: Option<Effect>,
    caption: &str,
    curves: [(Role, &str, Option<Density>); 2],
) -> Picture {
    let y = Axis::new("measured − predicted", &format!("{}/√Hz", scene.unit)).log();
    let x = Axis::new("frequency", "Hz").log();
    let mut picture = Picture::new(effect, "Spectrum of the residual", x, y, caption);
    for (role, name, density) in curves {
        if let Some(density) = density {
            picture.line(role, name, &density.hz, &density.amplitudes());
        }
    }
    let range = picture.curves.first().and_then(|c| c.x.first().copied().zip(c.x.last().copied()));
    if let Some((first, last)) = range.filter(|_| scene.noise > 0.0) {
        let floor = white(scene.noise, scene.samples.period);
        picture.line(Role::Reference, "noise floor", &[first, last], &[floor, floor]);
    }
    picture
}

/// Spectrum of the residual with the modes marked.
pub(super) fn modes(scene: &Scene<'_>, modes: &[(f64, f64)]) -> Picture {
    let caption = "Without it the residual is large where the mode rings by itself (marked) and where the drive forces it nearby; with it \
        both fall towards the noise.";
    let of = |view: &View| Density::of(&scene.samples, &view.residual);
    let curves = [(Role::Without, WITHOUT, of(&scene.without)), (Role::With, WITH, of(&scene.with))];
    let mut picture = spectrum(scene, Some(Effect::Resonance), caption, curves);
    for (hz, _) in modes {
        picture.mark(*hz, format!("{hz:.1} Hz"));
    }
    picture
}

/// Rests that ring-down is averaged over, cycles that are shown at most, and at which amplitude it is over.
const RINGS: usize = 8;
const CYCLES: f64 = 25.0;
const OVER: f64 = 0.02;
/// Time before a stop in which its motion counts, in cycles of the mode.
const APPROACH: f64 = 2.0;

/// What is left after the fastest motions have stopped, averaged in the direction of the motion.
pub(super) fn ring_down(scene: &Scene<'_>, modes: &[(f64, f64)]) -> Option<Picture> {
    let (hz, damping) = *modes.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let period = scene.samples.period;
    let decay = -OVER.ln() / (TAU * hz * damping.max(1e-3));
    let rows = (decay.min(CYCLES / hz) / period).ceil() as usize;
    let rates = rates(&scene.samples);
    let approach = (APPROACH / (hz * period)).ceil() as usize;
    // The fastest rate before the stop, with its sign.
    let motion = |h: &Hold| {
        let before = h.rows.start.saturating_sub(approach).max(h.before)..h.rows.start;
        before.map(|k| rates[k]).fold(0.0, |most: f64, r| if r.abs() > most.abs() { r } else { most })
    };
    let long = |h: &Hold| h.rows.len() >= rows && !scene.samples.settling[h.rows.start];
    let mut stops: Vec<(Hold, f64)> =
        holds(&scene.samples).into_iter().filter(long).map(|h| (h.clone(), motion(&h))).collect();
    stops.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    stops.truncate(RINGS);
    if stops.is_empty() || rows < 8 {
        return None;
    }
    let (x, y) = (Axis::new("time since the drive stopped", "ms"), scene.residual_axis());
    let caption = format!(
        "Average over the {} fastest motions that end in a rest, each counted in its own direction. Without it the residual rings at \
         {hz:.1} Hz and dies away, with it it does not ring.",
        stops.len()
    );
    let mut picture = Picture::new(Some(Effect::Resonance), "Ring-down after a stop", x, y, caption);
    let weight: f64 = stops.iter().map(|(_, rate)| rate.abs()).sum();
    let ms: Vec<f64> = (0..rows).map(|k| 1e3 * k as f64 * period).collect();
    for (role, name, view) in [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)] {
        let mean = |k: usize| {
            let of = |(h, rate): &(Hold, f64)| rate * view.residual[h.rows.start + k];
            stops.iter().map(of).sum::<f64>() / weight
        };
        let mut ring: Vec<f64> = (0..rows).map(mean).collect();
        let level = ring.iter().sum::<f64>() / rows as f64;
        ring.iter_mut().for_each(|y| *y -= level);
        picture.line(role, name, &ms, &ring);
    }
    Some(picture)
}

/// Spectrum of the residual with a tone marked, as fine as the record allows.
pub(super) fn tone(scene: &Scene<'_>, hz: f64) -> Picture {
    let caption = "A tone in the sensor is a line as narrow as the record can show. Without it the line is there, with it it is gone.";
    let of = |view: &View| Density::finest(&scene.samples, &view.residual);
    let curves = [(Role::Without, WITHOUT, of(&scene.without)), (Role::With, WITH, of(&scene.with))];
    let mut picture = spectrum(scene, Some(Effect::Interference), caption, curves);
    picture.mark(hz, format!("{hz:.3} Hz"));
    picture
}

/// Points over a period.
const PHASES: usize = 48;

/// The residual over the tone's phase, averaged over the whole record.
pub(super) fn folded(scene: &Scene<'_>, hz: f64) -> Option<Picture> {
    let caption = "All periods of the tone on the lab's clock laid over each other and averaged: what does not keep its time over the whole \
        record vanishes. Without it a sine is left, with it nothing is.";
    let (x, y) = (Axis::new("phase of the tone", "°"), scene.residual_axis());
    let mut picture = Picture::new(Some(Effect::Interference), "Folded on the tone", x, y, caption);
    let phase = |k: usize| 360.0 * (hz * scene.samples.time[k]).rem_euclid(1.0);
    let bins = Bins::over([0.0, 360.0].into_iter(), PHASES)?;
    for (role, name, view) in [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)] {
        let mean = scene.rows().map(|k| view.residual[k]).sum::<f64>() / scene.rows().count().max(1) as f64;
        picture.points(role, name, bins.means(scene.rows().map(|k| (phase(k), view.residual[k] - mean))));
    }
    Some(picture)
}
