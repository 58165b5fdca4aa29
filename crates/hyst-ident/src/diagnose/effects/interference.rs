//! Interference: a periodic signal in the sensor, such as mains hum.

use hyst_core::{Error, InterferenceParams};

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use crate::criteria::MIN_OSCILLATION_HZ;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::frequency;
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::diagnose::spectrum::tone;
use crate::diagnose::tone::least_amplitude;
use crate::digits::short;
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem};

/// Frequency of the tone of the limit \[Hz\]; a tenth of the sample rate if the record does not cover it.
const MAINS_HZ: f64 = 50.0;
/// Relative accuracy of the frequency of a loop.
const LOOP_FREQUENCY_TOLERANCE: f64 = 0.002;

pub(super) struct Interference;

impl Diagnosable for Interference {
    fn effect(&self) -> Effect {
        Effect::Interference
    }

    fn kind(&self) -> EffectKind {
        EffectKind::Tone
    }

    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        let found = tone(scan.problem.samples, &scan.residual);
        let with = |hz| scan.with(&|e| e.interference = Some(InterferenceParams { hz, ..Default::default() }));
        Ok(found.map(with).into_iter().collect())
    }

    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        let s = limits.scan.problem.samples;
        let rate = 1.0 / s.period;
        let is_covered = MAINS_HZ < 0.4 * rate && MAINS_HZ > 3.0 / s.longest_segment();
        let hz = if is_covered { MAINS_HZ } else { 0.1 * rate };
        let turn = |t: &f64| std::f64::consts::TAU * (hz * t).fract();
        let size = |least: f64| {
            limits.size(1.0, f64::INFINITY, least, &|amplitude| {
                Ok(s.time.iter().map(|t| amplitude * turn(t).sin()).collect())
            })
        };
        // A tone is named for what it explains, or because neither the residual nor the motion hides it.
        let hidden = least_amplitude(s, &limits.scan.motion, &limits.scan.residual, hz);
        let prominent = size(limits.least_tone)?.map(|size| size.max(limits.margin * hidden));
        let size = size(limits.least)?.into_iter().chain(prominent).reduce(f64::min);
        let meaning = format!("amplitude of a tone at {} Hz in the sensor", short(hz));
        Ok(Some(Limit::of(size, limits.output, meaning)))
    }

    fn is_plausible(&self, problem: &Problem<'_>, fit: &Fitted) -> bool {
        let least = f64::max(2.5 / problem.samples.longest_segment(), MIN_OSCILLATION_HZ);
        fit.hypothesis.effects.interference.is_none_or(|p| p.hz > least && !is_harmonic(problem, p.hz))
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        effects.interference.is_some_and(|p| unsure("interference.amplitude", p.amplitude))
    }

    fn law(&self, model: &Model) -> Option<&'static str> {
        Some(match harmonics(&model.effects.interference?).next() {
            Some(_) => "sine-with-harmonics",
            None => "sine",
        })
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let (p, unit) = (context.extended.effects.interference?, context.symbol());
        let also: Vec<String> = harmonics(&p)
            .map(|(order, amplitude)| format!("{} {unit} at {:.1} Hz", short(amplitude), f64::from(order) * p.hz))
            .collect();
        let also = if also.is_empty() { String::new() } else { format!(", with harmonics of {}", also.join(", ")) };
        Some(format!(
            "the sensor shows a tone of {} {unit} at {:.3} Hz{also}, independent of the drive",
            short(p.amplitude),
            p.hz
        ))
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        let Some(p) = context.extended.effects.interference else { return };
        let unit = &context.model.output.unit;
        put("interference", "hz", p.hz, "Hz");
        put("interference", "amplitude", p.amplitude, unit);
        put("interference", "phase", p.phase, "rad");
        for (order, amplitude) in harmonics(&p) {
            put("interference", &format!("harmonic_{order}"), amplitude, unit);
        }
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        let Some(tone) = model.effects.interference else { return Vec::new() };
        let mut pictures: Vec<Picture> = frequency::folded(scene, &tone).into_iter().collect();
        pictures.push(frequency::tone(scene, tone.hz));
        pictures
    }
}

/// Returns the orders and amplitudes \[y\] of a tone's harmonics.
fn harmonics(tone: &InterferenceParams) -> impl Iterator<Item = (u8, f64)> {
    (2..)
        .zip(tone.harmonics.chunks_exact(2))
        .map(|(order, parts)| (order, parts[0].hypot(parts[1])))
        .filter(|(_, a)| *a > 0.0)
}

/// Returns whether a tone is a harmonic of the single loop of the record. It is then indistinguishable from the loop's
/// shape.
fn is_harmonic(problem: &Problem<'_>, hz: f64) -> bool {
    problem.only_loop.is_some_and(|first| is_multiple(hz, first, problem.samples.duration()))
}

/// Returns whether a frequency \[Hz\] is a multiple of a first one, within the resolution of a record of `seconds`.
fn is_multiple(hz: f64, first: f64, seconds: f64) -> bool {
    // The phase then turns by less than one period against the loop over the record.
    (hz - first * (hz / first).round()).abs() < 1.0 / seconds + LOOP_FREQUENCY_TOLERANCE * hz
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tone_two_spectral_lines_from_a_harmonic_is_no_harmonic() {
        // A loop of 2 Hz over 4 s has lines of 0.25 Hz; its frequency is known to 0.2 %.
        assert!(is_multiple(10.0, 2.0, 4.0) && is_multiple(10.2, 2.0, 4.0));
        assert!(!is_multiple(10.5, 2.0, 4.0) && !is_multiple(9.5, 2.0, 4.0));
    }
}
