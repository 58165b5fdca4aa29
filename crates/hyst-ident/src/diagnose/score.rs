//! Whether an effect's gain is real and matters.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use hyst_core::SaturationParams;

use super::trial::Trial;
use crate::Samples;

/// Bootstrap draws.
pub(super) const DRAWS: usize = 1000;
/// Share of draws in which the gain must be above zero.
const CONFIDENCE: f64 = 0.99;
/// RMSE must fall at least by this share.
const LEAST_FALL: f64 = 0.1;
/// What an effect adds must be at least this many noise floors (root mean square).
pub(super) const LEAST_OVER_NOISE: f64 = 0.5;
/// Share of what stands above the noise floor that an effect must explain.
const LEAST_SHARE: f64 = 0.3;
/// Largest share of a motion that creep may add in the end.
const MOST_CREEP: f64 = 0.3;

/// Slowest tone of a sensor \[Hz\]: what swings more slowly may as well be a force or the room.
const SLOWEST_TONE: f64 = 2.0;
/// Slowest structural mode \[Hz\]: what moves by itself in seconds is no structure of a piezo's size.
const SLOWEST_MODE: f64 = 1.0;
/// Largest damping ratio of what may be called a resonance: beyond it nothing rings.
const MOST_DAMPING: f64 = 0.35;

/// How an effect was judged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Judgement {
    /// Share of bootstrap draws in which the cross-validated error falls.
    pub(crate) confidence: f64,
    /// RMSE after over before, cross-validated.
    pub(crate) ratio: f64,
    /// Share of the variance above the noise floor that the effect explains.
    pub(crate) share: f64,
    /// Root mean square of what it adds, in noise floors.
    pub(crate) over_noise: f64,
    /// Whether its parameters are physically sensible and away from their bounds.
    pub(crate) sensible: bool,
}

impl Judgement {
    pub(crate) fn accepted(&self) -> bool {
        self.sensible
            && self.confidence >= CONFIDENCE
            && self.ratio <= 1.0 - LEAST_FALL
            && self.over_noise >= LEAST_OVER_NOISE
            && self.share >= LEAST_SHARE
    }
}

pub(crate) fn judge(samples: &Samples, without: &Trial, with: &Trial, noise: f64, seed: u64) -> Judgement {
    let rows = with.fit.rows.max(1) as f64;
    let (before, after) = (without.total(), with.total());
    let gain = (before - after).max(0.0);
    let above = (before - rows * noise * noise).max(f64::MIN_POSITIVE);
    let differences: Vec<f64> = without.blocks.iter().zip(&with.blocks).map(|(a, b)| a - b).collect();
    Judgement {
        confidence: share_above_zero(&differences, seed),
        ratio: (after / before.max(f64::MIN_POSITIVE)).sqrt(),
        share: gain / above,
        over_noise: (gain / rows).sqrt() / noise.max(f64::MIN_POSITIVE),
        sensible: sensible(samples, with),
    }
}

/// Whether the first errors may well be no larger than the second.
pub(super) fn open(a: &[f64], b: &[f64], seed: u64) -> bool {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    share_above_zero(&differences, seed) < 0.95
}

/// Share of block-bootstrap draws whose sum is above zero.
fn share_above_zero(differences: &[f64], seed: u64) -> f64 {
    let n = differences.len();
    if n == 0 {
        return 0.0;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let above = (0..DRAWS).filter(|_| (0..n).map(|_| differences[rng.random_range(0..n)]).sum::<f64>() > 0.0).count();
    above as f64 / DRAWS as f64
}

/// Whether every effect's parameters are physically sensible and away from the bounds of the search.
pub(super) fn sensible(samples: &Samples, trial: &Trial) -> bool {
    let e = &trial.fit.hypothesis.effects;
    let (longest, nyquist) = (samples.longest_segment(), 0.5 / samples.period);
    // No law of a drag is the device's to the last digit: what is late by a part of a sample then is the law's own misfit.
    let least = if trial.fit.hypothesis.drag.is_some() { 0.3 } else { 0.02 };
    let time = |seconds: f64| seconds > least * samples.period && seconds < 0.09 * longest;
    e.delay.is_none_or(|p| time(p.seconds))
        && e.lag.is_none_or(|p| time(p.seconds))
        && trial.fit.hypothesis.drag.is_none_or(|p| p.volt_seconds > 0.0 || p.seconds > 0.02 * samples.period)
        && e.saturation.is_none_or(|p| stops_something(samples, trial, &p))
        && e.temperature.is_none_or(|p| p.per_kelvin.abs() < 0.049)
        && e.creep.as_ref().is_none_or(|p| p.total() > 0.0 && p.total() < MOST_CREEP)
        && e.resonances.iter().all(|p| {
            p.gain > 1e-3
                && p.damping < MOST_DAMPING
                && p.hz > f64::max(2.5 / longest, SLOWEST_MODE)
                && p.hz < 0.9 * nyquist
        })
        && e.interference.is_none_or(|p| p.hz > f64::max(2.5 / longest, SLOWEST_TONE))
}

/// Share of the rows that a stop has to touch, and how near to the limit the output has to come, as a share of the output's span.
const TOUCHED: f64 = 0.003;
const NEAR_LIMIT: f64 = 0.05;

/// Whether the output comes to one of the limits and stays there for some rows.
fn stops_something(samples: &Samples, trial: &Trial, p: &SaturationParams) -> bool {
    let zero = trial.fit.zeros.iter().sum::<f64>() / trial.fit.zeros.len().max(1) as f64;
    let near = NEAR_LIMIT * samples.output_span();
    let settled = || samples.output.iter().zip(&samples.settling).filter(|(_, s)| !**s).map(|(y, _)| y - zero);
    let touched = settled().filter(|y| (p.high - y).min(y - p.low) < near).count();
    p.knee < 0.2 && touched as f64 > TOUCHED * settled().count() as f64
}
