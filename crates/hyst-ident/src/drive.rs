//! The drive as a model sees it: at the rows, and between them.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use hyst_core::{Env, Sampling, Stage};
use serde::{Deserialize, Serialize};

use crate::Samples;
use crate::samples::PerSegment;

/// Steps from one row to the next on a band-limited drive, linear within each. Through the samples themselves straight lines lose
/// `(π f / rate)² / 3` of a frequency, 12 % at a fifth of the rate; these values make that up: 1e-4 is left up to 0.43 of the rate.
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

/// No way of going on between samples has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is no way to go on between samples; there are linear and band-limited")]
pub struct UnknownBetweenSamples(String);

impl FromStr for BetweenSamples {
    type Err = UnknownBetweenSamples;

    fn from_str(name: &str) -> Result<Self, UnknownBetweenSamples> {
        let all = [Self::Linear, Self::BandLimited];
        all.into_iter().find(|way| way.name() == name).ok_or_else(|| UnknownBetweenSamples(name.into()))
    }
}

impl BetweenSamples {
    /// Steps from one row to the next.
    pub(crate) fn steps(self) -> usize {
        match self {
            Self::Linear => 1,
            Self::BandLimited => STEPS,
        }
    }

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
    /// The drive at the rows.
    rows: &'a [f64],
    steps: usize,
    /// `steps` values for each row: those that lead to it, and its own.
    values: Cow<'a, [f64]>,
    passes: Passes,
    /// Rows of each segment that pass before it begins; none where it begins at rest.
    history: Vec<usize>,
}

impl<'a> Drive<'a> {
    pub(crate) fn new(samples: &'a Samples, between: BetweenSamples, passes: Passes) -> Self {
        Self::of(samples, &samples.input, between, passes)
    }

    /// Another drive over the segments and in the surroundings of a record.
    pub(crate) fn of(samples: &'a Samples, rows: &'a [f64], between: BetweenSamples, passes: Passes) -> Self {
        let values = match between {
            BetweenSamples::Linear => Cow::Borrowed(rows),
            BetweenSamples::BandLimited => {
                samples.segments.iter().flat_map(|s| band_limited(&rows[s.clone()], passes)).collect()
            }
        };
        Self { samples, rows, steps: between.steps(), values, passes, history: vec![0; samples.segments.len()] }
    }

    /// The same where the first rows of each segment, as many as `history` says, have passed before it begins: what came before a record that
    /// begins in mid-cycle is taken for what comes after.
    pub(crate) fn after(self, history: Vec<usize>) -> Self {
        Self { history, ..self }
    }

    /// A stage for each segment, as `build` makes it for a sample period.
    pub(crate) fn stages<S, E>(&self, build: impl Fn(&Sampling) -> Result<S, E>) -> Result<PerSegment<S>, E> {
        PerSegment::new(self.samples, |period| build(&Sampling { period: period / self.steps as f64 }))
    }

    /// Output of a stage over the rows, one segment after the other, each from rest under its first input or after its history.
    pub(crate) fn run<S: Stage<f64>>(&self, stages: &PerSegment<S>, out: &mut [f64]) {
        self.run_from(stages, |state, i, env, u0| stages.of(i).reset(state, env, u0), out);
    }

    /// The same where `begin` says in what state each segment, by its number, begins under its first input.
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

    /// The first `rows` of one segment, which `begin` begins.
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

/// Values whose straight lines are the band-limited signal through the rows of a segment, [`STEPS`] a row: those that lead to it, and
/// its own.
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

/// Weights of the rows from `REACH` before to `REACH − 1` after a row for the value `share` of a sample after the row before it.
fn kernel(share: f64) -> Vec<f64> {
    let step = 1.0 / STEPS as f64;
    let weight = |i: isize| {
        let x = share - 1.0 - i as f64;
        // Straight lines lie on the inner side of a bend by, on average, a twelfth of its second difference.
        cardinal(x) - (cardinal(x - step) - 2.0 * cardinal(x) + cardinal(x + step)) / 12.0
    };
    let weights: Vec<f64> = (-REACH..REACH).map(weight).collect();
    // A constant stays what it is.
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

/// The signal through a one among zeros, `x` samples from the one: sin πx / πx under a Blackman-Harris window.
fn cardinal(x: f64) -> f64 {
    let t = PI * x / REACH as f64;
    let window = 0.35875 + 0.48829 * t.cos() + 0.14128 * (2.0 * t).cos() + 0.01168 * (3.0 * t).cos();
    if x == 0.0 { 1.0 } else { window * (PI * x).sin() / (PI * x) }
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
    use std::f64::consts::TAU;

    /// What straight lines between values at multiples of `step` have of a sine of `cycles` a sample: its share, over rows 40 to 160.
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
    fn sines_keep_their_size_between_their_samples() {
        for cycles in [0.01, 0.1, 0.2, 0.3, 0.43] {
            let rows: Vec<f64> = (0..201).map(|k| (TAU * cycles * f64::from(k) + 0.3).sin()).collect();
            let fine = band_limited(&rows, Passes::Once);
            // The first value that leads to a row lies an eighth after the row before it.
            let fine = share(&fine[STEPS - 1..], 1.0 / STEPS as f64, cycles);
            assert!((fine - 1.0).abs() < 2e-4, "{cycles} of the rate: {fine}");
            let lines = share(&rows, 1.0, cycles);
            assert!((lines - ((PI * cycles).sin() / (PI * cycles)).powi(2)).abs() < 5e-3, "{cycles}: {lines}");
        }
    }

    /// Largest distance of the values from those of `signal`, a function of rows, in the rows of `kept`.
    fn off(signal: impl Fn(f64) -> f64, rows: usize, kept: std::ops::Range<usize>, passes: Passes) -> f64 {
        let samples: Vec<f64> = (0..rows).map(|k| signal(k as f64)).collect();
        let values = band_limited(&samples, passes);
        let place = |k: usize| (k + 1) as f64 / STEPS as f64 - 1.0;
        let distance = |k: usize| (values[k] - signal(place(k))).abs();
        kept.flat_map(|row| STEPS * row..STEPS * (row + 1)).map(distance).fold(0.0, f64::max)
    }

    #[test]
    fn a_period_has_no_ends() {
        let period: Vec<f64> =
            (0..64).map(|k| (TAU * 7.0 * f64::from(k) / 64.0).sin() + f64::from(k * k % 5)).collect();
        let middle = STEPS * 64..STEPS * 128;
        assert_eq!(band_limited(&period, Passes::Periodic), band_limited(&period.repeat(3), Passes::Once)[middle]);
        assert_ne!(band_limited(&period, Passes::Periodic), band_limited(&period, Passes::Once));
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
