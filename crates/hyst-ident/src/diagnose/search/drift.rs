//! A drift instead of a wandering zero or of a thermal expansion.

use hyst_core::Error;

use super::judge::Judge;
use crate::criteria::MAX_ZERO_STEP;
use crate::diagnose::causes::new_causes;
use crate::diagnose::score;
use crate::diagnose::trial::Trial;
use crate::model::Effect;
use crate::nested::Cause;

const DRIFT: Cause = Cause::Effect(Effect::Drift);

impl Judge<'_> {
    /// Replaces a thermal expansion by a drift, if the drift fits as well: a zero that moves as steadily as the
    /// temperature may also drift. Decided after all other effects are known, since a missing effect hides the
    /// difference.
    pub(super) fn drift_instead_of_expansion(&self, set: &Trial) -> Result<Option<Trial>, Error> {
        let mut still = set.fit.hypothesis.clone();
        let Some(temperature) = still.effects.temperature.as_mut().filter(|p| p.expansion != 0.0) else {
            return Ok(None);
        };
        temperature.expansion = 0.0;
        if !still.has_room(DRIFT) {
            return Ok(None);
        }
        let Some(still) = self.problem.fit(&still)? else { return Ok(None) };
        let drifts = self.trials(&self.scan(&still)?, DRIFT)?;
        Ok(drifts.filter(|drifts| !score::clearly_better(drifts, set, self.seed)))
    }
}

/// Tries a drift instead of a zero wander. A drift that explains nearly all of the wander is named even if its law is
/// not exact, unless the zero jumps beside it: a zero that moves in steps indicates a slipping mount.
pub(super) fn drift_instead_of_wander(
    judge: &Judge<'_>,
    best: &Trial,
    already: &[Cause],
) -> Result<Option<Trial>, Error> {
    let h = &best.fit.hypothesis;
    if !new_causes(h, already).contains(&Cause::ZeroWanders) || h.effects.drift.is_some() {
        return Ok(None);
    }
    let Some(still) = judge.refit(&h.without(Cause::ZeroWanders))? else { return Ok(None) };
    let Some(even) = judge.trials(&judge.scan(&still.fit)?, DRIFT)? else { return Ok(None) };
    let Some(drift) = even.fit.hypothesis.effects.drift else { return Ok(None) };
    let takes_nearly_all = score::explains_nearly_all(still.total(), even.total(), best.total());
    let is_even = follows(&judge.problem.wandered_zero(&best.fit), |time_s| drift.at(time_s));
    Ok((takes_nearly_all && is_even && judge.judge(&still, &even).accepted()).then_some(even))
}

/// Returns whether a wandering zero, given as times and heights, follows a drift without jumps. The first and the last
/// height are those of few rows, perhaps of a start-up, and do not count.
fn follows(zero: &[(f64, f64)], drift: impl Fn(f64) -> f64) -> bool {
    let [_, zero @ .., _] = zero else { return true };
    let way: f64 = zero.windows(2).map(|z| (z[1].1 - z[0].1).abs()).sum();
    let beside = |(time, height): (f64, f64)| height - drift(time);
    zero.windows(3).all(|z| (beside(z[2]) - beside(z[0])).abs() <= MAX_ZERO_STEP * way)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a zero with these heights at these times.
    fn zero(times: impl Iterator<Item = f64>, height: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        times.map(|t| (t, height(t))).collect()
    }

    #[test]
    fn a_settling_zero_follows_a_drift_and_a_slipping_one_does_not() {
        let evenly = || (0..17).map(|k| 2.0 * f64::from(k));
        let settles = |t: f64| 1.0 - (-t / 20.0).exp();
        assert!(follows(&zero(evenly(), settles), settles));
        // A root, and the law that is nearest to it.
        assert!(follows(&zero(evenly(), f64::sqrt), |t| 0.1 * t + 2.4 * (1.0 - (-t / 4.0).exp())));
        let slips = |t: f64| [9.0, 17.0, 25.0].into_iter().filter(|at| t > *at).count() as f64;
        assert!(!follows(&zero(evenly(), slips), |t| 0.125 * (t - 5.0)));
    }

    #[test]
    fn a_zero_may_move_further_over_a_gap() {
        let paused = || (0..17).map(|k| 2.0 * f64::from(k) + if k > 8 { 60.0 } else { 0.0 });
        let line = |t: f64| 0.1 * t;
        assert!(follows(&zero(paused(), line), line));
        assert!(!follows(&zero(paused(), |t| if t > 16.0 { line(t) + 6.0 } else { line(t) }), line));
    }

    #[test]
    fn a_zero_of_few_heights_follows_any_drift() {
        assert!(follows(&[], |_| 0.0));
        assert!(follows(&[(0.0, 1.0), (2.0, 9.0)], |_| 0.0));
    }
}
