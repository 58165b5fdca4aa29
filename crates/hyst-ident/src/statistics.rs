//! Minimum, maximum and quantiles of numbers.

/// Returns minimum and maximum; (∞, −∞) if there are no values.
pub fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// Returns the quantile `share` of some numbers; 0 without numbers. Reorders the numbers.
pub(crate) fn quantile(x: &mut [f64], share: f64) -> f64 {
    if x.is_empty() {
        return 0.0;
    }
    let at = (share * (x.len() - 1) as f64) as usize;
    *x.select_nth_unstable_by(at, f64::total_cmp).1
}
