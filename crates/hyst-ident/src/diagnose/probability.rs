//! Probability that a name is right.
//!
//! A logistic regression on four features of a name: its size in noise floors, the margin over the next best name, the
//! remaining error in noise floors, and the fall of the error. The coefficients are fitted to 185 names on 176
//! simulated actuators of seven hysteresis laws (`cargo run --release -p hyst-tests --example reliability -- 176 1
//! --fit`). Without `--fit` the example prints the calibration error of the coefficients in use.

use serde::{Deserialize, Serialize};

use super::score::Judgement;
use crate::model::Effect;

/// Minimum probability of a named effect.
pub(super) const NAMED: f64 = 0.9;
/// Minimum probability of a suspect.
pub(super) const SUSPECTED: f64 = 0.5;

/// Constant and slopes of the log odds, in the order of [`Evidence::features`].
const LOG_ODDS: [f64; 5] = [1.9, 3.1, 3.7, -2.8, -3.1];

/// A name or a candidate, with the features of its probability.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weighed {
    /// The effect.
    pub effect: Effect,
    /// Whether it was named.
    pub named: bool,
    /// Logarithms of four ratios.
    /// They are the size in noise floors, the margin over the next best name, the final error in noise floors, and the
    /// fall of the error.
    pub features: [f64; 4],
}

impl Weighed {
    pub(super) fn of(effect: Effect, named: bool, evidence: &Evidence) -> Self {
        Self { effect, named, features: evidence.features() }
    }

    /// Returns the probability that the effect is present.
    pub fn probability(&self) -> f64 {
        probability(self.features)
    }
}

/// Returns the probability of a name with these features.
fn probability(features: [f64; 4]) -> f64 {
    let [constant, slopes @ ..] = LOG_ODDS;
    let odds = slopes.iter().zip(features).fold(constant, |sum, (slope, x)| sum + slope * x);
    1.0 / (1.0 + (-odds).exp())
}

/// Evidence for a name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    pub(crate) judgement: Judgement,
    /// Cross-validated error with the next best name, divided by that with this name.
    pub(crate) next_best: f64,
    /// Cross-validated error on the basis of the search with all effects found, in noise floors.
    pub(crate) left: f64,
}

impl Evidence {
    /// Returns the logarithms of: the size in noise floors, the margin over the next best name, the final error in
    /// noise floors, and the fall of the error.
    pub(crate) fn features(&self) -> [f64; 4] {
        let log = |x: f64, most: f64| x.max(1e-3).ln().clamp(-most, most);
        [
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
