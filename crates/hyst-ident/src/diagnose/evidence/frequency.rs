//! What shows over frequency: dead time and lag, modes, tones.

use std::f64::consts::TAU;

use hyst_core::{InterferenceParams, ResonanceParams};
use nalgebra::Complex;

use super::bins::Bins;
use super::density::{Density, white};
use super::drive::{Hold, holds};
use super::{Axis, NAMED, Picture, Role, Scene, View, WITH, WITHOUT};
use crate::linear::{ResponseLine, WelchOptions, response};
use crate::model::{Effect, Model};

/// Lines of a response are shown where their phase is known this well \[rad\].
const KNOWN: f64 = 0.05;
/// … and where the output predicted without the effect has this share of its strongest line's power: between lines there is what windows leak.
const EXCITED: f64 = 1e-5;
/// Points for each decade of frequency.
const PER_DECADE: f64 = 16.0;

/// Gain and phase of the measured output against the predicted one, over frequency (H₁).
pub(super) fn response_pictures(effect: Effect, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
    let (phase_says, gain_says) = match effect {
        Effect::Delay => {
            ("A dead time turns the phase in proportion to frequency.", "A dead time leaves the gain at 1.")
        }
        Effect::Lag => (
            "A first-order lag turns the phase towards −90°, by 45° at its corner.",
            "A first-order lag lets the gain fall beyond its corner, to 0.71 there.",
        ),
        Effect::Resonance => (
            "A mode turns the phase at its frequency, as far as the drive reaches.",
            "A mode lets the gain rise towards its frequency, as far as the drive reaches.",
        ),
        _ => (
            "Plays that drag turn the phase the more, the faster the drive.",
            "Plays that drag lower the gain the more, the faster the drive.",
        ),
    };
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
    if let Some(named) = named(effect, model, &hz, scene.samples.usual_period()) {
        let (gains, phases): (Vec<f64>, Vec<f64>) = named.into_iter().map(|h| (h.norm(), h.arg().to_degrees())).unzip();
        phase.line(Role::Reference, NAMED, &hz, &phases);
        gain.line(Role::Reference, NAMED, &hz, &gains);
    }
    vec![phase, gain]
}

/// The response that was found, where it is that of a linear filter.
fn named(effect: Effect, model: &Model, hz: &[f64], period: f64) -> Option<Vec<Complex<f64>>> {
    let one = Complex::new(1.0, 0.0);
    let of: Box<dyn Fn(f64) -> Complex<f64>> = match effect {
        Effect::Delay => {
            let seconds = model.effects.delay?.seconds;
            Box::new(move |w| Complex::from_polar(1.0, -w * seconds))
        }
        Effect::Lag => {
            let seconds = model.effects.lag?.seconds;
            Box::new(move |w| one / Complex::new(1.0, w * seconds))
        }
        Effect::Resonance => {
            let modes = model.effects.resonances.clone();
            let mode = move |w: f64, m: &ResonanceParams| {
                let r = w / (TAU * m.hz);
                one - m.gain + m.gain / Complex::new(1.0 - r * r, 2.0 * m.damping * r)
            };
            Box::new(move |w| modes.iter().map(|m| mode(w, m)).product())
        }
        _ => return None,
    };
    // What lies beyond half of the sample rate the record does not show.
    Some(hz.iter().map(|hz| of(TAU * hz.min(0.5 / period))).collect())
}

/// Lines of the response that the drive excites and that are known well.
fn lines(scene: &Scene<'_>, view: &View) -> Vec<ResponseLine> {
    let mut samples = scene.samples.clone().of_one_period();
    samples.segments = super::settled_segments(&samples);
    samples.input.clone_from(&view.predicted);
    // A record that is too short for it has no such picture.
    let found = response(&samples, &WelchOptions::default()).map(|r| r.lines).unwrap_or_default();
    let Some(density) = Density::of(&scene.samples, &scene.without.predicted) else { return Vec::new() };
    let most = density.power.iter().copied().fold(0.0, f64::max);
    let excited = |hz: f64| {
        let near = density.hz.partition_point(|line| *line < hz - 0.5 * density.step());
        density.power.get(near).is_some_and(|power| *power > EXCITED * most)
    };
    found.into_iter().filter(|l| l.phase_std_error < KNOWN && excited(l.hz)).collect()
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
        let floor = white(scene.noise, scene.samples.usual_period());
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
/// Noise floors that the expected ringing must have: what a record does not excite, it cannot show.
const EXPECTED: f64 = 3.0;

/// What is left in rests after which the mode should ring most, averaged in step with it.
pub(super) fn ring_down(scene: &Scene<'_>, modes: &[(f64, f64)]) -> Option<Picture> {
    let (hz, damping) = *modes.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let period = scene.samples.usual_period();
    let decay = -OVER.ln() / (TAU * hz * damping.max(1e-3));
    let rows = (decay.min(CYCLES / hz) / period).ceil() as usize;
    if rows < 8 {
        return None;
    }
    let window = |h: &Hold| h.rows.start..h.rows.start + rows;
    // What the mode adds to the output, less its mean.
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
    rests.truncate(RINGS);
    let strongest = rests.first()?.1.clone();
    // Their size and sign beside the strongest: rings of opposite steps must not cancel.
    let weights: Vec<f64> = rests
        .iter()
        .map(|(_, ring)| {
            ring.iter().zip(&strongest).map(|(a, b)| a * b).sum::<f64>() / energy(&strongest) / rows as f64
        })
        .collect();
    let whole: f64 = weights.iter().map(|w| w * w).sum();
    if energy(&strongest).sqrt() * whole.sqrt() < EXPECTED * scene.noise {
        return None;
    }
    let (x, y) = (Axis::new("time since the drive stopped", "ms"), scene.residual_axis());
    let caption = format!(
        "Average over the {} rests of the drive in which the mode should ring most, each in step with it. Without it the residual rings \
         at {hz:.1} Hz and dies away as the mode does, with it little of that is left.",
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

/// The same less its mean.
fn centred(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|v| *v -= mean);
    values
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
pub(super) fn folded(scene: &Scene<'_>, tone: &InterferenceParams) -> Option<Picture> {
    let caption = "All periods of the tone on the lab's clock laid over each other and averaged: what does not keep its time over the whole \
        record vanishes. Without it a sine is left, with it nothing is.";
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
