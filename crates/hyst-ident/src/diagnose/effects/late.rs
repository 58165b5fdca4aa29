//! What delay and lag share: one time \[s\], whose first-order change is proportional to it.

use hyst_core::Error;

use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::model::Effects;
use crate::nested::{Fitted, Hypothesis, Problem};

/// Ratio of successive start values, and their maximum as a share of the longest segment.
const RATIO: f64 = 12.0;
pub(super) const MAX_SHARE: f64 = 0.01;
/// Maximum time of a limit of detection, as a share of the longest segment.
const MAX_LIMIT_SHARE: f64 = 0.1;
/// Minimum time, in sample periods; beside a drag, whose law is not exact, a delay of a fraction of a sample is the
/// misfit of that law.
const MIN_SAMPLES: f64 = 0.02;
const MIN_SAMPLES_BESIDE_DRAG: f64 = 0.3;

/// Sets the time of an effect \[s\].
type Set<'a> = &'a dyn Fn(&mut Effects, f64);

/// Returns the first-order column: the change by one sample period.
pub(super) fn columns(scan: &Scan<'_>, set: Set<'_>) -> Result<Option<Vec<Vec<f64>>>, Error> {
    let seconds = scan.problem.samples.period;
    Ok(Some(vec![scan.moved_with(&|e| set(e, seconds))?]))
}

/// Returns the starts: one sample period, and longer times if the sample rate is high for the record.
pub(super) fn starts(scan: &Scan<'_>, set: Set<'_>) -> Result<Vec<Hypothesis>, Error> {
    let samples = scan.problem.samples;
    let most = MAX_SHARE * samples.longest_segment();
    let times = [1.0, RATIO, RATIO * RATIO].map(|periods| periods * samples.period);
    let tried = times.into_iter().enumerate().filter(|(i, seconds)| *i == 0 || *seconds < most);
    Ok(tried.map(|(_, seconds)| scan.with(&|e| set(e, seconds))).collect())
}

/// Returns the limit of detection; `meaning` says what the time is. A shorter time would not be named, however clearly
/// the record shows it.
pub(super) fn limit(limits: &Limits<'_>, meaning: &str, set: Set<'_>) -> Result<Option<Limit>, Error> {
    let s = limits.scan.problem.samples;
    let most = MAX_LIMIT_SHARE * s.longest_segment();
    let change = |seconds: f64| limits.scan.moved_with(&|e| set(e, seconds));
    let named = limits.margin * least_time(limits.scan.problem, limits.scan.from);
    let size = limits.size(s.period, most, limits.least, &change)?.map(|seconds| seconds.max(named));
    Ok(Some(Limit::of(size, "s", meaning.into())))
}

/// Returns whether a time \[s\] is long enough to be an effect of its own.
pub(super) fn is_long_enough(problem: &Problem<'_>, fit: &Fitted, seconds: f64) -> bool {
    seconds > least_time(problem, fit)
}

/// Returns the time above which an effect is one of its own \[s\].
fn least_time(problem: &Problem<'_>, fit: &Fitted) -> f64 {
    let samples = if fit.hypothesis.drag.is_some() { MIN_SAMPLES_BESIDE_DRAG } else { MIN_SAMPLES };
    samples * problem.samples.period
}
