//! Resonance: a mode of the structure rings.

use std::f64::consts::TAU;

use hyst_core::{Error, ResonanceParams};
use nalgebra::Complex;

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use crate::criteria::{MAX_MODE_DAMPING, MIN_OSCILLATION_HZ};
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::frequency::{self, Filter, response_pictures};
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::diagnose::single_loop::only_one_loop;
use crate::diagnose::spectrum::peaks;
use crate::digits::short;
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem};

/// Number of modes from which a search starts, and number of frequencies of the coarse scan.
const MAX_STARTS: usize = 2;
const SCAN_FREQUENCIES: usize = 48;
/// Mode of the limit of detection: damping ratio, number of frequencies that are tried, and the lowest one relative to
/// the lowest mode that is named.
const LIMIT_DAMPING: f64 = 0.02;
const LIMIT_FREQUENCIES: usize = 10;
const LOWEST_LIMIT_RATIO: f64 = 1.25;
/// Periods in which a mode must still ring to 1/e of its amplitude, if it does not turn the phase.
const RINGING_PERIODS: f64 = 3.0;
/// Names of the stages of the modes.
const STAGES: [&str; 2] = ["resonance", "resonance_2"];

pub(super) struct Resonance;

impl Diagnosable for Resonance {
    fn effect(&self) -> Effect {
        Effect::Resonance
    }

    fn kind(&self) -> EffectKind {
        EffectKind::LinearDynamics
    }

    fn hidden(&self, problem: &Problem<'_>) -> Option<&'static str> {
        only_one_loop(problem)
    }

    fn is_late(&self) -> bool {
        true
    }

    /// The modes with the largest first-order gain.
    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        let samples = scan.problem.samples;
        let (low, high) = (3.0 / samples.longest_segment(), 0.45 / samples.period);
        let mut grid: Vec<f64> =
            (0..SCAN_FREQUENCIES).map(|i| low * (high / low).powf(i as f64 / (SCAN_FREQUENCIES - 1) as f64)).collect();
        grid.extend(peaks(samples, &scan.residual, 4).into_iter().filter(|hz| *hz > low && *hz < high));
        let mut scored = Vec::new();
        for hz in grid {
            for damping in [0.02, 0.15] {
                let mode = ResonanceParams { hz, damping, gain: 1.0 };
                let moved = scan.behind(Effects { resonances: vec![mode], ..Effects::default() })?;
                if let Some((gain, amplitude)) = scan.gain(&moved) {
                    scored.push((gain, ResonanceParams { gain: amplitude.clamp(0.05, 1.1), ..mode }));
                }
            }
        }
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut chosen: Vec<ResonanceParams> = Vec::new();
        for (_, mode) in scored {
            // A neighbour on the grid would lead to the same optimum.
            if chosen.iter().all(|c| (c.hz / mode.hz).ln().abs() > 0.25) {
                chosen.push(mode);
            }
            if chosen.len() == MAX_STARTS {
                break;
            }
        }
        Ok(chosen.into_iter().map(|mode| scan.with(&|e| e.resonances.push(mode))).collect())
    }

    /// The limit for the mode that is detected best: its share of the motion.
    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        let s = limits.scan.problem.samples;
        // A slower mode is no structural one, or does not decay within the record. It would not be named.
        let longest = s.longest_segment();
        let slowest = slowest_decay(LIMIT_DAMPING, longest).max(MIN_OSCILLATION_HZ);
        let (first, last) = (f64::max(4.0 / longest, LOWEST_LIMIT_RATIO * slowest), 0.3 / s.period);
        if first >= last {
            return Ok(Some(Limit::hidden("the segments are too short, or the sample rate too low, for a limit")));
        }
        let mut best: Option<(f64, f64)> = None;
        for i in 0..LIMIT_FREQUENCIES {
            let hz = first * (last / first).powf(i as f64 / (LIMIT_FREQUENCIES - 1) as f64);
            let size = limits.size(0.2, 1.0, limits.least, &|gain| {
                let mode = ResonanceParams { hz, damping: LIMIT_DAMPING, gain };
                limits.scan.behind(Effects { resonances: vec![mode], ..Effects::default() })
            })?;
            if let Some(size) = size.filter(|size| best.is_none_or(|(least, _)| *size < least)) {
                best = Some((size, hz));
            }
        }
        let Some((size, hz)) = best else {
            return Ok(Some(Limit::hidden("the drive does not excite any mode enough")));
        };
        let meaning = format!(
            "share of the motion that goes through a mode at {} Hz with damping ratio {LIMIT_DAMPING}",
            short(hz)
        );
        Ok(Some(Limit::of(Some(size), "1", meaning)))
    }

    fn is_plausible(&self, problem: &Problem<'_>, fit: &Fitted) -> bool {
        let (longest, nyquist) = (problem.samples.longest_segment(), 0.5 / problem.samples.period);
        fit.hypothesis.effects.resonances.iter().all(|p| {
            rings(p, longest)
                && p.damping < MAX_MODE_DAMPING
                && p.hz > f64::max(2.5 / longest, MIN_OSCILLATION_HZ)
                && p.hz < 0.9 * nyquist
        })
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        effects.resonances.iter().zip(STAGES).any(|(mode, stage)| {
            let parameters = [("hz", mode.hz), ("damping", mode.damping), ("gain", mode.gain)];
            parameters.into_iter().any(|(name, value)| unsure(&format!("{stage}.{name}"), value))
        })
    }

    fn law(&self, _model: &Model) -> Option<&'static str> {
        Some("second-order")
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let r = context.extended.effects.resonances.first()?;
        Some(format!("a mode rings at {:.1} Hz with damping ratio {:.4}", r.hz, r.damping))
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        for (p, stage) in context.extended.effects.resonances.iter().zip(STAGES) {
            put(stage, "hz", p.hz, "Hz");
            put(stage, "damping", p.damping, "1");
            put(stage, "gain", p.gain, "1");
        }
    }

    /// The model without all modes.
    fn without(&self, model: &Model) -> Model {
        let mut less = model.clone();
        less.effects.resonances.clear();
        less
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        let all = &model.effects.resonances;
        let modes: Vec<(f64, f64)> = all.iter().map(|m| (m.hz, m.damping)).collect();
        let one = Complex::new(1.0, 0.0);
        let mode = |w: f64, m: &ResonanceParams| {
            let r = w / (TAU * m.hz);
            one - m.gain + m.gain / Complex::new(1.0 - r * r, 2.0 * m.damping * r)
        };
        let filter = Filter {
            effect: Effect::Resonance,
            phase_says: "A mode shifts the phase near its frequency, within the band of the drive.",
            gain_says: "A mode raises the gain near its frequency, within the band of the drive.",
            response: Some(&|w| all.iter().map(|m| mode(w, m)).product()),
        };
        let mut pictures: Vec<Picture> = frequency::ring_down(scene, &modes).into_iter().collect();
        pictures.push(frequency::modes(scene, &modes));
        pictures.extend(response_pictures(&filter, scene));
        pictures
    }
}

/// Returns whether a mode rings: its free oscillation lasts some periods, or its own part at its frequency, g/(2ζ),
/// exceeds the part of the motion beside it, 1 − g, so that it turns the phase. A smaller ripple may be the misfit of
/// another law. A mode that does not decay within the record may be a harmonic of the drive.
fn rings(mode: &ResonanceParams, longest: f64) -> bool {
    let turns_the_phase = mode.gain >= (1.0 - mode.gain) * 2.0 * mode.damping;
    let decays = mode.hz >= slowest_decay(mode.damping, longest);
    mode.gain > 0.0 && decays && (turns_the_phase || mode.damping < 1.0 / (TAU * RINGING_PERIODS))
}

/// Returns the lowest frequency \[Hz\] at which a mode decays to 1/e within `longest` \[s\].
fn slowest_decay(damping: f64, longest: f64) -> f64 {
    1.0 / (TAU * damping * longest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ripple_of_the_motion_is_no_mode() {
        let rings = |damping: f64, gain: f64| rings(&ResonanceParams { hz: 48.0, damping, gain }, 10.0);
        assert!(!rings(0.062, 0.02) && !rings(0.1, 0.004) && !rings(0.01, 0.0));
        // Lightly damped modes with a small share, a mode in parallel with a stiff part, and a heavily damped one with
        // the whole motion.
        assert!(rings(0.02, 0.01) && rings(0.01, 0.05) && rings(0.05, 0.4) && rings(0.3, 1.0));
        // A mode that does not decay within the record.
        assert!(!rings(1e-4, 0.6));
    }
}
