//! How probable it is that a name is right.
//!
//! A logistic regression on what the search knows of a name: how far it stands above the noise, how much worse the next best name does, how
//! much of the residual the search leaves, and by how much the error falls. The coefficients are fitted to 185 names on 176 simulated actuators of
//! seven hysteresis laws (`cargo run --release -p hyst-tests --example reliability -- 176 1 --fit`). Without `--fit` the example prints the
//! calibration error of those in use.

use super::score::Judgement;
use crate::model::Effect;

/// Probability from which on a name is given.
pub(super) const NAMED: f64 = 0.9;
/// Probability from which on it is a suspect.
pub(super) const SUSPECTED: f64 = 0.5;

/// Constant and slopes of the log odds, in the order of [`Evidence::features`].
const LOG_ODDS: [f64; 5] = [1.9, 3.1, 3.7, -2.8, -3.1];

/// A name that was given, or that might have been, and what its probability was computed from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighed {
    /// The effect.
    pub effect: Effect,
    /// Whether it was named.
    pub named: bool,
    /// Logarithms of: its size in noise floors, the margin over the next best name, the error that is left in the end in noise floors, and the
    /// fall of the error by it.
    pub features: [f64; 4],
    /// Probability that it acts.
    pub probability: f64,
}

impl Weighed {
    pub(super) fn of(effect: Effect, named: bool, evidence: &Evidence) -> Self {
        Self { effect, named, features: evidence.features(), probability: evidence.probability() }
    }
}

/// What the search knows of a name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    pub(crate) judgement: Judgement,
    /// Error with the next best name over that with this one, both cross-validated.
    pub(crate) next_best: f64,
    /// Cross-validated error that the base of the search leaves with all that was found, in noise floors.
    pub(crate) left: f64,
}

impl Evidence {
    /// Logarithms of: the size in noise floors, the margin over the next best name, the error that is left in noise floors, and the fall of
    /// the error by this name.
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
        let [constant, slopes @ ..] = LOG_ODDS;
        let odds = slopes.iter().zip(self.features()).fold(constant, |sum, (slope, x)| sum + slope * x);
        1.0 / (1.0 + (-odds).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evidence(over_noise: f64, next_best: f64, left: f64) -> Evidence {
        let judgement = Judgement { confidence: 1.0, ratio: 0.5, share: 0.9, over_noise, sensible: true, alone: false };
        Evidence { judgement, next_best, left }
    }

    #[test]
    fn what_stands_higher_and_leaves_less_is_more_probable() {
        let of = |e: Evidence| e.probability();
        assert!(of(evidence(5.0, 2.0, 1.0)) > of(evidence(1.0, 2.0, 1.0)));
        assert!(of(evidence(5.0, 2.0, 1.0)) > of(evidence(5.0, 1.1, 1.0)));
        assert!(of(evidence(5.0, 2.0, 1.0)) > of(evidence(5.0, 2.0, 6.0)));
        // Whatever the figures are, it is a probability.
        for x in [0.0, 1e-9, 1e9, f64::INFINITY] {
            assert!((0.0..=1.0).contains(&of(evidence(x, x, x))), "{x}");
        }
    }
}
