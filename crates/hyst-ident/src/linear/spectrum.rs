//! Computes the spectrum of one signal.

use std::ops::Range;

use super::{Hann, windows};

/// Approximate number of windows of an average.
const WINDOWS: usize = 8;
/// Maximum rows of a window: longer windows have lines that no plot resolves.
const MAX_WINDOW: usize = 1 << 14;

/// Returns the amplitude density of a signal by Welch's method with half-overlapping Hann windows: frequencies \[Hz\]
/// and `√(2 |X|² T / Σw²)` \[unit/√Hz\]. Empty if no segment has 32 rows.
pub fn amplitude_density(x: &[f64], segments: &[Range<usize>], period: f64) -> Vec<(f64, f64)> {
    let rows: usize = segments.iter().map(ExactSizeIterator::len).sum();
    let longest = segments.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    let length = (2 * rows / (WINDOWS + 1)).min(longest).min(MAX_WINDOW);
    if length < 32 {
        return Vec::new();
    }
    let hann = Hann::new(length);
    let mut power = vec![0.0; length / 2 + 1];
    let mut count = 0;
    for window in windows(segments, length) {
        let lines = hann.spectrum(&x[window]);
        power.iter_mut().zip(&lines).for_each(|(sum, line)| *sum += line.norm_sqr());
        count += 1;
    }
    let scale = 2.0 * period / (hann.energy() * f64::from(count));
    let frequency = |line: usize| line as f64 / (length as f64 * period);
    (1..power.len()).map(|line| (frequency(line), (scale * power[line]).sqrt())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_and_noise_have_their_power() {
        let x: Vec<f64> =
            (0..20_000).map(|k| 0.5 * (std::f64::consts::TAU * 50.0 * f64::from(k) * 1e-3).sin()).collect();
        let lines = amplitude_density(&x, &[0..10_000, 10_000..20_000], 1e-3);
        let step = lines[1].0 - lines[0].0;
        let power: f64 = lines.iter().map(|(_, a)| a * a * step).sum();
        assert!((power - 0.125).abs() < 0.002, "{power}");
        let (at, _) = lines.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((at - 50.0).abs() < 2.0 * step);
        assert!(amplitude_density(&x, std::slice::from_ref(&(0..20)), 1e-3).is_empty());
    }
}
