//! Probability that a name is right.
//!
//! A logistic regression on features of a name: whether the search accepts it, its size in noise floors, the margin
//! over the next best name, the remaining error in noise floors, and the fall of the error. A name is right if the
//! effect acts, or one that the record cannot distinguish from it. The coefficients are fitted to simulated actuators of
//! seven hysteresis laws (`cargo run --release -p hyst-tests --example reliability -- 150 2 --rows 1250 --fit`). Without
//! `--fit` the example prints the calibration error of the coefficients in use.

use serde::{Deserialize, Serialize};

use super::score::Judgement;
use crate::model::Effect;

/// Probability below which an effect that is not named is a suspect.
pub(super) const NAMED: f64 = 0.9;
/// Minimum probability of a suspect, and of a name.
pub(super) const SUSPECTED: f64 = 0.5;

/// Constant and slopes of the log odds, in the order of [`Evidence::features`].
const LOG_ODDS: [f64; FEATURES + 1] = [-0.983, 1.771, 2.033, 1.942, -1.807, 0.916];

/// Number of features of a name.
pub const FEATURES: usize = 5;

/// A name or a candidate, with the features of its probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weighed {
    /// The effect.
    pub effect: Effect,
    /// Effects that the record cannot distinguish from it.
    pub ties: Vec<Effect>,
    /// Whether it was named.
    pub named: bool,
    /// Whether the search accepts it (1 or 0), and the logarithms of four ratios: the size in noise floors, the margin
    /// over the next best name, the final error in noise floors, and the fall of the error.
    pub features: [f64; FEATURES],
}

impl Weighed {
    pub(super) fn of(effect: Effect, ties: Vec<Effect>, named: bool, evidence: &Evidence) -> Self {
        Self { effect, ties, named, features: evidence.features() }
    }

    /// Returns the probability that the name is right.
    pub fn probability(&self) -> f64 {
        probability(self.features)
    }

    /// Returns whether the name is right for a device with these effects.
    pub fn is_right(&self, effects: &[Effect]) -> bool {
        effects.contains(&self.effect) || self.ties.iter().any(|tie| effects.contains(tie))
    }
}

/// Returns the probability of a name with these features.
fn probability(features: [f64; FEATURES]) -> f64 {
    let [constant, slopes @ ..] = LOG_ODDS;
    let odds = slopes.iter().zip(features).fold(constant, |sum, (slope, x)| sum + slope * x);
    1.0 / (1.0 + (-odds).exp())
}

/// Evidence for a name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    pub(crate) judgement: Judgement,
    /// Cross-validated error with the next best name that the record can distinguish, divided by that with this name.
    pub(crate) next_best: f64,
    /// Cross-validated error on the basis of the search with all effects found, in noise floors.
    pub(crate) left: f64,
}

impl Evidence {
    /// Returns whether the search accepts the name (1 or 0), and the logarithms of: the size in noise floors, the margin
    /// over the next best name, the final error in noise floors, and the fall of the error.
    pub(crate) fn features(&self) -> [f64; FEATURES] {
        let log = |x: f64, most: f64| x.max(1e-3).ln().clamp(-most, most);
        [
            if self.judgement.accepted() { 1.0 } else { 0.0 },
            log(self.judgement.over_noise, 4.0),
            log(self.next_best, 1.0),
            log(self.left, 3.0),
            -log(self.judgement.ratio, 3.0),
        ]
    }

    pub(crate) fn probability(&self) -> f64 {
        probability(self.features())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evidence(over_noise: f64, next_best: f64, left: f64) -> Evidence {
        let judgement =
            Judgement { confidence: 1.0, ratio: 0.5, share: 0.9, over_noise, sensible: true, sensor_tone: false };
        Evidence { judgement, next_best, left }
    }

    #[test]
    fn a_tie_is_right_if_one_of_its_names_is() {
        let features = evidence(5.0, 2.0, 1.0).features();
        let name = Weighed { effect: Effect::Lag, ties: vec![Effect::Delay], named: true, features };
        assert!(name.is_right(&[Effect::Lag]) && name.is_right(&[Effect::Creep, Effect::Delay]));
        assert!(!name.is_right(&[Effect::Creep]) && !name.is_right(&[]));
    }

    #[test]
    fn a_larger_effect_with_a_smaller_final_error_is_more_probable() {
        let of = |e: Evidence| e.probability();
        assert!(of(evidence(5.0, 2.0, 1.0)) > of(evidence(1.0, 2.0, 1.0)));
        assert!(of(evidence(5.0, 2.0, 1.0)) > of(evidence(5.0, 1.1, 1.0)));
        assert!(of(evidence(5.0, 2.0, 1.0)) > of(evidence(5.0, 2.0, 6.0)));
        // The result is a probability for all inputs.
        for x in [0.0, 1e-9, 1e9, f64::INFINITY] {
            assert!((0.0..=1.0).contains(&of(evidence(x, x, x))), "{x}");
        }
    }
}
