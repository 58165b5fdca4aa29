//! Limits of detection: the smallest size of an effect that is not named at which this record would have shown it.
//!
//! An effect of a given size changes the output by a column of numbers. The part of that column that the base and the
//! effects found cannot imitate is the gain of a search for it. The search accepts from a known gain on (`least_gain`
//! in `score.rs`). So the size follows from linear algebra, without a search. If an effect is not proportional to its
//! parameter, the column is recomputed at the size found.

use std::collections::BTreeMap;

use hyst_core::{DelayParams, Error, LagParams, RateLaw, RateParams, ResonanceParams, TemperatureParams};
use serde::{Deserialize, Serialize};

use super::causes::hidden;
use super::scan::Scan;
use super::score::least_gain;
use super::trial::Trial;
use super::trial_parameters::{PER_DECADE, bank, starting_temperature};
use crate::digits::short;
use crate::model::{Effect, Effects};
use crate::nested::{Cause, Problem, SignalPath};
use crate::statistics::range;

/// Safety factor on the gain at which the search accepts: noise may hide a part of it.
const GAIN_MARGIN: f64 = 1.25;
/// Maximum number of rounds in which the column is recomputed.
const ROUNDS: usize = 4;
/// Mode of the limit for a resonance: damping ratio, number of frequencies that are tried, and smallest share of the
/// motion.
const DAMPING: f64 = 0.02;
const FREQUENCIES: usize = 10;
const MIN_MODE_SHARE: f64 = 0.06;
/// Frequency of the tone of the limit for interference \[Hz\]; a tenth of the sample rate if the record does not cover
/// it.
const MAINS_HZ: f64 = 50.0;
/// Ratio of successive depths of the saturation limit that are tried.
const DEPTH_RATIO: f64 = 1.3;
/// Smallest depth of the saturation limit, as a share of the stroke.
const MIN_DEPTH_SHARE: f64 = 1e-3;

/// Limit of detection of an effect in one record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Limit {
    /// The smallest size at which the effect would have been named.
    Size {
        /// Size.
        size: f64,
        /// Its unit.
        unit: String,
        /// What the size measures.
        meaning: String,
    },
    /// The record cannot show the effect, whatever its size.
    NotVisible {
        /// Reason.
        not_visible: String,
    },
}

impl Limit {
    fn hidden(why: &str) -> Self {
        Self::NotVisible { not_visible: why.into() }
    }

    fn of(size: Option<f64>, unit: &str, meaning: String) -> Self {
        match size.filter(|s| s.is_finite() && *s > 0.0) {
            Some(size) => Self::Size { size, unit: unit.into(), meaning },
            None => Self::hidden("the base model or the effects found imitate it"),
        }
    }
}

/// Shared context of all limits.
struct Limits<'a> {
    scan: Scan<'a>,
    /// Gain from which on an effect is accepted, and from which on a tone is.
    least: f64,
    least_tone: f64,
}

/// Returns the limit of each effect that was not found, on the basis of the search. Asymmetry has none: that basis
/// bends by itself.
pub(super) fn limits(
    problem: &Problem<'_>,
    found: &Trial,
    noise: f64,
    units: (&str, &str),
) -> Result<BTreeMap<Effect, Limit>, Error> {
    let h = &found.fit.hypothesis;
    let (rows, left) = (found.fit.rows as f64, found.total());
    let least = |left: f64| GAIN_MARGIN * least_gain(rows, left, noise).max(f64::MIN_POSITIVE);
    let all = Limits {
        scan: Scan::new(problem, &found.fit, 0.0)?,
        least: least(left),
        // A tone is judged against the noise floor alone.
        least_tone: least(rows * noise * noise),
    };
    let mut limits = BTreeMap::new();
    for effect in Effect::ALL {
        let cause = Cause::Effect(effect);
        if h.causes().contains(&cause) {
            continue;
        }
        match hidden(cause, problem) {
            Some(why) => limits.insert(effect, Limit::hidden(why)),
            None => all.of(effect, units)?.and_then(|limit| limits.insert(effect, limit)),
        };
    }
    Ok(limits)
}

impl Limits<'_> {
    /// Returns the size at which the part of an effect that nothing else imitates reaches `least` (Σ residual²).
    /// `change` returns the change of the output for a size.
    fn size(
        &self,
        first: f64,
        most: f64,
        least: f64,
        change: &dyn Fn(f64) -> Result<Vec<f64>, Error>,
    ) -> Result<Option<f64>, Error> {
        let mut size = first;
        for _ in 0..ROUNDS {
            let left = self.scan.left(&change(size)?);
            if left <= 0.0 || left.is_nan() {
                return Ok(None);
            }
            let next = size * (least / left).sqrt();
            if (next / size - 1.0).abs() < 0.02 {
                return Ok(Some(next));
            }
            size = next.min(most);
        }
        // At the largest possible size the effect is not detected.
        let left = self.scan.left(&change(size)?);
        Ok((size < most || left >= least).then_some(size))
    }

    /// Returns the change of the motion with another stage before the operator.
    fn moved(&self, change: &dyn Fn(&mut Effects)) -> Result<Vec<f64>, Error> {
        let mut h = self.scan.from.hypothesis.clone();
        change(&mut h.effects);
        self.scan.moved(&h)
    }

    /// Returns the limit of an effect that this record can show; `None` for an effect that is searched elsewhere.
    fn of(&self, effect: Effect, (u, y): (&str, &str)) -> Result<Option<Limit>, Error> {
        let s = self.scan.problem.samples;
        let (low, high) = s.input_range();
        let longest = s.longest_segment();
        Ok(Some(match effect {
            Effect::Delay => {
                let size = self.size(s.period, 0.1 * longest, self.least, &|seconds| {
                    self.moved(&|e| e.delay = Some(DelayParams { seconds }))
                })?;
                Limit::of(size, "s", "delay of the output, the same at every frequency".into())
            }
            Effect::Lag => {
                let size = self.size(s.period, 0.1 * longest, self.least, &|seconds| {
                    self.moved(&|e| e.lag = Some(LagParams { seconds }))
                })?;
                Limit::of(size, "s", "time constant of a first-order lag".into())
            }
            Effect::RateDependence => {
                let reference_rate = high - low;
                let size = self.size(1e-3 * reference_rate, 0.3 * reference_rate, self.least, &|volts| {
                    let rate = RateParams { volts, exponent: 0.5, reference_rate, law: RateLaw::Holds };
                    self.moved(&|e| e.rate = Some(rate))
                })?;
                let at = short(reference_rate);
                Limit::of(
                    size,
                    u,
                    format!("lag behind a drive of {at} {u}/s, growing with the square root of the rate"),
                )
            }
            Effect::Temperature => {
                let reference_degc = starting_temperature(s);
                let size = self.size(1e-3, 0.05, self.least, &|per_kelvin| {
                    let p = TemperatureParams { per_kelvin, reference_degc, ..TemperatureParams::default() };
                    self.scan.behind(Effects { temperature: Some(p), ..Effects::default() })
                })?;
                Limit::of(size, "1/K", "relative change of the gain per kelvin".into())
            }
            Effect::Creep => {
                let size = self.size(1e-3, 1.0, self.least, &|decade| {
                    let bank = bank(s, self.scan.problem.only_loop, decade / PER_DECADE);
                    self.scan.behind(Effects { creep: Some(bank), ..Effects::default() })
                })?;
                Limit::of(size, "1", "continued motion per decade of time, as a share of the step".into())
            }
            Effect::Load => {
                let Some(load) = &s.load else { return Ok(None) };
                let path = SignalPath::new(s, &self.scan.from.hypothesis)?;
                let size = self.size(1.0, f64::INFINITY, self.least, &|per_newton| {
                    let mut column: Vec<f64> = load.iter().map(|f| per_newton * f).collect();
                    path.structure(&mut column);
                    Ok(column)
                })?;
                Limit::of(size, &format!("{y}/N"), "deflection of the output per newton of load".into())
            }
            Effect::Resonance => self.mode()?,
            Effect::Saturation => self.stop(y),
            Effect::Drift => {
                let whole = s.time[s.len() - 1] - s.time[0];
                let size = self.size(1.0, f64::INFINITY, self.least, &|way| {
                    Ok(s.time.iter().map(|t| way * (t - s.time[0]) / whole).collect())
                })?;
                Limit::of(size, y, "linear drift of the zero over the record".into())
            }
            Effect::Interference => {
                let rate = 1.0 / s.period;
                let hz = if MAINS_HZ < 0.4 * rate && MAINS_HZ > 3.0 / longest { MAINS_HZ } else { 0.1 * rate };
                let turn = |t: &f64| std::f64::consts::TAU * (hz * t).fract();
                let size = self.size(1.0, f64::INFINITY, self.least_tone, &|amplitude| {
                    Ok(s.time.iter().map(|t| amplitude * turn(t).sin()).collect())
                })?;
                Limit::of(size, y, format!("amplitude of a tone at {} Hz in the sensor", short(hz)))
            }
            Effect::Asymmetry => return Ok(None),
        }))
    }

    /// Returns the limit for the mode that is detected best: its share of the motion.
    fn mode(&self) -> Result<Limit, Error> {
        let s = self.scan.problem.samples;
        let (first, last) = (f64::max(4.0 / s.longest_segment(), 1.0), 0.3 / s.period);
        let mut best: Option<(f64, f64)> = None;
        for i in 0..FREQUENCIES {
            let hz = first * (last / first).powf(i as f64 / (FREQUENCIES - 1) as f64);
            let size = self.size(0.2, 1.0, self.least, &|gain| {
                let mode = ResonanceParams { hz, damping: DAMPING, gain };
                self.scan.behind(Effects { resonances: vec![mode], ..Effects::default() })
            })?;
            if let Some(size) = size.filter(|size| best.is_none_or(|(least, _)| *size < least)) {
                best = Some((size, hz));
            }
        }
        let Some((size, hz)) = best else {
            return Ok(Limit::hidden("the drive does not excite any mode enough"));
        };
        let meaning =
            format!("share of the motion that goes through a mode at {} Hz with damping ratio {DAMPING}", short(hz));
        Ok(Limit::of(Some(size.max(MIN_MODE_SHARE)), "1", meaning))
    }

    /// Returns the limit for an upper saturation limit: its distance below the highest output.
    fn stop(&self, y: &str) -> Limit {
        let (low, high) = range(self.scan.motion.iter().copied());
        let mut depth = MIN_DEPTH_SHARE * (high - low);
        while depth < high - low {
            let ends: Vec<f64> = self.scan.motion.iter().map(|m| (high - depth - m).min(0.0)).collect();
            if self.scan.left(&ends) >= self.least {
                return Limit::of(
                    Some(depth),
                    y,
                    "distance of the upper saturation limit below the highest output".into(),
                );
            }
            depth *= DEPTH_RATIO;
        }
        Limit::hidden("the base model or the effects found imitate it")
    }
}
