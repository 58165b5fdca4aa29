//! Noise floor of a record, estimated from the record.

use std::ops::Range;

use realfft::RealFftPlanner;

use crate::criteria::MIN_RMSE_RATIO;

/// Minimum number of rows of a segment with a usable spectrum.
const MIN_SEGMENT_ROWS: usize = 64;

/// Returns the standard deviation of the white part of a residual \[its unit\].
///
/// The estimate uses differences between rows. A tone near half the sample rate increases it. If the median level of
/// the spectrum is far lower, that estimate is used instead.
pub fn noise_floor(residual: &[f64], segments: &[Range<usize>]) -> f64 {
    let between_rows = between_rows(residual, segments);
    let between_lines = between_lines(residual, segments);
    if MIN_RMSE_RATIO * between_lines < between_rows { between_lines } else { between_rows }
}

/// Estimates the white part from fourth differences, which remove everything smooth; the median of their magnitudes
/// ignores edges. White noise with standard deviation σ has fourth differences with standard deviation √70 σ, and the
/// median of |N(0, s²)| is 0.6745 s.
fn between_rows(residual: &[f64], segments: &[Range<usize>]) -> f64 {
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

/// Estimates the white part from the median line of the spectrum between a quarter and half of the sample rate. The
/// squared magnitude of a line of white noise is exponentially distributed with mean σ² Σw², w being the window; its
/// median is ln 2 times the mean.
fn between_lines(residual: &[f64], segments: &[Range<usize>]) -> f64 {
    let mut planner = RealFftPlanner::<f64>::new();
    let mut densities = Vec::new();
    for rows in segments.iter().map(|s| &residual[s.clone()]).filter(|rows| rows.len() >= MIN_SEGMENT_ROWS) {
        let fft = planner.plan_fft_forward(rows.len());
        let (mut input, mut output) = (fft.make_input_vec(), fft.make_output_vec());
        let mut weight = 0.0;
        for (k, (x, r)) in input.iter_mut().zip(rows).enumerate() {
            // A window with low side lobes, so that slow parts do not leak.
            let window = (std::f64::consts::PI * (k as f64 + 0.5) / rows.len() as f64).sin().powi(4);
            *x = window * r;
            weight += window * window;
        }
        // Cannot fail: the lengths come from the planner.
        if fft.process(&mut input, &mut output).is_ok() {
            let upper = output.len() / 2..output.len() - 1;
            densities.extend(output[upper].iter().map(|c| c.norm_sqr() / weight));
        }
    }
    if densities.is_empty() {
        return f64::INFINITY;
    }
    let middle = densities.len() / 2;
    let (_, median, _) = densities.select_nth_unstable_by(middle, f64::total_cmp);
    (*median / std::f64::consts::LN_2).sqrt()
}

/// Returns the standard deviation of the output's quantisation \[its unit\].
///
/// It is q/√12, with q the smallest gap between two of the values; next to zero if the values are not quantised.
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

    /// White noise with standard deviation 0.05 on a sine of this frequency \[cycles per row\] and height.
    fn noisy(rows: u32, frequency: f64, height: f64) -> Vec<f64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let sine = |k: u32| (std::f64::consts::TAU * frequency * f64::from(k)).sin();
        (0..rows).map(|k| height * sine(k) + 0.05 * normal()).collect()
    }

    #[test]
    fn white_noise_under_a_smooth_signal_is_measured() {
        let x = noisy(40_000, 0.003, 3.0);
        let rows = 0..x.len();
        let whole = std::slice::from_ref(&rows);
        for s in [noise_floor(&x, whole), between_lines(&x, whole)] {
            assert!((s / 0.05 - 1.0).abs() < 0.03, "{s}");
        }
    }

    #[test]
    fn a_tone_near_half_the_rate_does_not_raise_the_noise_floor() {
        for (rows, frequency) in [(4_000, 0.416_4), (900, 0.374_7)] {
            let x = noisy(rows, frequency, 0.5);
            let all = 0..x.len();
            let whole = std::slice::from_ref(&all);
            assert!(between_rows(&x, whole) > 0.2);
            let s = noise_floor(&x, whole);
            assert!((s / 0.05 - 1.0).abs() < 0.15, "{s}");
        }
    }
}
