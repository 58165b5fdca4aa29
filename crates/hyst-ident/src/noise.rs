//! The noise floor of a record, from the record itself.

use std::ops::Range;

/// Standard deviation of the white part of a residual \[its unit\].
///
/// Fourth differences remove everything smooth; their median magnitude ignores edges. White noise of
/// deviation σ gives fourth differences of deviation √70 σ, and the median of |N(0, s²)| is 0.6745 s.
pub fn noise_floor(residual: &[f64], segments: &[Range<usize>]) -> f64 {
    let mut magnitudes: Vec<f64> = segments
        .iter()
        .flat_map(|s| residual[s.clone()].windows(5))
        .map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs())
        .collect();
    if magnitudes.is_empty() {
        return 0.0;
    }
    let middle = magnitudes.len() / 2;
    let (_, median, _) = magnitudes.select_nth_unstable_by(middle, f64::total_cmp);
    *median / 0.6745 / 70f64.sqrt()
}

/// Standard deviation that the output's own steps bring \[its unit\]: q/√12 with q the smallest gap between two of its
/// values. Next to nothing where values are not quantised.
pub fn quantisation(output: &[f64]) -> f64 {
    let mut sorted = output.to_vec();
    sorted.sort_by(f64::total_cmp);
    let gaps = sorted.windows(2).map(|w| w[1] - w[0]).filter(|gap| *gap > 0.0);
    let smallest = gaps.fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { smallest / 12f64.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn white_noise_under_a_smooth_signal_is_measured() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let x: Vec<f64> = (0..40_000).map(|k| 3.0 * (0.02 * f64::from(k)).sin() + 0.05 * normal()).collect();
        let s = noise_floor(&x, std::slice::from_ref(&(0..x.len())));
        assert!((s / 0.05 - 1.0).abs() < 0.03, "{s}");
    }
}
