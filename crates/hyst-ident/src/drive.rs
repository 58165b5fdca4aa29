//! The drive of a model: at the rows of a record, and interpolated between them.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use hyst_core::{Env, Sampling, Stage};
use serde::{Deserialize, Serialize};

use crate::Samples;
use crate::samples::PerSegment;

/// Linear steps per row of a band-limited drive.
///
/// Linear interpolation of the samples reduces a frequency by `(π f / rate)² / 3` (12 % at a fifth of the rate). With
/// these steps the error is 1e-4 up to 0.43 of the rate.
const STEPS: usize = 8;
/// Rows on either side that an interpolated value depends on.
const REACH: isize = 32;

/// The interpolation of a drive between its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BetweenSamples {
    /// Linear: for a drive that is slow compared with its sample rate, and for firmware.
    #[default]
    Linear,
    /// Band-limited: the signal through the samples without frequencies above half the rate, for a filtered drive or a
    /// sum of sines.
    ///
    /// A model runs through eight values per sample. The interpolation needs future samples, so it applies to whole
    /// records only.
    BandLimited,
}

/// The name of an interpolation is unknown.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown interpolation between samples {0:?}; type linear or band-limited")]
pub struct UnknownBetweenSamples(String);

impl FromStr for BetweenSamples {
    type Err = UnknownBetweenSamples;

    fn from_str(name: &str) -> Result<Self, UnknownBetweenSamples> {
        let all = [Self::Linear, Self::BandLimited];
        all.into_iter().find(|way| way.name() == name).ok_or_else(|| UnknownBetweenSamples(name.into()))
    }
}

impl BetweenSamples {
    /// Returns the number of steps per row.
    pub(crate) fn steps(self) -> usize {
        match self {
            Self::Linear => 1,
            Self::BandLimited => STEPS,
        }
    }

    /// Returns the name in files and options.
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

/// The number of passes of a record through a model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Passes {
    /// One pass, from rest.
    #[default]
    Once,
    /// Two passes, the second from the final state of the first. Each segment is then one period of a steady state.
    Periodic,
}

/// The drive of a record, with one or several steps per row.
pub(crate) struct Drive<'a> {
    samples: &'a Samples,
    /// The drive at the rows.
    rows: &'a [f64],
    steps: usize,
    /// `steps` values for each row: the interpolated values before it, and its own value.
    values: Cow<'a, [f64]>,
    passes: Passes,
    /// Number of rows of each segment that the model runs through before the segment begins; 0 if it begins at rest.
    history: Vec<usize>,
}

impl<'a> Drive<'a> {
    pub(crate) fn new(samples: &'a Samples, between: BetweenSamples, passes: Passes) -> Self {
        Self::of(samples, &samples.input, between, passes)
    }

    /// Makes another drive with the segments, temperature and load of a record.
    pub(crate) fn of(samples: &'a Samples, rows: &'a [f64], between: BetweenSamples, passes: Passes) -> Self {
        let values = match between {
            BetweenSamples::Linear => Cow::Borrowed(rows),
            BetweenSamples::BandLimited => {
                samples.segments.iter().flat_map(|s| band_limited(&rows[s.clone()], passes)).collect()
            }
        };
        Self { samples, rows, steps: between.steps(), values, passes, history: vec![0; samples.segments.len()] }
    }

    /// Sets the number of first rows of each segment that the model runs through before the segment begins.
    ///
    /// This approximates the unknown history of a record that begins within a cycle by its first rows.
    pub(crate) fn after(self, history: Vec<usize>) -> Self {
        Self { history, ..self }
    }

    /// Builds a stage for the sample period of each segment.
    pub(crate) fn stages<S, E>(&self, build: impl Fn(&Sampling) -> Result<S, E>) -> Result<PerSegment<S>, E> {
        PerSegment::new(self.samples, |period| build(&Sampling { period: period / self.steps as f64 }))
    }

    /// Computes the output of a stage for all rows. Each segment begins at rest under its first input, or after its
    /// history.
    pub(crate) fn run<S: Stage<f64>>(&self, stages: &PerSegment<S>, out: &mut [f64]) {
        self.run_from(stages, |state, i, env, u0| stages.of(i).reset(state, env, u0), out);
    }

    /// Runs as [`run`](Self::run) does; `begin` sets the initial state of each segment, by its number, under its first
    /// input.
    pub(crate) fn run_from<S: Stage<f64>>(
        &self,
        stages: &PerSegment<S>,
        begin: impl Fn(&mut S::State, usize, &Env<f64>, f64) -> f64,
        out: &mut [f64],
    ) {
        let mut state = Box::new(stages.of(0).state());
        for (i, (segment, history)) in self.samples.segments.iter().zip(&self.history).enumerate() {
            let stage = stages.of(i);
            let Some(first) = segment.clone().next() else { continue };
            out[first] = begin(&mut state, i, &self.samples.env(first), self.rows[first]);
            let before = first + 1..first + history;
            for k in before.clone().chain((!before.is_empty()).then_some(first)) {
                let env = self.samples.env(k);
                for u in &self.values[k * self.steps..(k + 1) * self.steps] {
                    out[first] = stage.step(&mut state, &env, *u);
                }
            }
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

    /// Computes the output for the first `rows` of one segment. `begin` sets the initial state.
    pub(crate) fn beginning<S: Stage<f64>>(
        &self,
        segment: usize,
        rows: usize,
        stage: &S,
        begin: impl Fn(&mut S::State, &Env<f64>, f64) -> f64,
    ) -> Vec<f64> {
        let mut state = Box::new(stage.state());
        let first = self.samples.segments[segment].start;
        let mut out = vec![begin(&mut state, &self.samples.env(first), self.rows[first])];
        for k in first + 1..first + rows {
            let env = self.samples.env(k);
            let values = &self.values[k * self.steps..(k + 1) * self.steps];
            out.extend(values.iter().map(|u| stage.step(&mut state, &env, *u)).next_back());
        }
        out
    }
}

/// Returns [`STEPS`] values per row whose linear interpolation is the band-limited signal through the rows of a
/// segment.
///
/// The last value of each row belongs to the row itself, the others are before it.
fn band_limited(rows: &[f64], passes: Passes) -> Vec<f64> {
    let kernels: Vec<Vec<f64>> = (1..=STEPS).map(|step| kernel(step as f64 / STEPS as f64)).collect();
    let mut around = Vec::new();
    let mut values = Vec::with_capacity(STEPS * rows.len());
    for k in 0..rows.len() {
        around.clear();
        around.extend((-REACH..REACH).map(|i| beyond(rows, k as isize + i, passes)));
        values.extend(kernels.iter().map(|kernel| kernel.iter().zip(&around).map(|(a, b)| a * b).sum::<f64>()));
    }
    values
}

/// Returns the weights of the rows from `REACH` before to `REACH − 1` after a row, for the value `share` of a sample
/// after the previous row.
fn kernel(share: f64) -> Vec<f64> {
    let step = 1.0 / STEPS as f64;
    let weight = |i: isize| {
        let x = share - 1.0 - i as f64;
        // Linear interpolation of a curve has a mean error of 1/12 of the second difference, which is corrected here.
        cardinal(x) - (cardinal(x - step) - 2.0 * cardinal(x) + cardinal(x + step)) / 12.0
    };
    let weights: Vec<f64> = (-REACH..REACH).map(weight).collect();
    // The weights are normalised so that a constant is reproduced exactly.
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

/// Returns the interpolation kernel at `x` samples: sin πx / πx with a Blackman-Harris window.
fn cardinal(x: f64) -> f64 {
    let t = PI * x / REACH as f64;
    let window = 0.35875 + 0.48829 * t.cos() + 0.14128 * (2.0 * t).cos() + 0.01168 * (3.0 * t).cos();
    if x == 0.0 { 1.0 } else { window * (PI * x).sin() / (PI * x) }
}

/// Returns the value of a row that may be beyond an end of the segment.
///
/// A period is repeated. Any other segment is point-reflected at its end, which keeps value and slope there.
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
    use std::f64::consts::TAU;

    /// Returns the relative amplitude of a sine of `cycles` per sample after linear interpolation at multiples of
    /// `step`, over rows 40 to 160.
    fn share(values: &[f64], step: f64, cycles: f64) -> f64 {
        let wave = |x: f64| (TAU * cycles * x + 0.3).sin();
        let line = |x: f64| {
            let (k, rest) = ((x / step).floor(), (x / step).fract());
            values[k as usize] * (1.0 - rest) + values[k as usize + 1] * rest
        };
        let places: Vec<f64> = (0..12_000).map(|i| 40.0 + 0.01 * f64::from(i)).collect();
        let product = |f: &dyn Fn(f64) -> f64| places.iter().map(|x| f(*x) * wave(*x)).sum::<f64>();
        product(&line) / product(&wave)
    }

    #[test]
    fn band_limited_interpolation_keeps_the_amplitude_of_sines() {
        for cycles in [0.01, 0.1, 0.2, 0.3, 0.43] {
            let rows: Vec<f64> = (0..201).map(|k| (TAU * cycles * f64::from(k) + 0.3).sin()).collect();
            let fine = band_limited(&rows, Passes::Once);
            // The first value of a row is 1/8 sample after the previous row.
            let fine = share(&fine[STEPS - 1..], 1.0 / STEPS as f64, cycles);
            assert!((fine - 1.0).abs() < 2e-4, "{cycles} of the rate: {fine}");
            let lines = share(&rows, 1.0, cycles);
            assert!((lines - ((PI * cycles).sin() / (PI * cycles)).powi(2)).abs() < 5e-3, "{cycles}: {lines}");
        }
    }

    /// Returns the largest deviation of the values from `signal`, a function of the row, in the rows `kept`.
    fn off(signal: impl Fn(f64) -> f64, rows: usize, kept: std::ops::Range<usize>, passes: Passes) -> f64 {
        let samples: Vec<f64> = (0..rows).map(|k| signal(k as f64)).collect();
        let values = band_limited(&samples, passes);
        let place = |k: usize| (k + 1) as f64 / STEPS as f64 - 1.0;
        let distance = |k: usize| (values[k] - signal(place(k))).abs();
        kept.flat_map(|row| STEPS * row..STEPS * (row + 1)).map(distance).fold(0.0, f64::max)
    }

    #[test]
    fn a_period_is_interpolated_across_its_ends() {
        let period: Vec<f64> =
            (0..64).map(|k| (TAU * 7.0 * f64::from(k) / 64.0).sin() + f64::from(k * k % 5)).collect();
        let middle = STEPS * 64..STEPS * 128;
        assert_eq!(band_limited(&period, Passes::Periodic), band_limited(&period.repeat(3), Passes::Once)[middle]);
        assert_ne!(band_limited(&period, Passes::Periodic), band_limited(&period, Passes::Once));
    }

    #[test]
    fn constants_and_slopes_are_exact_up_to_the_ends() {
        for rows in [1, 2, 5, 100] {
            assert!(off(|_| -3.0, rows, 0..rows, Passes::Once) < 1e-14);
            assert!(off(|_| -3.0, rows, 0..rows, Passes::Periodic) < 1e-14);
        }
        assert!(off(|x| 2.0 * x - 5.0, 100, 1..100, Passes::Once) < 1e-4);
    }
}
