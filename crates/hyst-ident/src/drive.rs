//! The drive as a model sees it: at the rows, and between them.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt;

use hyst_core::Stage;
use serde::{Deserialize, Serialize};

use crate::Samples;

/// Steps from one row to the next on a band-limited drive. Linear within a step it loses `(π f / 8 rate)² / 3` of a frequency, 0.2 %
/// at a fifth of the rate, where one step a row loses 12 %.
const STEPS: usize = 8;
/// Rows on either side that a value between two rows is made of.
const REACH: isize = 32;

/// How a drive goes on between its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BetweenSamples {
    /// On straight lines: a drive that is slow for its sample rate, and what firmware can know of any.
    #[default]
    Linear,
    /// As the one signal through the samples without frequencies above half the rate: a drive from a filter, or one that was made of
    /// sines. A model runs through eight values of it a sample; it has to know what comes, so whole records only.
    BandLimited,
}

impl BetweenSamples {
    /// Its name in files and options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::BandLimited => "band-limited",
        }
    }

    pub(crate) fn is_linear(&self) -> bool {
        *self == Self::Linear
    }
}

impl fmt::Display for BetweenSamples {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How often a record is passed through a model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Passes {
    /// Once, from rest.
    #[default]
    Once,
    /// Twice, the second time from the state in which the first has ended: each segment is one period of a steady state.
    Periodic,
}

/// The drive of a record in as many steps a row as a model shall take.
pub(crate) struct Drive<'a> {
    samples: &'a Samples,
    steps: usize,
    /// `steps` values for each row: those that lead to it, and its own.
    values: Cow<'a, [f64]>,
    passes: Passes,
}

impl<'a> Drive<'a> {
    pub(crate) fn new(samples: &'a Samples, between: BetweenSamples, passes: Passes) -> Self {
        match between {
            BetweenSamples::Linear => Self { samples, steps: 1, values: Cow::Borrowed(&samples.input), passes },
            BetweenSamples::BandLimited => {
                let segments = samples.segments.iter();
                let values = segments.flat_map(|s| band_limited(&samples.input[s.clone()], passes)).collect();
                Self { samples, steps: STEPS, values: Cow::Owned(values), passes }
            }
        }
    }

    /// Sample period that a stage has to be built for \[s\].
    pub(crate) fn period(&self) -> f64 {
        self.samples.period / self.steps as f64
    }

    /// Output of a stage over the rows, one segment after the other, each from rest under its first input.
    pub(crate) fn run<S: Stage<f64>>(&self, stage: &S, out: &mut [f64]) {
        let mut state = Box::new(stage.state());
        for segment in &self.samples.segments {
            let Some(first) = segment.clone().next() else { continue };
            out[first] = stage.reset(&mut state, &self.samples.env(first), self.samples.input[first]);
            let again = match self.passes {
                Passes::Once => 0..0,
                Passes::Periodic => segment.clone(),
            };
            for k in (first + 1..segment.end).chain(again) {
                let env = self.samples.env(k);
                for u in &self.values[k * self.steps..(k + 1) * self.steps] {
                    out[k] = stage.step(&mut state, &env, *u);
                }
            }
        }
    }
}

/// The band-limited signal through the rows of a segment, [`STEPS`] values a row: those that lead to it, and its own. A sum of shifted
/// sines over their arguments under a Blackman-Harris window: within 1e-4 up to 0.43 of the sample rate.
fn band_limited(rows: &[f64], passes: Passes) -> Vec<f64> {
    let kernels: Vec<Vec<f64>> = (1..STEPS).map(|step| kernel(step as f64 / STEPS as f64)).collect();
    let mut around = Vec::new();
    let mut values = Vec::with_capacity(STEPS * rows.len());
    for (k, own) in rows.iter().enumerate() {
        around.clear();
        around.extend((-REACH..REACH).map(|i| beyond(rows, k as isize + i, passes)));
        values.extend(kernels.iter().map(|kernel| kernel.iter().zip(&around).map(|(a, b)| a * b).sum::<f64>()));
        values.push(*own);
    }
    values
}

/// Weights of the rows from `REACH` before to `REACH − 1` after a row for the value `share` of a sample after the row before it.
fn kernel(share: f64) -> Vec<f64> {
    let weight = |i: isize| {
        let x = share - 1.0 - i as f64;
        let t = PI * x / REACH as f64;
        let window = 0.35875 + 0.48829 * t.cos() + 0.14128 * (2.0 * t).cos() + 0.01168 * (3.0 * t).cos();
        window * (PI * x).sin() / (PI * x)
    };
    let weights: Vec<f64> = (-REACH..REACH).map(weight).collect();
    // A constant stays what it is.
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

/// The value in a row that may lie beyond an end. A period goes on with itself; any other segment is taken as turned about its end
/// point, which keeps value and slope there.
fn beyond(rows: &[f64], k: isize, passes: Passes) -> f64 {
    let last = rows.len() as isize - 1;
    let at = |k: isize| rows[k.clamp(0, last) as usize];
    match passes {
        _ if (0..=last).contains(&k) => at(k),
        Passes::Periodic => at(k.rem_euclid(last + 1)),
        Passes::Once if k < 0 => 2.0 * at(0) - at(-k),
        Passes::Once => 2.0 * at(last) - at(2 * last - k),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest distance of the values between rows from `signal`, a function of rows, in the rows of `kept`.
    fn off(signal: impl Fn(f64) -> f64, rows: usize, kept: std::ops::Range<usize>, passes: Passes) -> f64 {
        let samples: Vec<f64> = (0..rows).map(|k| signal(k as f64)).collect();
        let values = band_limited(&samples, passes);
        let place = |k: usize| (k + 1) as f64 / STEPS as f64 - 1.0;
        kept.flat_map(|row| STEPS * row..STEPS * (row + 1))
            .map(|k| (values[k] - signal(place(k))).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn sines_come_out_between_their_samples() {
        for share in [0.01, 0.1, 0.2, 0.3, 0.43] {
            let wave = |x: f64| (2.0 * PI * share * x + 0.3).sin();
            assert!(off(wave, 200, 40..160, Passes::Once) < 1e-4, "{share} of the rate");
        }
        // What is stated for straight lines.
        let wave = |x: f64| (2.0 * PI * 0.2 * x).sin();
        let line = |x: f64| wave(x.floor()) + (wave(x.ceil()) - wave(x.floor())) * (x - x.floor());
        let share =
            |f: &dyn Fn(f64) -> f64| (0..4000).map(|i| f(0.01 * f64::from(i)) * wave(0.01 * f64::from(i))).sum::<f64>();
        assert!((share(&line) / share(&wave) - 0.875).abs() < 2e-3);
    }

    #[test]
    fn a_period_has_no_ends() {
        let wave = |x: f64| (2.0 * PI * 7.0 * x / 64.0).sin() + (2.0 * PI * 20.0 * x / 64.0).cos();
        assert!(off(wave, 64, 0..64, Passes::Periodic) < 1e-4);
        assert!(off(wave, 64, 1..64, Passes::Once) > 1e-2);
    }

    #[test]
    fn constants_and_slopes_stay_up_to_the_ends() {
        for rows in [1, 2, 5, 100] {
            assert!(off(|_| -3.0, rows, 0..rows, Passes::Once) < 1e-14);
            assert!(off(|_| -3.0, rows, 0..rows, Passes::Periodic) < 1e-14);
        }
        assert!(off(|x| 2.0 * x - 5.0, 100, 1..100, Passes::Once) < 1e-4);
    }
}
