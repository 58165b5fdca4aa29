//! Whether an effect's gain is real and matters.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use hyst_core::{RateLaw, RateParams, ResonanceParams, SaturationParams};

use super::tone::stands_alone;
use super::trial::Trial;
use crate::Samples;
use crate::criteria::{
    HALF, LAW_ACCURACY, MAX_KNEE, MAX_MODE_DAMPING, MAX_SHARP_KNEE, MAX_STOP_DISTANCE, MIN_BETTER_DRAWS,
    MIN_CONFIDENCE, MIN_DRIFT_TIME, MIN_MODE_HZ, MIN_NOISE_FLOORS, MIN_RMSE_DROP, MIN_RMSE_RATIO, MIN_STOP_ROWS,
    MIN_TONE_HZ, MIN_VARIANCE_SHARE, MINOR_SHARE,
};
use crate::nested::{Fitted, Problem, ends_at_a_bound, shown_motion};
use crate::samples::range;
use crate::settle::windows;

/// Bootstrap draws.
pub(super) const DRAWS: usize = 1000;
/// Periods that a mode has to ring until 1/e of it is left, where nothing shows that it turns the phase.
const RINGING_PERIODS: f64 = 3.0;
/// Blocks that are drawn together.
const RUN: usize = 4;

/// How exactly the frequency of a loop is known, as a share.
const HARMONIC: f64 = 0.002;

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
    /// Whether its parameters are physically sensible and away from their bounds, but for what a mode that rings carries.
    pub(crate) sensible: bool,
    /// Whether it explains too little, but is a tone that neither the drive nor a misfit makes.
    pub(crate) alone: bool,
}

impl Judgement {
    pub(crate) fn accepted(&self) -> bool {
        self.is_sure() && (self.alone || self.explains())
    }

    /// Accepted for what it explains, not for standing alone.
    pub(crate) fn explains_enough(&self) -> bool {
        self.is_sure() && self.explains()
    }

    /// Whether it helps in nearly every part of the record and stands above the noise, however little of what is left it explains.
    pub(crate) fn is_sure(&self) -> bool {
        self.sensible && self.confidence >= MIN_CONFIDENCE && self.over_noise >= MIN_NOISE_FLOORS
    }

    fn explains(&self) -> bool {
        self.ratio <= 1.0 - MIN_RMSE_DROP && self.share >= MIN_VARIANCE_SHARE
    }
}

/// Gain in Σ residual² from which on an effect is accepted that leaves this much of it over `rows` rows: what the thresholds of
/// [`Judgement`] come to.
pub(super) fn least_gain(rows: f64, left: f64, noise: f64) -> f64 {
    let floor = rows * noise * noise;
    let of_fall = left * (1.0 / (1.0 - MIN_RMSE_DROP).powi(2) - 1.0);
    let of_share = (left - floor).max(0.0) * MIN_VARIANCE_SHARE / (1.0 - MIN_VARIANCE_SHARE);
    (MIN_NOISE_FLOORS * MIN_NOISE_FLOORS * floor).max(of_fall).max(of_share)
}

/// Gain from which on an effect may be accepted beside a fit that leaves this much of Σ residual² without it.
pub(super) fn least_gain_from(rows: f64, before: f64, noise: f64) -> f64 {
    let floor = rows * noise * noise;
    let of_fall = before * (1.0 - (1.0 - MIN_RMSE_DROP).powi(2));
    let of_share = (before - floor).max(0.0) * MIN_VARIANCE_SHARE;
    (MIN_NOISE_FLOORS * MIN_NOISE_FLOORS * floor).max(of_fall.min(of_share))
}

/// How `with` stands against `without`, by the weaker of what it predicts and what it fits: where a part of the record shows what no
/// other part does, leaving that part out says more about the gap than about the effect.
pub(crate) fn judge(problem: &Problem<'_>, without: &Trial, with: &Trial, noise: f64, seed: u64) -> Judgement {
    let rows = with.fit.rows.max(1) as f64;
    let gain_of = |before: f64, after: f64| {
        let gain = (before - after).max(0.0);
        let above = (before - rows * noise * noise).max(f64::MIN_POSITIVE);
        let ratio = (after / before.max(f64::MIN_POSITIVE)).sqrt();
        (ratio, gain / above, (gain / rows).sqrt() / noise.max(f64::MIN_POSITIVE))
    };
    let predicted = gain_of(without.total(), with.total());
    let fitted = gain_of(without.fit.squares, with.fit.squares);
    let judged = Judgement {
        confidence: share_above_zero(&differences(without, with), seed),
        ratio: predicted.0.max(fitted.0),
        share: predicted.1.min(fitted.1),
        over_noise: predicted.2.min(fitted.2),
        sensible: sensible(problem, with),
        alone: false,
    };
    let is_new_tone = without.fit.hypothesis.effects.interference.is_none();
    let alone = is_new_tone && judged.is_sure() && !judged.explains() && stands_alone(problem, with);
    Judgement { alone, ..judged }
}

/// What `with` takes of the error of each block.
fn differences(without: &Trial, with: &Trial) -> Vec<f64> {
    without.blocks.iter().zip(&with.blocks).map(|(a, b)| a - b).collect()
}

/// Whether the second predicts clearly better than the first: in nearly every bootstrap draw.
pub(super) fn clearly_better(first: &Trial, second: &Trial, seed: u64) -> bool {
    share_above_zero(&differences(first, second), seed) >= MIN_BETTER_DRAWS
}

/// Whether the second predicts better by as much as an effect has to.
pub(super) fn is_worth(first: &Trial, second: &Trial) -> bool {
    second.cv_rmse() <= (1.0 - MIN_RMSE_DROP) * first.cv_rmse()
}

/// Whether the second predicts so much better that it is needed, however little its parameters are known.
pub(super) fn is_far_better(first: &Trial, second: &Trial) -> bool {
    first.cv_rmse() > MIN_RMSE_RATIO * second.cv_rmse()
}

/// Whether neither predicts clearly better than the other.
pub(super) fn undecided(a: &Trial, b: &Trial, seed: u64) -> bool {
    let apart = (a.cv_rmse() / b.cv_rmse()).ln().abs() > MIN_RMSE_RATIO.ln();
    !apart && !clearly_better(a, b, seed) && !clearly_better(b, a, seed)
}

/// Share of block-bootstrap draws whose sum is above zero, or below it by next to nothing of the whole. Runs of blocks are drawn: neighbours share what is slow.
fn share_above_zero(differences: &[f64], seed: u64) -> f64 {
    let n = differences.len();
    if n == 0 {
        return 0.0;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || {
        let runs = n.div_ceil(RUN);
        let sum_of = |first: usize| (first..first + RUN).map(|b| differences[b % n]).sum::<f64>();
        (0..runs).map(|_| sum_of(rng.random_range(0..n))).sum::<f64>()
    };
    let least = -MINOR_SHARE * differences.iter().sum::<f64>().max(0.0);
    let above = (0..DRAWS).filter(|_| draw() > least).count();
    above as f64 / DRAWS as f64
}

/// Whether every effect's parameters are physically sensible and away from the bounds of the search.
pub(super) fn sensible(problem: &Problem<'_>, trial: &Trial) -> bool {
    let samples = problem.samples;
    let e = &trial.fit.hypothesis.effects;
    let (longest, nyquist) = (samples.longest_segment(), 0.5 / samples.period);
    // No law of a drag is the device's to the last digit: what is late by a part of a sample then is the law's own misfit.
    let least = if trial.fit.hypothesis.drag.is_some() { 0.3 } else { 0.02 };
    let time = |seconds: f64| seconds > least * samples.period;
    !ends_at_a_bound(&trial.fit.hypothesis, samples)
        && e.delay.is_none_or(|p| time(p.seconds))
        && e.lag.is_none_or(|p| time(p.seconds))
        && e.rate.is_none_or(|p| p.volts > 0.0 && !is_lag(&p))
        && trial.fit.hypothesis.drag.is_none_or(|p| p.volt_seconds > 0.0 || p.seconds > 0.02 * samples.period)
        && e.drift.is_none_or(|p| {
            p.seconds == 0.0
                || p.seconds > MIN_DRIFT_TIME * samples.duration() && outlasts_the_start(samples, p.seconds)
        })
        && e.saturation.is_none_or(|p| stops_something(samples, &trial.fit, &p))
        && e.temperature.is_none_or(|p| p.per_kelvin.abs() < 0.049)
        && e.creep.as_ref().is_none_or(|p| p.total() > 0.0 && p.total() < HALF)
        && e.resonances.iter().all(|p| {
            rings(p, longest)
                && p.damping < MAX_MODE_DAMPING
                && p.hz > f64::max(2.5 / longest, MIN_MODE_HZ)
                && p.hz < 0.9 * nyquist
        })
        && e.interference.is_none_or(|p| p.hz > f64::max(2.5 / longest, MIN_TONE_HZ) && !is_harmonic(problem, p.hz))
}

/// Whether a law of the rate is that of a first-order lag, u − v = τ v̇, or its expansion, v = u − τ u̇.
fn is_lag(p: &RateParams) -> bool {
    p.law != RateLaw::Holds && (1.0 - p.exponent).abs() < LAW_ACCURACY
}

/// Whether what settles with a time constant \[s\] is still seen once the drive has wiped out what the actuator remembered from before the record: within that
/// time an unknown start settles too.
fn outlasts_the_start(samples: &Samples, seconds: f64) -> bool {
    let begins_at_rest = samples.pasts.first().is_none_or(Vec::is_empty);
    let rows = windows(samples).first().copied().unwrap_or(0);
    begins_at_rest || seconds > rows as f64 * samples.period_of(0)
}

/// Whether a mode rings: by itself it goes on for some periods, or its own part at its frequency, g/(2ζ), exceeds the part of the motion that does
/// not go through it, 1 − g, so that the phase turns. What only ripples the motion there is the misfit of another law as well. What does not
/// decay within the record may as well be a harmonic of the drive.
fn rings(mode: &ResonanceParams, longest: f64) -> bool {
    let turns_the_phase = mode.gain >= (1.0 - mode.gain) * 2.0 * mode.damping;
    let decays = std::f64::consts::TAU * mode.hz * mode.damping * longest >= 1.0;
    mode.gain > 0.0 && decays && (turns_the_phase || mode.damping < 1.0 / (std::f64::consts::TAU * RINGING_PERIODS))
}

/// Whether a tone is a harmonic of the one loop that a record repeats: then it may as well be the loop's shape.
fn is_harmonic(problem: &Problem<'_>, hz: f64) -> bool {
    problem.only_loop.is_some_and(|first| is_multiple(hz, first, problem.samples.duration()))
}

/// Whether a frequency \[Hz\] is a multiple of a first one, as far as a record of some seconds shows it.
fn is_multiple(hz: f64, first: f64, seconds: f64) -> bool {
    // Over the record its phase then turns by less than once against the loop.
    (hz - first * (hz / first).round()).abs() < 1.0 / seconds + HARMONIC * hz
}

/// Whether the output comes to one of the limits and stays there for some rows.
fn stops_something(samples: &Samples, fit: &Fitted, p: &SaturationParams) -> bool {
    p.knee < MAX_SHARP_KNEE && comes_near(samples, fit, p, 0.0)
}

/// Whether it comes so near to one of the limits that it follows the motion by less than half, for some rows: a soft stop does, where the base does
/// not bend in itself.
pub(super) fn halves_something(samples: &Samples, fit: &Fitted, p: &SaturationParams) -> bool {
    // In a knee of width w the slope is 1 − x² at the share x of it.
    let halved = (1.0 - 0.5f64.sqrt()) * p.knee * (p.high - p.low);
    p.knee < MAX_KNEE && comes_near(samples, fit, p, halved)
}

/// Whether some rows are nearer to a limit than a share of the motion's span, or than this \[y\].
fn comes_near(samples: &Samples, fit: &Fitted, p: &SaturationParams, least: f64) -> bool {
    let shown = shown_motion(samples, fit);
    let (low, high) = range(shown.iter().copied());
    let near = least.max(MAX_STOP_DISTANCE * (high - low));
    let touched = shown.iter().filter(|y| (p.high - **y).min(**y - p.low) < near).count();
    touched as f64 > MIN_STOP_ROWS * shown.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tone_two_lines_beside_a_harmonic_is_none() {
        // A loop of 2 Hz over 4 s has lines of 0.25 Hz; its frequency is known to 0.2 %.
        assert!(is_multiple(10.0, 2.0, 4.0) && is_multiple(10.2, 2.0, 4.0));
        assert!(!is_multiple(10.5, 2.0, 4.0) && !is_multiple(9.5, 2.0, 4.0));
    }

    #[test]
    fn a_ripple_of_the_motion_is_no_mode() {
        let rings = |damping: f64, gain: f64| rings(&ResonanceParams { hz: 48.0, damping, gain }, 10.0);
        assert!(!rings(0.062, 0.02) && !rings(0.1, 0.004) && !rings(0.01, 0.0));
        // Lightly damped modes that carry little, a mode beside a stiff part, and one that carries all and hardly rings.
        assert!(rings(0.02, 0.01) && rings(0.01, 0.05) && rings(0.05, 0.4) && rings(0.3, 1.0));
        // What does not decay in the record.
        assert!(!rings(1e-4, 0.6));
    }
}
