//! Effects of the sensor: zero, drift, a tone.

use hyst_core::HARMONIC_PARTS;

use super::{Fitted, Hypothesis, Problem};
use crate::Samples;
use crate::model::Effects;

/// Returns the record with drift and tone subtracted from its output.
pub(crate) fn without_sensor_effects(samples: &Samples, effects: &Effects) -> Samples {
    let mut motion = samples.clone();
    for (y, t) in motion.output.iter_mut().zip(&samples.time) {
        if let Some(drift) = effects.drift {
            *y -= drift.at(*t);
        }
        if let Some(tone) = effects.interference {
            *y -= tone.at(*t);
        }
    }
    motion
}

/// Returns the motion in the settled rows: the measured output without drift, tone and zero of a fit \[y\].
pub(crate) fn shown_motion(samples: &Samples, fit: &Fitted) -> Vec<f64> {
    let motion = without_sensor_effects(samples, &fit.hypothesis.effects);
    let mut shown = Vec::with_capacity(samples.len());
    for (segment, file) in samples.segments.iter().zip(&samples.file_of_segment) {
        // One zero for all files, or one for each file.
        let zero = fit.zeros.get(*file).or(fit.zeros.first()).copied().unwrap_or(0.0);
        let settled = segment.clone().filter(|k| !samples.settling[*k]);
        shown.extend(settled.map(|k| motion.output[k] - zero));
    }
    shown
}

impl Problem<'_> {
    /// Returns the columns of zeros, drift and tone.
    pub(super) fn sensor_columns(&self, h: &Hypothesis) -> Vec<Vec<f64>> {
        let s = self.samples;
        let mut columns = vec![vec![0.0; s.len()]; self.zeros()];
        for (segment, file) in s.segments.iter().zip(&s.file_of_segment) {
            let column = &mut columns[if self.zero_per_file { *file } else { 0 }];
            column[segment.clone()].fill(1.0);
        }
        if let Some(drift) = &h.effects.drift {
            columns.push(s.time.iter().map(|t| t - s.time[0]).collect());
            if drift.seconds > 0.0 {
                columns.push(s.time.iter().map(|t| drift.settled(*t)).collect());
            }
        }
        if let Some(tone) = &h.effects.interference {
            let angle = |t: &f64| 2.0 * std::f64::consts::PI * (tone.hz * t).fract();
            for order in (1..=1 + HARMONIC_PARTS / 2).map(|order| order as f64) {
                columns.push(s.time.iter().map(|t| (order * angle(t)).sin()).collect());
                columns.push(s.time.iter().map(|t| (order * angle(t)).cos()).collect());
            }
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::PiBasis;
    use crate::lsq::Blocks;
    use crate::record::{Columns, OutputUnit, Record};
    use hyst_core::{DriftParams, InterferenceParams, LoadParams};

    fn rows() -> impl Iterator<Item = f64> {
        (0..4000).map(|k| 1e4 + f64::from(k) * 1e-3)
    }

    fn motion(t: f64) -> f64 {
        3.0 * (1.0 - (10.0 * (t - 1e4)).cos())
    }

    fn load(t: f64) -> f64 {
        (0.7 * (t - 1e4)).sin()
    }

    /// A motion with zero, drift, tone and a load.
    fn samples(per_newton: f64) -> Samples {
        let tone = |t: f64| 0.2 * (std::f64::consts::TAU * (20.0 * t).fract() + 0.4).sin();
        let output = rows().map(|t| motion(t) + per_newton * load(t) + 0.05 * (t - 1e4) + tone(t) + 7.0);
        let record = Record::from_samples(Columns {
            time: rows().collect(),
            input: Some(rows().map(|t| 10.0 * motion(t)).collect()),
            output: Some((OutputUnit::Micrometre, output.collect())),
            load: Some(rows().map(load).collect()),
            ..Columns::default()
        });
        Samples::from_record(&record.unwrap())
    }

    /// Effects found elsewhere stay fixed, and their error stays in the residual.
    #[test]
    fn fixed_effects_are_not_solved_for() {
        let samples = samples(0.3);
        let basis = PiBasis::for_samples(&samples);
        let blocks = Blocks::new(&samples, 20, 4000);
        let solved = Problem::new(&samples, &basis, &blocks, false);
        let held = Problem::new(&samples, &basis, &blocks, false).with_linear_effects_fixed();
        let found = Hypothesis::of(Effects {
            load: Some(LoadParams { per_newton: 0.25, ..LoadParams::default() }),
            drift: Some(DriftParams { per_second: 0.06, ..DriftParams::default() }),
            interference: Some(InterferenceParams { hz: 20.0, amplitude: 0.17, phase: 0.5, ..Default::default() }),
            ..Effects::default()
        });
        let solved = solved.fit_linear(&found).unwrap().unwrap().hypothesis.effects;
        assert!((solved.load.unwrap().per_newton - 0.3).abs() < 1e-4, "{solved:?}");
        assert!((solved.drift.unwrap().per_second - 0.05).abs() < 1e-4, "{solved:?}");
        assert!((solved.interference.unwrap().amplitude - 0.2).abs() < 1e-4, "{solved:?}");
        let kept = held.fit_linear(&found).unwrap().unwrap();
        let residual = held.residual(&kept).unwrap();
        let (kept, given) = (&kept.hypothesis.effects, &found.effects);
        assert!((kept.load.unwrap().per_newton - 0.25).abs() < 1e-12, "{kept:?}");
        assert!((kept.drift.unwrap().per_second - 0.06).abs() < 1e-12, "{kept:?}");
        let (kept, given) = (kept.interference.unwrap(), given.interference.unwrap());
        assert!((kept.amplitude - given.amplitude).abs() + (kept.phase - given.phase).abs() < 1e-12, "{kept:?}");
        // The residual contains the error of the fixed tone: a correlation with its sine of (0.2 cos 0.4 − 0.17 cos
        // 0.5) / 2.
        let sine = |t: f64| (std::f64::consts::TAU * (20.0 * t).fract()).sin();
        let left = rows().zip(&residual).map(|(t, left)| left * sine(t)).sum::<f64>() / residual.len() as f64;
        let expected = 0.5 * (0.2 * 0.4_f64.cos() - 0.17 * 0.5_f64.cos());
        assert!((left - expected).abs() < 0.1 * expected, "{left} {expected}");
    }

    /// The lab clock is seldom at zero when a record begins.
    #[test]
    fn motion_is_shown_without_zero_drift_and_tone_at_any_clock_time() {
        let samples = samples(0.0);
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
