//! Limits of detection of all effects that are not named.

use std::collections::BTreeMap;

use hyst_core::Error;

use super::causes::hidden;
use super::effects;
use super::limit::{Limit, Limits};
use super::scan::Scan;
use super::score::least_gain;
use super::trial::Trial;
use crate::model::Effect;
use crate::nested::{Cause, Problem};

/// Gain at the limit, relative to the smallest gain that the search accepts. The gain grows with the square of the size,
/// so the limit is three times the smallest accepted size. Noise may hide a part of an effect, and a rival may explain a
/// part. `--example limits` measures the share of effects that are named at the limit (docs/findings.md).
const GAIN_MARGIN: f64 = 9.0;

/// Limit relative to a bound below which an effect is never named: noise shifts a fitted size.
const BOUND_MARGIN: f64 = 1.5;

/// Returns the limit of each effect that was not found, on the basis of the search. Asymmetry has none: that basis
/// bends by itself.
pub(super) fn limits(
    problem: &Problem<'_>,
    found: &Trial,
    noise: f64,
    (input, output): (&str, &str),
) -> Result<BTreeMap<Effect, Limit>, Error> {
    let h = &found.fit.hypothesis;
    let (rows, left) = (found.fit.rows as f64, found.total());
    let least = |left: f64| GAIN_MARGIN * least_gain(rows, left, noise).max(f64::MIN_POSITIVE);
    let all = Limits {
        scan: Scan::new(problem, &found.fit, 0.0)?,
        least: least(left),
        // A tone is judged against the noise floor alone.
        least_tone: least(rows * noise * noise),
        margin: BOUND_MARGIN,
        input,
        output,
    };
    let mut limits = BTreeMap::new();
    for effect in Effect::ALL {
        let cause = Cause::Effect(effect);
        if h.causes().contains(&cause) {
            continue;
        }
        match hidden(cause, problem) {
            Some(why) => limits.insert(effect, Limit::hidden(why)),
            None => effects::of(effect).limit(&all)?.and_then(|limit| limits.insert(effect, limit)),
        };
    }
    Ok(limits)
}
