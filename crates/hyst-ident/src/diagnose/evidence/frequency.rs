//! Evidence over frequency: dead time and lag, modes, tones.

use std::f64::consts::TAU;

use hyst_core::InterferenceParams;
use nalgebra::Complex;

use super::bins::Bins;
use super::density::{Density, white};
use super::drive::{Hold, holds};
use super::picture::{Axis, Picture, Role};
use super::scene::{NAMED, Scene, View, WITH, WITHOUT, settled_segments};
use crate::linear::{ResponseLine, WelchOptions, response};
use crate::model::Effect;

/// Maximum standard error of the phase of a shown line of the response \[rad\].
const MAX_PHASE_ERROR: f64 = 0.05;
/// Minimum power of a shown line of the output predicted without the effect, relative to its strongest line: between
/// the lines there is only leakage.
const MIN_RELATIVE_POWER: f64 = 1e-5;
/// Points per decade of frequency.
const PER_DECADE: f64 = 16.0;

/// A filter between the predicted and the measured output, with the captions of its pictures.
pub(in crate::diagnose) struct Filter<'a> {
    /// The effect that the pictures are evidence for.
    pub(in crate::diagnose) effect: Effect,
    /// What the effect does to the phase, and to the gain.
    pub(in crate::diagnose) phase_says: &'a str,
    pub(in crate::diagnose) gain_says: &'a str,
    /// Frequency response at an angular frequency \[rad/s\]; `None` if the effect is no linear filter.
    pub(in crate::diagnose) response: Option<&'a dyn Fn(f64) -> Complex<f64>>,
}

/// Returns pictures of the gain and phase of the measured over the predicted output, over frequency (H₁).
pub(in crate::diagnose) fn response_pictures(filter: &Filter<'_>, scene: &Scene<'_>) -> Vec<Picture> {
    let Filter { effect, phase_says, gain_says, response } = *filter;
    let hz = || Axis::new("frequency", "Hz").log();
    let phase_axis = Axis::new("phase, measured over predicted", "°");
    let gain_axis = Axis::new("gain, measured over predicted", "");
    let caption = format!("{phase_says} With it the phase stays at zero.");
    let mut phase = Picture::new(Some(effect), "Phase over frequency", hz(), phase_axis, caption);
    let caption = format!("{gain_says} With it the gain stays at 1.");
    let mut gain = Picture::new(Some(effect), "Gain over frequency", hz(), gain_axis, caption);
    for (role, name, view) in [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)] {
        let lines = lines(scene, view);
        let over = |f: &dyn Fn(&ResponseLine) -> f64| averaged(&lines, f);
        phase.points(role, name, over(&|l| l.phase.to_degrees()));
        gain.points(role, name, over(&|l| l.gain));
    }
    let hz = phase.curves.first().map(|c| c.x.clone()).unwrap_or_default();
    if let Some(response) = response {
        // The record does not show frequencies above half its sample rate.
        let highest = 0.5 / scene.samples.usual_period();
        let of = |hz: &f64| response(TAU * hz.min(highest));
        let (gains, phases): (Vec<f64>, Vec<f64>) = hz.iter().map(of).map(|h| (h.norm(), h.arg().to_degrees())).unzip();
        phase.line(Role::Reference, NAMED, &hz, &phases);
        gain.line(Role::Reference, NAMED, &hz, &gains);
    }
    vec![phase, gain]
}

/// Returns the lines of the response that the drive excites and whose phase is known well.
fn lines(scene: &Scene<'_>, view: &View) -> Vec<ResponseLine> {
    let mut samples = scene.samples.clone().of_one_period();
    samples.segments = settled_segments(&samples);
    samples.input.clone_from(&view.predicted);
    // A record that is too short for a response has no such picture.
    let found = response(&samples, &WelchOptions::default()).map(|r| r.lines).unwrap_or_default();
    let Some(density) = Density::of(&scene.samples, &scene.without.predicted) else { return Vec::new() };
    let most = density.power.iter().copied().fold(0.0, f64::max);
    let excited = |hz: f64| {
        let near = density.hz.partition_point(|line| *line < hz - 0.5 * density.step());
        density.power.get(near).is_some_and(|power| *power > MIN_RELATIVE_POWER * most)
    };
    found.into_iter().filter(|l| l.phase_std_error < MAX_PHASE_ERROR && excited(l.hz)).collect()
}

/// Returns means over bins of frequency, each line weighted by its certainty.
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

/// Returns a picture of the residual's spectrum from the densities of two curves.
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
        let floor = white(scene.noise, scene.samples.usual_period());
        picture.line(Role::Reference, "noise floor", &[first, last], &[floor, floor]);
    }
    picture
}

/// Returns the spectrum of the residual with the modes marked.
pub(in crate::diagnose) fn modes(scene: &Scene<'_>, modes: &[(f64, f64)]) -> Picture {
    let caption = "Without it the residual is large at the natural frequency of the mode (marked) and at nearby frequencies of the drive; with it \
        both fall towards the noise floor.";
    let of = |view: &View| Density::of(&scene.samples, &view.residual);
    let curves = [(Role::Without, WITHOUT, of(&scene.without)), (Role::With, WITH, of(&scene.with))];
    let mut picture = spectrum(scene, Some(Effect::Resonance), caption, curves);
    for (hz, _) in modes {
        picture.mark(*hz, format!("{hz:.1} Hz"));
    }
    picture
}

/// Maximum number of holds in the average, maximum number of cycles, and relative amplitude at which the ring-down
/// ends.
const MAX_HOLDS: usize = 8;
const MAX_CYCLES: f64 = 25.0;
const FINAL_AMPLITUDE: f64 = 0.02;
/// Minimum expected ringing in noise floors: a record cannot show a mode that it does not excite.
const MIN_EXPECTED_RINGING: f64 = 3.0;

/// Returns the residual after the holds with the largest expected ringing, aligned and averaged.
pub(in crate::diagnose) fn ring_down(scene: &Scene<'_>, modes: &[(f64, f64)]) -> Option<Picture> {
    let (hz, damping) = *modes.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let period = scene.samples.usual_period();
    let decay = -FINAL_AMPLITUDE.ln() / (TAU * hz * damping.max(1e-3));
    let rows = (decay.min(MAX_CYCLES / hz) / period).ceil() as usize;
    if rows < 8 {
        return None;
    }
    let window = |h: &Hold| h.rows.start..h.rows.start + rows;
    // The mode's contribution to the output, minus its mean.
    let expected =
        |h: &Hold| centred(window(h).map(|k| scene.with.predicted[k] - scene.without.predicted[k]).collect());
    let energy = |ring: &[f64]| ring.iter().map(|y| y * y).sum::<f64>() / rows as f64;
    let long = |h: &Hold| {
        let samples = &scene.samples;
        h.rows.len() >= rows && !samples.settling[h.rows.start] && samples.period_at(h.rows.start) == period
    };
    let mut rests: Vec<(Hold, Vec<f64>)> =
        holds(&scene.samples).into_iter().filter(long).map(|h| (h.clone(), expected(&h))).collect();
    rests.sort_by(|a, b| energy(&b.1).total_cmp(&energy(&a.1)));
    rests.truncate(MAX_HOLDS);
    let strongest = rests.first()?.1.clone();
    // Weights with the size and sign relative to the strongest, so that rings of opposite steps do not cancel.
    let weights: Vec<f64> = rests
        .iter()
        .map(|(_, ring)| {
            ring.iter().zip(&strongest).map(|(a, b)| a * b).sum::<f64>() / energy(&strongest) / rows as f64
        })
        .collect();
    let whole: f64 = weights.iter().map(|w| w * w).sum();
    if energy(&strongest).sqrt() * whole.sqrt() < MIN_EXPECTED_RINGING * scene.noise {
        return None;
    }
    let (x, y) = (Axis::new("time since the drive stopped", "ms"), scene.residual_axis());
    let caption = format!(
        "Average over the {} holds of the drive with the largest expected ringing, aligned in phase. Without it the residual rings \
         at {hz:.1} Hz and decays like the mode; with it the residual is small.",
        rests.len()
    );
    let mut picture = Picture::new(Some(Effect::Resonance), "Ring-down after a stop", x, y, caption);
    let ms: Vec<f64> = (0..rows).map(|k| 1e3 * k as f64 * period).collect();
    let mean = |of: &dyn Fn(usize) -> f64| {
        let at = |k: usize| rests.iter().zip(&weights).map(|((h, _), w)| w * of(h.rows.start + k)).sum::<f64>() / whole;
        centred((0..rows).map(at).collect())
    };
    picture.line(Role::Without, WITHOUT, &ms, &mean(&|k| scene.without.residual[k]));
    picture.line(Role::With, WITH, &ms, &mean(&|k| scene.with.residual[k]));
    picture.line(Role::Reference, NAMED, &ms, &mean(&|k| scene.with.predicted[k] - scene.without.predicted[k]));
    Some(picture)
}

/// Returns the values minus their mean.
fn centred(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|v| *v -= mean);
    values
}

/// Returns the spectrum of the residual with a tone marked, at the finest resolution of the record.
pub(in crate::diagnose) fn tone(scene: &Scene<'_>, hz: f64) -> Picture {
    let caption = "A tone in the sensor is a line of the smallest width that the record resolves. Without it the line is visible, \
        with it the line disappears.";
    let of = |view: &View| Density::finest(&scene.samples, &view.residual);
    let curves = [(Role::Without, WITHOUT, of(&scene.without)), (Role::With, WITH, of(&scene.with))];
    let mut picture = spectrum(scene, Some(Effect::Interference), caption, curves);
    picture.mark(hz, format!("{hz:.3} Hz"));
    picture
}

/// Number of points over a period.
const PHASES: usize = 48;

/// Returns the residual over the tone's phase, averaged over the whole record.
pub(in crate::diagnose) fn folded(scene: &Scene<'_>, tone: &InterferenceParams) -> Option<Picture> {
    let caption = "All periods of the tone, aligned on the lab clock and averaged. Errors without a constant phase over the whole record average \
        out. Without it a sine remains, with it nothing remains.";
    let (x, y) = (Axis::new("phase of the tone", "°"), scene.residual_axis());
    let mut picture = Picture::new(Some(Effect::Interference), "Folded on the tone", x, y, caption);
    let phase = |k: usize| 360.0 * (tone.hz * scene.samples.time[k]).rem_euclid(1.0);
    let bins = Bins::over([0.0, 360.0].into_iter(), PHASES)?;
    for (role, name, view) in [(Role::Without, WITHOUT, &scene.without), (Role::With, WITH, &scene.with)] {
        let mean = scene.rows().map(|k| view.residual[k]).sum::<f64>() / scene.rows().count().max(1) as f64;
        picture.points(role, name, bins.means(scene.rows().map(|k| (phase(k), view.residual[k] - mean))));
    }
    let degrees: Vec<f64> = (0..=90).map(|k| 4.0 * f64::from(k)).collect();
    let named: Vec<f64> = degrees.iter().map(|d| tone.at_angle(d.to_radians())).collect();
    picture.line(Role::Reference, NAMED, &degrees, &named);
    Some(picture)
}
