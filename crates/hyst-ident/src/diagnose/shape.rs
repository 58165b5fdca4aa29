//! Whether the user's own base lacks a curve behind or before it: asymmetry, or a stop.
//!
//! The search runs on a rich base that bends in itself, so that a coarse base is not taken for an effect. Here the own base is asked: if
//! one curve without memory takes most of what separates it from the rich one, that curve is its name; if not, what is
//! missing has memory, and the base is too coarse.

use hyst_core::{AsymmetryParams, CurveSide, Error, MAX_DEAD_ZONES};

use super::search::{Instead, Named};
use super::trial::Trial;
use super::{score, starts};
use crate::criteria::{
    DOMINANT_SHARE, MAX_NOISE_FLOORS, MIN_BEND_DIFFERENCE, MIN_RMSE_DROP, MIN_RMSE_RATIO, NEGLIGIBLE_SHARE, WHOLE_SHARE,
};
use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Problem, dead_zone};

/// Error of the own base with a curve over that of the rich one up to which the curve is all that was missing.
pub(super) const CLOSED: f64 = MIN_RMSE_RATIO * MIN_RMSE_RATIO;
/// The same where the plays of the own base have been chosen anew behind the curve: little else is then left to be missing.
pub(super) const CLOSED_ANEW: f64 = MIN_RMSE_RATIO;
/// Points at which the two halves of a curve are compared.
const POINTS: usize = 64;
/// How often the dead zones of a curve are placed anew at most, where the operator goes with the one before.
const PLACINGS: usize = 6;
/// Ends of the curve: share of the motion's range beyond the outermost dead zone.
const MARGIN: f64 = 0.08;

/// What the own base was found to lack.
pub(super) struct Shape {
    pub(super) hypothesis: Hypothesis,
    pub(super) fit: Fitted,
    pub(super) named: Named,
    /// The plays that were chosen anew with it, if it is on those: their number among the [`Bent`].
    pub(super) anew: Option<usize>,
}

/// The own base with a curve.
pub(super) struct Curved {
    pub(super) trial: Trial,
    /// Whether the curve bends its two halves differently.
    pub(super) is_lopsided: bool,
}

impl Curved {
    /// Whether it takes so much of what the base leaves above the noise without a curve that the rest may be no more than what the curve has bent.
    pub(super) fn takes(&self, plain: &Trial, noise: f64) -> bool {
        let above = plain.total() - plain.fit.rows as f64 * noise * noise;
        self.is_lopsided && plain.total() - self.trial.total() >= DOMINANT_SHARE * above
    }
}

/// The same on the user's plays, and on others.
pub(super) struct Bent {
    pub(super) own: Option<Curved>,
    /// On the plays that were chosen behind that curve: without it, where they lack something too, and with it.
    pub(super) anew: Option<(Trial, Curved)>,
}

impl Bent {
    pub(super) fn curves(&self) -> impl Iterator<Item = &Curved> {
        self.own.iter().chain(self.anew.iter().map(|(_, with)| with))
    }
}

/// What the own base may lack.
struct Tried {
    effect: Effect,
    trial: Trial,
    /// Without the curve, where it is on plays that were chosen anew, and the number of these plays.
    anew: Option<(usize, Trial)>,
    /// Whether it has the form that its name stands for.
    is_of_its_kind: bool,
}

impl Tried {
    fn curve(with: Curved, anew: Option<(usize, Trial)>) -> Self {
        Self { effect: Effect::Asymmetry, trial: with.trial, anew, is_of_its_kind: with.is_lopsided }
    }

    fn stop(trial: Trial) -> Self {
        Self { effect: Effect::Saturation, trial, anew: None, is_of_its_kind: true }
    }
}

/// And what speaks for it.
struct Judged<'a> {
    tried: &'a Tried,
    judgement: score::Judgement,
    accepted: bool,
}

/// Whether an error is near the noise floor.
pub(super) fn is_near(cv_rmse: f64, noise: f64) -> bool {
    cv_rmse <= MAX_NOISE_FLOORS * noise
}

/// The own base with what was found; none if it cannot be solved.
pub(super) fn plain(problem: &Problem<'_>, found: &Hypothesis) -> Result<Option<Trial>, Error> {
    Ok(problem.fit_linear(found)?.and_then(|f| Trial::of(problem, f)))
}

/// Whether it misses nothing that the rich one shows.
pub(super) fn is_complete(plain: &Trial, richest: f64) -> bool {
    plain.cv_rmse() <= (1.0 + MIN_RMSE_DROP) * richest
}

/// The same with a curve on this side of it; none if there is one already.
pub(super) fn bent(
    problem: &Problem<'_>,
    found: &Hypothesis,
    plain: &Fitted,
    side: CurveSide,
) -> Result<Option<Curved>, Error> {
    if found.effects.asymmetry.is_some() {
        return Ok(None);
    }
    let mut best: Option<Fitted> = None;
    for _ in 0..PLACINGS {
        // What the curve stretches the operator gives less of: some of its dead zones may lie where nothing comes any more.
        let Some(seen) = reach(problem, best.as_ref().unwrap_or(plain), side) else { break };
        let mut h = found.clone();
        h.effects.asymmetry = Some(curve(seen, side));
        if side == CurveSide::Input {
            // The curve alone is searched: all else keeps what the rich base has given it.
            let Some(fit) = problem.fit(&h)? else { break };
            h.effects.asymmetry = fit.hypothesis.effects.asymmetry;
        }
        let Some(fit) = problem.fit_linear(&h)? else { break };
        if best.as_ref().is_some_and(|best| best.squares <= fit.squares) {
            break;
        }
        best = Some(fit);
        // The drive goes where it goes.
        if side == CurveSide::Input {
            break;
        }
    }
    let Some(fit) = best else { return Ok(None) };
    let curve = fit.hypothesis.effects.asymmetry.as_ref();
    let is_lopsided =
        curve.zip(reach(problem, &fit, side)).is_some_and(|(p, reach)| lopsided(p, reach) >= MIN_BEND_DIFFERENCE);
    Ok(Trial::of(problem, fit).map(|trial| Curved { trial, is_lopsided }))
}

/// Looks for a curve behind the own base of `problem`, all that was found before kept. `plain` is that base without one, which
/// [lacks](is_complete) something; `richest` is the cross-validated error that a rich base leaves \[y\].
pub(super) fn shape(
    problem: &Problem<'_>,
    found: &Hypothesis,
    plain: &Trial,
    bent: Vec<Bent>,
    richest: f64,
    noise: f64,
    seed: u64,
) -> Result<Option<Shape>, Error> {
    // With a drag there is no finer base than that of the search: what it leaves need not be the least that a base can leave. And what a
    // wandering leaves is no base's.
    let is_least = found.drag.is_none() && !found.zero_wanders && !found.gain_wanders;
    let least = if is_least { richest } else { richest.min(MAX_NOISE_FLOORS * noise) };
    let curves = bent.into_iter().enumerate().flat_map(|(at, Bent { own, anew })| {
        let own = own.map(|with| Tried::curve(with, None));
        own.into_iter().chain(anew.map(|(plain, with)| Tried::curve(with, Some((at, plain)))))
    });
    let mut tried: Vec<Tried> = curves.collect();
    if found.effects.saturation.is_none() {
        for fitted in stopped(problem, &plain.fit)? {
            tried.extend(Trial::of(problem, fitted).map(Tried::stop));
        }
    }
    // What better plays gain is not the curve's.
    let on_better_plays = tried.iter().filter_map(|t| t.anew.as_ref()).map(|(_, plain)| plain);
    let best_plays = on_better_plays.min_by(|a, b| a.total().total_cmp(&b.total())).cloned();
    let best_plays = best_plays.filter(|p| p.total() < plain.total());
    let plain = best_plays.as_ref().unwrap_or(plain);
    let judged: Vec<Judged<'_>> = tried
        .iter()
        .map(|t| {
            let (without, closed) = t.anew.as_ref().map_or((plain, CLOSED), |(_, plain)| (plain, CLOSED_ANEW));
            let judgement = score::judge(problem, without, &t.trial, noise, seed);
            // Behind this base, which does not bend, a soft stop counts too.
            let stop = t.trial.fit.hypothesis.effects.saturation.filter(|_| t.effect == Effect::Saturation);
            let stops = stop.map(|stop| score::halves_something(problem.samples, &t.trial.fit, &stop));
            let judgement = score::Judgement { sensible: stops.unwrap_or(judgement.sensible), ..judgement };
            let accepted = judgement.accepted()
                && judgement.share >= DOMINANT_SHARE
                && (t.trial.cv_rmse() <= closed * least || judgement.share >= WHOLE_SHARE)
                && t.is_of_its_kind;
            Judged { tried: t, judgement, accepted }
        })
        .collect();
    // A curve beside a stop may be no more than what the law of the stop misses.
    let unstopped = match found.effects.saturation {
        Some(_) => self::plain(problem, &found.without(Cause::Effect(Effect::Saturation)))?,
        None => None,
    };
    let by_stop = unstopped.map_or(0.0, |without| without.total() - plain.total());
    let judged: Vec<Judged<'_>> = judged
        .into_iter()
        .map(|j| {
            let enough = plain.total() - j.tried.trial.total() >= NEGLIGIBLE_SHARE * by_stop;
            Judged { accepted: j.accepted && enough, ..j }
        })
        .collect();
    // A stop has fewer numbers than a curve: where they are as good as each other it is the stop.
    let weighted =
        |j: &Judged<'_>| j.tried.trial.cv_rmse() * if j.tried.effect == Effect::Saturation { 0.95 } else { 1.0 };
    let best = judged.iter().filter(|j| j.accepted).min_by(|a, b| weighted(a).total_cmp(&weighted(b)));
    Ok(best.map(|Judged { tried: Tried { effect, trial, anew, .. }, judgement, .. }| {
        let others = judged.iter().filter(|j| j.tried.effect != *effect).map(|j| Instead {
            effect: j.tried.effect,
            cv_rmse: j.tried.trial.cv_rmse(),
            tie: j.accepted && score::undecided(trial, &j.tried.trial, seed),
            hypothesis: j.tried.trial.fit.hypothesis.clone(),
            judgement: j.judgement,
        });
        let mut instead: Vec<Instead> = others.collect();
        instead.sort_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
        instead.dedup_by_key(|i| i.effect);
        Shape {
            hypothesis: trial.fit.hypothesis.clone(),
            fit: trial.fit.clone(),
            anew: anew.as_ref().map(|(at, _)| *at),
            named: Named {
                effect: *effect,
                cv_without: anew.as_ref().map_or(plain, |(_, plain)| plain).cv_rmse(),
                cv_with: trial.cv_rmse(),
                judgement: *judgement,
                instead,
            },
        }
    }))
}

/// Fits of the own base with a stop, from several beginnings: where `open`, the same without one, shows its ends. Everything else stays as it was found:
/// on this coarser base it would take up the misfit.
fn stopped(problem: &Problem<'_>, open: &Fitted) -> Result<Vec<Fitted>, Error> {
    let mut fits = Vec::new();
    let ends = starts::stops(problem.samples, open).into_iter().flatten();
    let above_rest = starts::stops_above_rest(problem.samples, open).into_iter().flatten();
    for stop in ends.chain(above_rest) {
        let mut h = open.hypothesis.clone();
        h.effects.saturation = Some(stop);
        fits.extend(problem.fit(&h)?.and_then(|f| {
            h.effects.saturation = f.hypothesis.effects.saturation;
            problem.fit_linear(&h).ok().flatten()
        }));
    }
    Ok(fits)
}

/// Where the own base meets a stop that the rich one has found: what lies behind a stop is hidden, and each base fills it in its own way. The limits
/// are those of the motion, which begins at another zero on each base.
pub(super) fn own_stop(problem: &Problem<'_>, found: &Hypothesis) -> Result<Option<Fitted>, Error> {
    let Some(open) = problem.fit_linear(&found.without(Cause::Effect(Effect::Saturation)))? else { return Ok(None) };
    let as_found = problem.fit_linear(found)?;
    let stops = |f: &Fitted| {
        let stop = f.hypothesis.effects.saturation;
        stop.is_some_and(|p| score::halves_something(problem.samples, f, &p))
    };
    Ok(stopped(problem, &open)?
        .into_iter()
        .chain(as_found)
        .filter(|f| f.squares < open.squares && stops(f))
        .min_by(|a, b| a.squares.total_cmp(&b.squares)))
}

/// Where the operator's output, or the drive, goes in the rows that count, without its ends; none if it stands still.
fn reach(problem: &Problem<'_>, fit: &Fitted, side: CurveSide) -> Option<(f64, f64)> {
    let seen = match side {
        CurveSide::Output => problem.operator_output(fit).ok()?,
        CurveSide::Input => problem.samples.input.clone(),
    };
    let settled = seen.iter().zip(&problem.samples.settling).filter(|(_, s)| !**s).map(|(v, _)| *v);
    let (low, high) = crate::samples::range(settled);
    let (low, high) = (low + MARGIN * (high - low), high - MARGIN * (high - low));
    (low < high).then_some((low, high))
}

/// Dead zones spread evenly from the lowest to the highest value that enters the curve, moving away from zero.
fn curve((low, high): (f64, f64), side: CurveSide) -> AsymmetryParams<Vec<f64>> {
    let mut thresholds: Vec<f64> =
        (0..MAX_DEAD_ZONES).map(|i| low + (high - low) * i as f64 / (MAX_DEAD_ZONES - 1) as f64).collect();
    thresholds.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    AsymmetryParams { weights: vec![0.0; thresholds.len()], thresholds, side }
}

/// Share of a curve's bend that is even about the middle of what it spans, straight parts left out: 1 where only one half bends or both bend
/// the same way, 0 where a half turn carries the curve over into itself.
fn lopsided(p: &AsymmetryParams<Vec<f64>>, (low, high): (f64, f64)) -> f64 {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let bend = |v: f64| p.thresholds.iter().zip(&p.weights).map(|(s, c)| c * dead_zone(v, *s)).sum::<f64>();
    let parts = (1..=POINTS).map(|i| {
        let d = half * i as f64 / POINTS as f64;
        let (above, below) = (bend(middle + d), bend(middle - d));
        (d, 0.5 * (above + below), 0.5 * (above - below))
    });
    let parts: Vec<(f64, f64, f64)> = parts.collect();
    let mean = parts.iter().map(|(_, even, _)| even).sum::<f64>() / POINTS as f64;
    let dd: f64 = parts.iter().map(|(d, ..)| d * d).sum();
    let slope = parts.iter().map(|(d, _, odd)| d * odd).sum::<f64>() / dd.max(f64::MIN_POSITIVE);
    let even: f64 = parts.iter().map(|(_, even, _)| (even - mean).powi(2)).sum();
    let odd: f64 = parts.iter().map(|(d, _, odd)| (odd - slope * d).powi(2)).sum();
    even / (even + odd).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A curve of these slopes from each threshold to the next.
    fn curve(thresholds: &[f64], slopes: &[f64]) -> AsymmetryParams<Vec<f64>> {
        let weights = slopes.windows(2).map(|s| s[1] - s[0]).collect();
        AsymmetryParams::behind(thresholds.to_vec(), weights)
    }

    #[test]
    fn a_curve_that_a_half_turn_leaves_as_it_is_is_no_asymmetry() {
        let thresholds = [10.0, 20.0, 30.0, 40.0, 50.0];
        assert!(lopsided(&curve(&thresholds, &[1.0, 0.8, 1.1, 1.1, 0.8, 1.0]), (10.0, 50.0)) < 1e-9);
        // Of whatever slope on the whole.
        assert!(lopsided(&curve(&thresholds, &[1.0, 1.3, 1.6, 1.6, 1.3, 1.0]), (10.0, 50.0)) < 1e-9);
    }

    #[test]
    fn a_curve_that_bends_one_way_is_one() {
        let thresholds = [10.0, 20.0, 30.0, 40.0, 50.0];
        assert!(lopsided(&curve(&thresholds, &[1.0, 1.1, 1.2, 1.3, 1.4, 1.5]), (10.0, 50.0)) > 0.99);
        // Of a bend at one end alone, half is even.
        let share = lopsided(&curve(&thresholds, &[1.0, 1.0, 1.0, 1.0, 0.7, 0.7]), (10.0, 50.0));
        assert!((0.4..0.95).contains(&share), "{share}");
        // And a straight line bends nowhere.
        assert!(lopsided(&curve(&thresholds, &[1.0; 6]), (10.0, 50.0)).abs() < 1e-9);
    }

    #[test]
    fn zones_that_nothing_reaches_are_no_half_of_a_curve() {
        let odd = curve(&[10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0], &[1.0, 1.3, 1.6, 1.6, 1.3, 1.0, 1.0, 1.0]);
        assert!(lopsided(&odd, (10.0, 50.0)) < 1e-9);
        assert!(lopsided(&odd, (10.0, 70.0)) > MIN_BEND_DIFFERENCE);
    }

    #[test]
    fn zero_within_the_curve_changes_nothing() {
        // The same bends about zero: zones open away from it, the stretch that holds it has the slope 1.
        let zones = |weights: [f64; 4]| AsymmetryParams {
            weights: weights.to_vec(),
            ..curve(&[-20.0, -10.0, 10.0, 20.0], &[])
        };
        let odd = zones([0.1, -0.2, -0.2, 0.1]);
        assert!(lopsided(&odd, (-20.0, 20.0)) < 1e-9);
        let even = zones([-0.1, -0.1, 0.1, 0.1]);
        assert!(lopsided(&even, (-20.0, 20.0)) > 0.99);
    }
}
