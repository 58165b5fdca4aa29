//! Searches the model's own base for a missing curve: asymmetry, or saturation.
//!
//! The screening basis bends by itself, so that a coarse base is not mistaken for an effect. Here the model's own base
//! is checked. If one memoryless curve explains most of the difference to the screening basis, the curve is named. If
//! not, the missing part has memory and the base model is too coarse.

use hyst_core::{AsymmetryParams, CurveSide, Error, MAX_DEAD_ZONES, SaturationParams};
use rayon::prelude::*;

use super::effects::saturation::has_soft_limit;
use super::search::{Named, Rival};
use super::trial::Trial;
use super::{score, trial_parameters};
use crate::criteria::{DOMINANT_SHARE, MIN_BEND_DIFFERENCE, MIN_RMSE_DROP, MIN_RMSE_RATIO, NEGLIGIBLE_SHARE};
use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Problem, dead_zone};

/// Maximum error of the model's base with a curve, relative to that of the screening basis, at which nothing else is
/// missing.
pub(super) const MAX_RATIO_TO_SCREENING: f64 = MIN_RMSE_RATIO * MIN_RMSE_RATIO;
/// The same, if the thresholds of the model's base were chosen again with the curve: less can then be missing.
pub(super) const MAX_RATIO_RESELECTED: f64 = MIN_RMSE_RATIO;
/// Number of points at which the two halves of a curve are compared.
const POINTS: usize = 64;
/// Maximum number of times that the dead zones of a curve are placed again after a change of the operator's output.
const MAX_PLACINGS: usize = 6;
/// Margin between the outermost dead zones and the ends of the motion's range, as a share of it.
const MARGIN: f64 = 0.08;

/// The missing curve on the model's own base.
pub(super) struct Shape {
    pub(super) hypothesis: Hypothesis,
    pub(super) fit: Fitted,
    pub(super) named: Named,
    /// Index among the [`CurveFits`] if the thresholds were chosen again.
    pub(super) anew: Option<usize>,
}

/// The model's own base with a curve.
pub(super) struct CurveFit {
    pub(super) trial: Trial,
    /// Whether the curve bends its two halves differently.
    pub(super) is_asymmetric: bool,
}

impl CurveFit {
    /// Returns whether the curve explains so much of the residual above the noise that the rest may only be a
    /// consequence of the missing curve.
    pub(super) fn takes(&self, plain: &Trial, noise: f64) -> bool {
        let above = plain.total() - plain.fit.rows as f64 * noise * noise;
        self.is_asymmetric && plain.total() - self.trial.total() >= DOMINANT_SHARE * above
    }
}

/// Fits with a curve on the model's thresholds and on other ones.
pub(super) struct CurveFits {
    pub(super) own: Option<CurveFit>,
    /// With thresholds chosen for that curve: without the curve, if the base is then still incomplete, and with it.
    pub(super) anew: Option<(Trial, CurveFit)>,
}

impl CurveFits {
    pub(super) fn curves(&self) -> impl Iterator<Item = &CurveFit> {
        self.own.iter().chain(self.anew.iter().map(|(_, with)| with))
    }
}

/// A candidate for the missing curve.
struct Tried {
    effect: Effect,
    trial: Trial,
    /// Index of the newly chosen thresholds and the fit without the curve, if the curve is on those.
    anew: Option<(usize, Trial)>,
    /// Whether the curve has the form that its name stands for.
    is_of_its_kind: bool,
}

impl Tried {
    fn curve(with: CurveFit, anew: Option<(usize, Trial)>) -> Self {
        Self { effect: Effect::Asymmetry, trial: with.trial, anew, is_of_its_kind: with.is_asymmetric }
    }

    fn stop(trial: Trial) -> Self {
        Self { effect: Effect::Saturation, trial, anew: None, is_of_its_kind: true }
    }
}

/// A candidate with its judgement.
struct Judged<'a> {
    tried: &'a Tried,
    judgement: score::Judgement,
    accepted: bool,
}

/// Returns whether an error is near the noise floor.
pub(super) fn is_near(cv_rmse: f64, noise: f64) -> bool {
    cv_rmse <= MIN_RMSE_RATIO * noise
}

/// Returns the model's own base with the effects found; `None` if it cannot be solved.
pub(super) fn plain(problem: &Problem<'_>, found: &Hypothesis) -> Result<Option<Trial>, Error> {
    Ok(problem.fit_linear(found)?.and_then(|f| Trial::of(problem, f)))
}

/// Returns whether the base is complete: nothing is missing that the screening basis shows.
pub(super) fn is_complete(plain: &Trial, richest: f64) -> bool {
    plain.cv_rmse() <= (1.0 + MIN_RMSE_DROP) * richest
}

/// Fits a curve on this side of the base; `None` if there is one already.
pub(super) fn bent(
    problem: &Problem<'_>,
    found: &Hypothesis,
    plain: &Fitted,
    side: CurveSide,
) -> Result<Option<CurveFit>, Error> {
    if found.effects.asymmetry.is_some() {
        return Ok(None);
    }
    let mut best: Option<Fitted> = None;
    for _ in 0..MAX_PLACINGS {
        // The curve changes the operator's output, so some dead zones may lie outside its range. They are placed again.
        let Some(seen) = reach(problem, best.as_ref().unwrap_or(plain), side) else { break };
        let mut h = found.clone();
        h.effects.asymmetry = Some(curve(seen, side));
        if side == CurveSide::Input {
            // Only the curve is searched: everything else keeps the values from the screening basis.
            let Some(fit) = problem.fit(&h)? else { break };
            h.effects.asymmetry = fit.hypothesis.effects.asymmetry;
        }
        let Some(fit) = problem.fit_linear(&h)? else { break };
        if best.as_ref().is_some_and(|best| best.squares <= fit.squares) {
            break;
        }
        best = Some(fit);
        // The drive does not depend on the fit.
        if side == CurveSide::Input {
            break;
        }
    }
    let Some(fit) = best else { return Ok(None) };
    let curve = fit.hypothesis.effects.asymmetry.as_ref();
    let is_asymmetric = curve
        .zip(reach(problem, &fit, side))
        .is_some_and(|(p, reach)| asymmetric_share(p, reach) >= MIN_BEND_DIFFERENCE);
    Ok(Trial::of(problem, fit).map(|trial| CurveFit { trial, is_asymmetric }))
}

/// Chooses between the candidates for a curve on the model's own base, all effects found before kept. `plain` is that
/// base without a curve, which is not [complete](is_complete); `richest` is the cross-validated RMSE of the screening
/// basis \[y\].
pub(super) fn shape(
    problem: &Problem<'_>,
    found: &Hypothesis,
    plain: &Trial,
    bent: Vec<CurveFits>,
    richest: f64,
    noise: f64,
    seed: u64,
) -> Result<Option<Shape>, Error> {
    // With a drag there is no finer basis than that of the search, so its error need not be the smallest possible. A
    // wander is no misfit of a base.
    let is_least = found.drag.is_none() && !found.zero_wanders && !found.gain_wanders;
    let least = if is_least { richest } else { richest.min(MIN_RMSE_RATIO * noise) };
    let curves = bent.into_iter().enumerate().flat_map(|(at, CurveFits { own, anew })| {
        let own = own.map(|with| Tried::curve(with, None));
        own.into_iter().chain(anew.map(|(plain, with)| Tried::curve(with, Some((at, plain)))))
    });
    let mut tried: Vec<Tried> = curves.collect();
    if found.effects.saturation.is_none() {
        for fitted in stopped(problem, &plain.fit)? {
            tried.extend(Trial::of(problem, fitted).map(Tried::stop));
        }
    }
    // The gain of better thresholds does not count for the curve.
    let with_better_thresholds = tried.iter().filter_map(|t| t.anew.as_ref()).map(|(_, plain)| plain);
    let best_plays = with_better_thresholds.min_by(|a, b| a.total().total_cmp(&b.total())).cloned();
    let best_plays = best_plays.filter(|p| p.total() < plain.total());
    let plain = best_plays.as_ref().unwrap_or(plain);
    let judged: Vec<Judged<'_>> = tried
        .iter()
        .map(|t| {
            let (without, closed) =
                t.anew.as_ref().map_or((plain, MAX_RATIO_TO_SCREENING), |(_, plain)| (plain, MAX_RATIO_RESELECTED));
            let judgement = score::judge(problem, without, &t.trial, noise, seed);
            // This base does not bend by itself, so a soft saturation counts too.
            let stop = t.trial.fit.hypothesis.effects.limits(CurveSide::Output);
            let stop = stop.filter(|_| t.effect == Effect::Saturation);
            let stops = stop.map(|stop| has_soft_limit(problem.samples, &t.trial.fit, &stop));
            let judgement = score::Judgement { sensible: stops.unwrap_or(judgement.sensible), ..judgement };
            let accepted = judgement.accepted()
                && judgement.share >= DOMINANT_SHARE
                && (t.trial.cv_rmse() <= closed * least || judgement.share >= 1.0 - NEGLIGIBLE_SHARE)
                && t.is_of_its_kind;
            Judged { tried: t, judgement, accepted }
        })
        .collect();
    // A curve next to a saturation may only correct the saturation's law.
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
    // Saturation has fewer parameters than a curve. If both are equally good, saturation is named.
    let weighted =
        |j: &Judged<'_>| j.tried.trial.cv_rmse() * if j.tried.effect == Effect::Saturation { 0.95 } else { 1.0 };
    let best = judged.iter().filter(|j| j.accepted).min_by(|a, b| weighted(a).total_cmp(&weighted(b)));
    let Some(Judged { tried: Tried { effect, trial, anew, .. }, judgement, .. }) = best else { return Ok(None) };
    let with_slopes = if anew.is_none() { problem.with_slopes(&trial.fit)? } else { None };
    let others = judged.iter().filter(|j| j.tried.effect != *effect).map(|j| Rival {
        effect: j.tried.effect,
        cv_rmse: j.tried.trial.cv_rmse(),
        tie: j.accepted && score::undecided(trial, &j.tried.trial, seed),
        hypothesis: j.tried.trial.fit.hypothesis.clone(),
        judgement: j.judgement,
    });
    let mut rivals: Vec<Rival> = others.collect();
    rivals.sort_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
    rivals.dedup_by_key(|i| i.effect);
    Ok(Some(Shape {
        hypothesis: trial.fit.hypothesis.clone(),
        fit: with_slopes.unwrap_or_else(|| trial.fit.clone()),
        anew: anew.as_ref().map(|(at, _)| *at),
        named: Named {
            effect: *effect,
            cv_without: anew.as_ref().map_or(plain, |(_, plain)| plain).cv_rmse(),
            cv_with: trial.cv_rmse(),
            judgement: *judgement,
            rivals,
        },
    }))
}

/// Fits the model's own base with a saturation limit, from several starts that the same base without one (`open`)
/// suggests. Everything else keeps its values: on this coarser base it would take up the misfit.
pub(super) fn stopped(problem: &Problem<'_>, open: &Fitted) -> Result<Vec<Fitted>, Error> {
    let ends = trial_parameters::stops(problem.samples, open).into_iter().flatten();
    let above_rest = trial_parameters::stops_above_rest(problem.samples, open).into_iter().flatten();
    let starts: Vec<SaturationParams> = ends.chain(above_rest).collect();
    let fits: Vec<Result<Option<Fitted>, Error>> =
        starts.par_iter().map(|start| from_limits(problem, open, *start)).collect();
    fits.into_iter().filter_map(Result::transpose).collect()
}

/// Searches the limits of a saturation of the motion or the drive from a start. Everything else keeps its values.
pub(super) fn from_limits(
    problem: &Problem<'_>,
    open: &Fitted,
    start: SaturationParams,
) -> Result<Option<Fitted>, Error> {
    let mut h = open.hypothesis.clone();
    h.effects.saturation = Some(start);
    let Some(fitted) = problem.fit(&h)? else { return Ok(None) };
    h.effects.saturation = fitted.hypothesis.effects.saturation;
    Ok(problem.fit_linear(&h).ok().flatten())
}

/// Refits a saturation limit that another basis found. The limit hides the motion behind it, and each basis fills that
/// in differently. Limits of the motion depend on its zero, which differs between bases, so they start anew.
pub(super) fn own_limits(problem: &Problem<'_>, found: &Hypothesis) -> Result<Option<Fitted>, Error> {
    let Some(open) = problem.fit_linear(&found.without(Cause::Effect(Effect::Saturation)))? else { return Ok(None) };
    let as_found = problem.fit_linear(found)?;
    let stops = |f: &Fitted| {
        let p = f.hypothesis.effects.saturation;
        p.is_some_and(|p| p.side == CurveSide::Input || has_soft_limit(problem.samples, f, &p))
    };
    let anew = match found.effects.limits(CurveSide::Input) {
        Some(limits) => from_limits(problem, &open, limits)?.into_iter().collect(),
        None => stopped(problem, &open)?,
    };
    let fits = anew.into_iter().chain(as_found);
    let best = fits.filter(|f| f.squares < open.squares && stops(f)).min_by(|a, b| a.squares.total_cmp(&b.squares));
    best.map_or(Ok(None), |best| problem.with_slopes(&best))
}

/// Returns the range of the operator's output, or of the drive, over the rows that count, without the margins; `None`
/// if it does not move.
fn reach(problem: &Problem<'_>, fit: &Fitted, side: CurveSide) -> Option<(f64, f64)> {
    let seen = match side {
        CurveSide::Output => problem.operator_output(fit).ok()?,
        CurveSide::Input => problem.samples.input.clone(),
    };
    let settled = seen.iter().zip(&problem.samples.settling).filter(|(_, s)| !**s).map(|(v, _)| *v);
    let (low, high) = crate::statistics::range(settled);
    let (low, high) = (low + MARGIN * (high - low), high - MARGIN * (high - low));
    (low < high).then_some((low, high))
}

/// Returns even dead zones over the range of the curve's input, ordered by distance from zero.
fn curve((low, high): (f64, f64), side: CurveSide) -> AsymmetryParams<Vec<f64>> {
    let mut thresholds: Vec<f64> =
        (0..MAX_DEAD_ZONES).map(|i| low + (high - low) * i as f64 / (MAX_DEAD_ZONES - 1) as f64).collect();
    thresholds.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    AsymmetryParams { weights: vec![0.0; thresholds.len()], thresholds, side }
}

/// Returns the share of a curve's bend that is even about the middle of its range, without the straight part. It is 1
/// if only one half bends or both bend the same way, and 0 if the curve is point-symmetric.
fn asymmetric_share(p: &AsymmetryParams<Vec<f64>>, (low, high): (f64, f64)) -> f64 {
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

    /// Returns a curve with these slopes between the thresholds.
    fn curve(thresholds: &[f64], slopes: &[f64]) -> AsymmetryParams<Vec<f64>> {
        let weights = slopes.windows(2).map(|s| s[1] - s[0]).collect();
        AsymmetryParams::behind(thresholds.to_vec(), weights)
    }

    #[test]
    fn a_point_symmetric_curve_is_no_asymmetry() {
        let thresholds = [10.0, 20.0, 30.0, 40.0, 50.0];
        assert!(asymmetric_share(&curve(&thresholds, &[1.0, 0.8, 1.1, 1.1, 0.8, 1.0]), (10.0, 50.0)) < 1e-9);
        // The overall slope does not matter.
        assert!(asymmetric_share(&curve(&thresholds, &[1.0, 1.3, 1.6, 1.6, 1.3, 1.0]), (10.0, 50.0)) < 1e-9);
    }

    #[test]
    fn a_curve_that_bends_one_way_is_an_asymmetry() {
        let thresholds = [10.0, 20.0, 30.0, 40.0, 50.0];
        assert!(asymmetric_share(&curve(&thresholds, &[1.0, 1.1, 1.2, 1.3, 1.4, 1.5]), (10.0, 50.0)) > 0.99);
        // About half of a bend at one end is even.
        let share = asymmetric_share(&curve(&thresholds, &[1.0, 1.0, 1.0, 1.0, 0.7, 0.7]), (10.0, 50.0));
        assert!((0.4..0.95).contains(&share), "{share}");
        // A straight line does not bend.
        assert!(asymmetric_share(&curve(&thresholds, &[1.0; 6]), (10.0, 50.0)).abs() < 1e-9);
    }

    #[test]
    fn dead_zones_outside_the_range_do_not_count() {
        let odd = curve(&[10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0], &[1.0, 1.3, 1.6, 1.6, 1.3, 1.0, 1.0, 1.0]);
        assert!(asymmetric_share(&odd, (10.0, 50.0)) < 1e-9);
        assert!(asymmetric_share(&odd, (10.0, 70.0)) > MIN_BEND_DIFFERENCE);
    }

    #[test]
    fn a_zero_inside_the_range_changes_nothing() {
        // The same bends about zero: dead zones open away from zero, and the piece around zero has slope 1.
        let zones = |weights: [f64; 4]| AsymmetryParams {
            weights: weights.to_vec(),
            ..curve(&[-20.0, -10.0, 10.0, 20.0], &[])
        };
        let odd = zones([0.1, -0.2, -0.2, 0.1]);
        assert!(asymmetric_share(&odd, (-20.0, 20.0)) < 1e-9);
        let even = zones([-0.1, -0.1, 0.1, 0.1]);
        assert!(asymmetric_share(&even, (-20.0, 20.0)) > 0.99);
    }
}
