//! Which causes are worth a fit, and start values for the search of their parameters.
//!
//! A cause with a very small first-order gain is not fitted, because refining its parameters cannot raise the gain
//! enough. Most effects are smooth in their parameters and can start near zero. A frequency is not: it is first searched
//! over the whole band, by the first-order gain in Σ residual².

use hyst_core::Error;

use super::effects;
use super::scan::Scan;
use crate::nested::{Cause, Hypothesis, initial, slopes};

/// Number of slopes from which a search of a slew limit starts.
const MAX_STARTS: usize = 2;
/// Number of slopes of the coarse scan, and the ratio of successive ones.
const SLOPES: usize = 20;
const SLOPE_RATIO: f64 = 0.65;

/// Returns the hypotheses from which the search of `cause` starts, added to the scanned fit; none if its first-order
/// gain is too small.
pub(super) fn starts(scan: &Scan<'_>, cause: Cause) -> Result<Vec<Hypothesis>, Error> {
    if !is_promising(scan, cause)? {
        return Ok(Vec::new());
    }
    let known = || scan.from.hypothesis.clone();
    Ok(match cause {
        Cause::Effect(effect) => effects::of(effect).starts(scan)?,
        Cause::ZeroWanders => vec![Hypothesis { zero_wanders: true, ..known() }],
        Cause::GainWanders => vec![Hypothesis { gain_wanders: true, ..known() }],
        Cause::InitialState => vec![Hypothesis { initial_state: true, ..known() }],
        Cause::SlewLimit => {
            let limited = |v_per_s| Hypothesis { slew_limit: Some(v_per_s), ..known() };
            slew_limits(scan)?.into_iter().map(limited).collect()
        }
    })
}

/// Returns whether a cause would gain enough to be worth a fit. Causes whose start is searched first are tested there.
fn is_promising(scan: &Scan<'_>, cause: Cause) -> Result<bool, Error> {
    let columns = match cause {
        Cause::Effect(effect) => effects::of(effect).columns(scan)?,
        Cause::ZeroWanders => Some(scan.hats(&|_| 1.0)),
        Cause::GainWanders => Some(scan.hats(&|k| scan.motion[k])),
        Cause::InitialState => {
            let h = Hypothesis { initial_state: true, ..scan.from.hypothesis.clone() };
            Some(initial::columns(scan.problem.samples, &h))
        }
        Cause::SlewLimit => None,
    };
    // Of either sign: a fit may start with the other one.
    Ok(columns.is_none_or(|columns| !columns.is_empty() && scan.joint_gain(&columns) >= scan.promising))
}

/// Returns start values of the slew limit: the slopes with the largest first-order gain.
fn slew_limits(scan: &Scan<'_>) -> Result<Vec<f64>, Error> {
    let mut scored = Vec::new();
    let (least, steepest) = slopes(scan.problem.samples);
    let limits = (0..SLOPES).scan(steepest, |limit, _| {
        *limit *= SLOPE_RATIO;
        Some(*limit)
    });
    for limit in limits.take_while(|limit| *limit > least) {
        let limited = Hypothesis { slew_limit: Some(limit), ..scan.from.hypothesis.clone() };
        scored.extend(scan.gain(&scan.moved(&limited)?).map(|(gain, _)| (gain, limit)));
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(scored.into_iter().take(MAX_STARTS).map(|(_, limit)| limit).collect())
}
