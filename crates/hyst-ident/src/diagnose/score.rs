//! Decides whether the gain of an effect is significant and large enough.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use hyst_core::{RateLaw, RateParams, ResonanceParams, SaturationParams};

use super::tone::is_sensor_tone;
use super::trial::Trial;
use crate::Samples;
use crate::criteria::{
    DOMINANT_SHARE, HALF, LAW_ACCURACY, MAX_KNEE, MAX_MODE_DAMPING, MAX_SHARP_KNEE, MAX_STOP_DISTANCE,
    MIN_BETTER_DRAWS, MIN_CONFIDENCE, MIN_DRIFT_TIME, MIN_MODE_HZ, MIN_NOISE_FLOORS, MIN_RMSE_DROP, MIN_RMSE_RATIO,
    MIN_STOP_ROWS, MIN_TONE_HZ, MIN_VARIANCE_SHARE, MINOR_SHARE,
};
use crate::nested::{Fitted, Problem, ends_at_a_bound, shown_motion};
use crate::settle::windows;
use crate::statistics::range;

/// Number of bootstrap draws.
pub(super) const DRAWS: usize = 1000;
/// Periods in which a mode must still ring to 1/e of its amplitude, if it does not turn the phase.
const RINGING_PERIODS: f64 = 3.0;
/// Number of consecutive blocks that are drawn together.
const BLOCKS_PER_RUN: usize = 4;

/// Relative accuracy of the frequency of a loop.
const LOOP_FREQUENCY_TOLERANCE: f64 = 0.002;

/// Judgement of an effect.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Judgement {
    /// Share of bootstrap draws in which the cross-validated error falls.
    pub(crate) confidence: f64,
    /// Cross-validated RMSE after divided by before.
    pub(crate) ratio: f64,
    /// Share of the variance above the noise floor that the effect explains.
    pub(crate) share: f64,
    /// RMS of the effect's contribution, in noise floors.
    pub(crate) over_noise: f64,
    /// Whether its parameters are physically plausible and inside their bounds (except the gain of a ringing mode).
    pub(crate) sensible: bool,
    /// Whether the effect explains too little, but is a tone that neither the drive nor a misfit causes.
    pub(crate) sensor_tone: bool,
}

impl Judgement {
    pub(crate) fn accepted(&self) -> bool {
        self.is_sure() && (self.sensor_tone || self.explains())
    }

    /// Returns whether the effect is accepted for what it explains, not only as a prominent tone.
    pub(crate) fn explains_enough(&self) -> bool {
        self.is_sure() && self.explains()
    }

    /// Returns whether the effect helps in nearly every part of the record and exceeds the noise, however little it
    /// explains.
    pub(crate) fn is_sure(&self) -> bool {
        self.sensible && self.confidence >= MIN_CONFIDENCE && self.over_noise >= MIN_NOISE_FLOORS
    }

    fn explains(&self) -> bool {
        self.ratio <= 1.0 - MIN_RMSE_DROP && self.share >= MIN_VARIANCE_SHARE
    }
}

/// Returns the gain in Σ residual² at which an effect is accepted, if `left` remains with it over `rows` rows. Combines
/// the thresholds of [`Judgement`].
pub(super) fn least_gain(rows: f64, left: f64, noise: f64) -> f64 {
    let floor = rows * noise * noise;
    let of_fall = left * (1.0 / (1.0 - MIN_RMSE_DROP).powi(2) - 1.0);
    let of_share = (left - floor).max(0.0) * MIN_VARIANCE_SHARE / (1.0 - MIN_VARIANCE_SHARE);
    (MIN_NOISE_FLOORS * MIN_NOISE_FLOORS * floor).max(of_fall).max(of_share)
}

/// Returns the gain at which an effect may be accepted, if Σ residual² is `before` without it.
pub(super) fn least_gain_from(rows: f64, before: f64, noise: f64) -> f64 {
    let floor = rows * noise * noise;
    let of_fall = before * (1.0 - (1.0 - MIN_RMSE_DROP).powi(2));
    let of_share = (before - floor).max(0.0) * MIN_VARIANCE_SHARE;
    (MIN_NOISE_FLOORS * MIN_NOISE_FLOORS * floor).max(of_fall.min(of_share))
}

/// Judges `with` against `without`, by the weaker of the cross-validated and the fitted gain. Where a part of the
/// record shows something that no other part does, leaving that part out says more about the gap than about the effect.
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
        sensor_tone: false,
    };
    let is_new_tone = without.fit.hypothesis.effects.interference.is_none();
    let sensor_tone = is_new_tone && judged.is_sure() && !judged.explains() && is_sensor_tone(problem, with);
    Judgement { sensor_tone, ..judged }
}

/// Returns the fall of the error of each block.
fn differences(without: &Trial, with: &Trial) -> Vec<f64> {
    without.blocks.iter().zip(&with.blocks).map(|(a, b)| a - b).collect()
}

/// Returns whether the second predicts clearly better than the first: in nearly every bootstrap draw.
pub(super) fn clearly_better(first: &Trial, second: &Trial, seed: u64) -> bool {
    share_above_zero(&differences(first, second), seed) >= MIN_BETTER_DRAWS
}

/// Returns whether the second predicts better by the margin that an effect needs.
pub(super) fn is_worth(first: &Trial, second: &Trial) -> bool {
    second.cv_rmse() <= (1.0 - MIN_RMSE_DROP) * first.cv_rmse()
}

/// Returns whether the second predicts so much better that it is needed even with uncertain parameters.
pub(super) fn is_far_better(first: &Trial, second: &Trial) -> bool {
    first.cv_rmse() > MIN_RMSE_RATIO * second.cv_rmse()
}

/// Returns whether one set explains nearly all that another explains of the residual without either (Σ residual²).
pub(super) fn explains_nearly_all(without: f64, one: f64, other: f64) -> bool {
    without - one >= DOMINANT_SHARE * (without - other)
}

/// Returns whether neither predicts clearly better than the other.
pub(super) fn undecided(a: &Trial, b: &Trial, seed: u64) -> bool {
    let apart = (a.cv_rmse() / b.cv_rmse()).ln().abs() > MIN_RMSE_RATIO.ln();
    !apart && !clearly_better(a, b, seed) && !clearly_better(b, a, seed)
}

/// Returns the share of block-bootstrap draws with a positive sum; a sum that is negative by a small part of the total
/// counts too. Runs of neighbouring blocks are drawn together, because slow errors correlate between neighbours.
fn share_above_zero(differences: &[f64], seed: u64) -> f64 {
    let n = differences.len();
    if n == 0 {
        return 0.0;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || {
        let runs = n.div_ceil(BLOCKS_PER_RUN);
        let sum_of = |first: usize| (first..first + BLOCKS_PER_RUN).map(|b| differences[b % n]).sum::<f64>();
        (0..runs).map(|_| sum_of(rng.random_range(0..n))).sum::<f64>()
    };
    let least = -MINOR_SHARE * differences.iter().sum::<f64>().max(0.0);
    let above = (0..DRAWS).filter(|_| draw() > least).count();
    above as f64 / DRAWS as f64
}

/// Returns whether the parameters of all effects are physically plausible and inside the bounds of the search.
pub(super) fn sensible(problem: &Problem<'_>, trial: &Trial) -> bool {
    let samples = problem.samples;
    let e = &trial.fit.hypothesis.effects;
    let (longest, nyquist) = (samples.longest_segment(), 0.5 / samples.period);
    // The law of a drag is not exact: a delay of a fraction of a sample is then the misfit of that law.
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
        && e.saturation.is_none_or(|p| has_sharp_limit(samples, &trial.fit, &p))
        && e.creep.as_ref().is_none_or(|p| p.total() > 0.0 && p.total() < HALF)
        && e.resonances.iter().all(|p| {
            rings(p, longest)
                && p.damping < MAX_MODE_DAMPING
                && p.hz > f64::max(2.5 / longest, MIN_MODE_HZ)
                && p.hz < 0.9 * nyquist
        })
        && e.interference.is_none_or(|p| p.hz > f64::max(2.5 / longest, MIN_TONE_HZ) && !is_harmonic(problem, p.hz))
}

/// Returns whether a rate law is that of a first-order lag, u − v = τ v̇, or its expansion, v = u − τ u̇.
fn is_lag(p: &RateParams) -> bool {
    p.law != RateLaw::Holds && (1.0 - p.exponent).abs() < LAW_ACCURACY
}

/// Returns whether a settling process with this time constant \[s\] outlasts the unknown memory from before the record.
/// The unknown start settles too, until the drive has erased it.
fn outlasts_the_start(samples: &Samples, seconds: f64) -> bool {
    let begins_at_rest = samples.pasts.first().is_none_or(Vec::is_empty);
    let rows = windows(samples).first().copied().unwrap_or(0);
    begins_at_rest || seconds > rows as f64 * samples.period_of(0)
}

/// Returns whether a mode rings: its free oscillation lasts some periods, or its own part at its frequency, g/(2ζ),
/// exceeds the part of the motion beside it, 1 − g, so that it turns the phase. A smaller ripple may be the misfit of
/// another law. A mode that does not decay within the record may be a harmonic of the drive.
fn rings(mode: &ResonanceParams, longest: f64) -> bool {
    let turns_the_phase = mode.gain >= (1.0 - mode.gain) * 2.0 * mode.damping;
    let decays = std::f64::consts::TAU * mode.hz * mode.damping * longest >= 1.0;
    mode.gain > 0.0 && decays && (turns_the_phase || mode.damping < 1.0 / (std::f64::consts::TAU * RINGING_PERIODS))
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

/// Returns whether the output reaches one of the limits and stays there for some rows.
fn has_sharp_limit(samples: &Samples, fit: &Fitted, p: &SaturationParams) -> bool {
    p.knee < MAX_SHARP_KNEE && is_close_to_limit(samples, fit, p, 0.0)
}

/// Returns whether the output comes so close to a limit that it follows the motion by less than half, for some rows. A
/// soft limit counts on a base that does not bend by itself.
pub(super) fn has_soft_limit(samples: &Samples, fit: &Fitted, p: &SaturationParams) -> bool {
    // In a knee of width w the slope is 1 − x² at the fraction x of it.
    let halved = (1.0 - 0.5f64.sqrt()) * p.knee * (p.high - p.low);
    p.knee < MAX_KNEE && is_close_to_limit(samples, fit, p, halved)
}

/// Returns whether some rows are closer to a limit than a share of the motion's span, or than `least` \[y\].
fn is_close_to_limit(samples: &Samples, fit: &Fitted, p: &SaturationParams, least: f64) -> bool {
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
    fn a_strong_effect_does_not_count_as_explaining_another() {
        // Of a residual of 1000 a creep leaves 50, and a zero wander in addition leaves 10: the creep explains nothing
        // of the wander's part.
        assert!(!explains_nearly_all(50.0, 50.0, 10.0));
        // From a residual of 1000, three effects explain what the wander explained.
        assert!(explains_nearly_all(1000.0, 12.0, 10.0));
    }

    #[test]
    fn a_tone_two_spectral_lines_from_a_harmonic_is_no_harmonic() {
        // A loop of 2 Hz over 4 s has lines of 0.25 Hz; its frequency is known to 0.2 %.
        assert!(is_multiple(10.0, 2.0, 4.0) && is_multiple(10.2, 2.0, 4.0));
        assert!(!is_multiple(10.5, 2.0, 4.0) && !is_multiple(9.5, 2.0, 4.0));
    }

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
