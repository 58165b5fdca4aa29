//! Search for the drive history after which a model follows the first rows of a segment.

use rayon::prelude::*;

use super::reversals::{decay, path};
use crate::criteria::{MIN_PAST_RATIO, MIN_RMSE_RATIO, NEGLIGIBLE_SHARE};

/// Number of reversal levels that are tried over the range of the record.
const LEVELS: usize = 13;
/// Number of further levels on either side of the range.
const LEVELS_BEYOND: usize = 6;
/// Number of amplitudes of a decaying drive (demagnetisation).
const DECAY_AMPLITUDES: usize = 6;
/// Number of times that the step of a reversal's level is halved: to 1/1500 of the range.
const HALVINGS: usize = 7;

/// Candidate drive histories of a segment: drives from 0 V that end just before its first voltage.
pub(crate) struct Candidates {
    /// First voltage of the segment \[V\].
    u0: f64,
    /// Distance of two levels \[V\].
    step: f64,
    /// Drives with few reversals: the levels of these \[V\].
    reversals: Vec<Vec<f64>>,
    others: Vec<Vec<f64>>,
}

impl Candidates {
    /// Histories with one or two reversals, and decaying drives.
    pub(crate) fn new(u0: f64, (low, high): (f64, f64)) -> Self {
        let (span, inside) = (high - low, LEVELS - 1);
        let level = |i: usize| low + span * (i as f64 - LEVELS_BEYOND as f64) / inside as f64;
        // Levels outside of the range too: a device driven to one side is poled there, and wide play operators come to
        // rest at any voltage.
        let levels = || (0..LEVELS + 2 * LEVELS_BEYOND).map(level).filter(|u| (u - u0).abs() > 1e-9 * span);
        let mut reversals: Vec<Vec<f64>> = levels().map(|u| vec![u]).collect();
        // Two reversals on the same side of `u0` wipe each other out.
        for first in levels() {
            let opposite = levels().filter(|second| (second - u0) * (first - u0) < 0.0);
            reversals.extend(opposite.map(|second| vec![first, second]));
        }
        let amplitude = |i: usize| span * i as f64 / DECAY_AMPLITUDES as f64;
        let others = (1..=DECAY_AMPLITUDES).map(|i| decay(u0, amplitude(i))).collect();
        Self { u0, step: span / inside as f64, reversals, others }
    }

    /// Adds another history.
    pub(crate) fn add(&mut self, past: Vec<f64>) {
        self.others.push(past);
    }

    /// Returns the history with the smallest Σ residual² of the first rows (`squares`); empty if none explains them.
    /// The error above `level`, the Σ residual² of as many other rows, must fall by [`MIN_PAST_RATIO`]. Near 0 V a
    /// memory of rest and a sensor transient are plausible too. There the history must explain all but a
    /// [`NEGLIGIBLE_SHARE`] of the error, or the error must fall to that of other rows: a cycled actuator keeps a
    /// remanence at 0 V, and no sensor transient has the shape of a loop.
    pub(crate) fn best(&self, level: f64, away: bool, squares: impl Fn(&[f64]) -> f64 + Sync) -> Vec<f64> {
        let from_rest = squares(&[]);
        let stands_out = MIN_RMSE_RATIO * MIN_RMSE_RATIO * level;
        if from_rest < stands_out {
            return Vec::new();
        }
        let with_reversals: Vec<f64> =
            self.reversals.par_iter().map(|levels| squares(&path(levels, self.u0))).collect();
        let with_others: Vec<f64> = self.others.par_iter().map(|past| squares(past)).collect();
        let least = |all: &[f64]| all.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let refined =
            least(&with_reversals).map(|(at, error)| self.refined(self.reversals[at].clone(), error, &squares));
        let other = least(&with_others).map(|(at, error)| (self.others[at].clone(), error));
        let best = refined.into_iter().chain(other).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((past, least)) = best.filter(|(_, least)| *least < f64::INFINITY) else { return Vec::new() };
        let helps = MIN_PAST_RATIO * MIN_PAST_RATIO * (least - level).max(0.0) < from_rest - level;
        let explains_all = least - level <= NEGLIGIBLE_SHARE * (from_rest - level);
        if helps && (away || explains_all || least < stands_out) { past } else { Vec::new() }
    }

    /// Moves each reversal to the level with the smallest error, in steps that are halved. Returns the history and its
    /// error.
    fn refined(&self, mut reversals: Vec<f64>, mut least: f64, squares: &impl Fn(&[f64]) -> f64) -> (Vec<f64>, f64) {
        let mut step = self.step;
        for _ in 0..HALVINGS {
            step /= 2.0;
            for at in 0..reversals.len() {
                for by in [-step, step] {
                    let mut moved = reversals.clone();
                    moved[at] += by;
                    let error = squares(&path(&moved, self.u0));
                    if error < least {
                        (reversals, least) = (moved, error);
                        break;
                    }
                }
            }
        }
        (path(&reversals, self.u0), least)
    }
}

#[cfg(test)]
mod tests {
    use super::super::reversals::ROWS_PER_REVERSAL;
    use super::*;

    #[test]
    fn a_drive_history_near_rest_has_to_explain_the_whole_error() {
        let near = Candidates { u0: 0.0, step: 0.0, reversals: Vec::new(), others: vec![vec![1.0], vec![2.0]] };
        let squares = |past: &[f64]| match past.first() {
            None => 100.0,
            Some(past) if *past == 1.0 => 9.0,
            Some(_) => 40.0,
        };
        assert_eq!(near.best(1.0, true, squares), [1.0]);
        assert!(near.best(1.0, false, squares).is_empty(), "nine times the level");
        assert_eq!(near.best(8.0, false, squares), [1.0]);
        assert!(near.best(60.0, true, squares).is_empty(), "the first rows have no larger error");
    }

    #[test]
    fn a_reversal_between_two_levels_is_found() {
        let candidates = Candidates::new(10.0, (0.0, 120.0));
        let squares = |past: &[f64]| {
            let levels: Vec<f64> = past.iter().skip(ROWS_PER_REVERSAL).step_by(ROWS_PER_REVERSAL).copied().collect();
            if let [first, second] = levels[..] { (first - 77.3).powi(2) + (second + 21.9).powi(2) } else { 1e4 }
        };
        let past = candidates.best(1e-3, false, squares);
        let (first, second) = (past[ROWS_PER_REVERSAL], past[2 * ROWS_PER_REVERSAL]);
        assert!((first - 77.3).abs() < 0.1 && (second + 21.9).abs() < 0.1, "{past:?}");
    }
}
