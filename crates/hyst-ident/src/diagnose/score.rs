//! Decides whether the gain of an effect is significant and large enough.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::effects;
use super::tone::is_sensor_tone;
use super::trial::Trial;
use crate::criteria::{
    DOMINANT_SHARE, MIN_BETTER_DRAWS, MIN_CONFIDENCE, MIN_NOISE_FLOORS, MIN_RMSE_DROP, MIN_RMSE_RATIO,
    MIN_VARIANCE_SHARE, MINOR_SHARE,
};
use crate::model::Effect;
use crate::nested::{Problem, ends_at_a_bound};

/// Number of bootstrap draws.
pub(super) const DRAWS: usize = 1000;
/// Number of consecutive blocks that are drawn together.
const BLOCKS_PER_RUN: usize = 4;

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
    !ends_at_a_bound(&trial.fit.hypothesis, problem.samples)
        && Effect::ALL.into_iter().all(|effect| effects::of(effect).is_plausible(problem, &trial.fit))
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
}
