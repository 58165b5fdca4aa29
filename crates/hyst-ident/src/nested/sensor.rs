//! What a sensor adds to the motion: its zero, its drift, a tone.

use super::Fitted;
use crate::Samples;
use crate::model::Effects;

/// The record with drift and tone taken from its output.
pub(crate) fn without_sensor_effects(samples: &Samples, effects: &Effects) -> Samples {
    let mut motion = samples.clone();
    for (y, t) in motion.output.iter_mut().zip(&samples.time) {
        if let Some(drift) = effects.drift {
            *y -= drift.per_second * t;
        }
        if let Some(tone) = effects.interference {
            *y -= tone.amplitude * (2.0 * std::f64::consts::PI * (tone.hz * t).fract() + tone.phase).sin();
        }
    }
    motion
}

/// The motion that a sensor has shown in the settled rows, as a fit sees it: the output without drift, tone and zero \[y\].
pub(crate) fn shown_motion(samples: &Samples, fit: &Fitted) -> Vec<f64> {
    let motion = without_sensor_effects(samples, &fit.hypothesis.effects);
    let mut shown = Vec::with_capacity(samples.len());
    for (segment, file) in samples.segments.iter().zip(&samples.file_of_segment) {
        // One zero for all files, or one for each.
        let zero = fit.zeros.get(*file).or(fit.zeros.first()).copied().unwrap_or(0.0);
        let settled = segment.clone().filter(|k| !samples.settling[*k]);
        shown.extend(settled.map(|k| motion.output[k] - zero));
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::PiBasis;
    use crate::lsq::Blocks;
    use crate::nested::{Hypothesis, Problem};
    use crate::record::{Columns, OutputUnit, Record};
    use hyst_core::{DriftParams, InterferenceParams};

    /// A lab clock is seldom at zero when a record begins.
    #[test]
    fn motion_is_shown_without_zero_drift_and_tone_whatever_the_clock_says() {
        let rows = || (0..4000).map(|k| 1e4 + f64::from(k) * 1e-3);
        let motion = |t: f64| 3.0 * (1.0 - (10.0 * (t - 1e4)).cos());
        let tone = |t: f64| 0.2 * (std::f64::consts::TAU * (20.0 * t).fract() + 0.4).sin();
        let output = rows().map(|t| motion(t) + 0.05 * (t - 1e4) + tone(t) + 7.0);
        let record = Record::from_samples(Columns {
            time: rows().collect(),
            input: Some(rows().map(|t| 10.0 * motion(t)).collect()),
            output: Some((OutputUnit::Micrometre, output.collect())),
            ..Columns::default()
        });
        let samples = Samples::from_record(&record.unwrap());
        let basis = PiBasis::for_samples(&samples);
        let blocks = Blocks::new(&samples, 20, 4000);
        let problem = Problem::new(&samples, &basis, &blocks, false);
        let effects = Effects {
            drift: Some(DriftParams::default()),
            interference: Some(InterferenceParams { hz: 20.0, ..InterferenceParams::default() }),
            ..Effects::default()
        };
        let fit = problem.fit_linear(&Hypothesis::of(effects)).unwrap().unwrap();
        let shown = shown_motion(&samples, &fit);
        assert_eq!(shown.len(), samples.len());
        for (shown, t) in shown.iter().zip(rows()) {
            assert!((shown - motion(t)).abs() < 1e-4, "{shown} instead of {} at {t} s", motion(t));
        }
    }
}
