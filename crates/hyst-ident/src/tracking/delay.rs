//! The constant delay of an output behind its reference.

use std::ops::Range;

use realfft::RealFftPlanner;

/// Minimum difference of two sums of squares, relative to such a sum.
const ROUNDING: f64 = 1e-12;

/// Returns the reference delayed by `rows`; the first and the last value are held.
pub(super) fn shifted(wanted: &[f64], segments: &[Range<usize>], rows: f64) -> Vec<f64> {
    let mut late = wanted.to_vec();
    for segment in segments {
        let of = &wanted[segment.clone()];
        let last = of.len().saturating_sub(1);
        for (k, to) in late[segment.clone()].iter_mut().enumerate() {
            let at = (k as f64 - rows).clamp(0.0, last as f64);
            let (row, share) = (at as usize, at.fract());
            *to = of[row] + share * (of[(row + 1).min(last)] - of[row]);
        }
    }
    late
}

/// Returns the delay with the smallest error about its mean \[rows\]: integer rows from the correlation, fractions by
/// Gauss-Newton on r(t − d) − y with step halving.
pub(super) fn delay(wanted: &[f64], measured: &[f64], segments: &[Range<usize>]) -> f64 {
    let about_mean = |late: &[f64]| -> (Vec<f64>, f64) {
        let mut error: Vec<f64> = late.iter().zip(measured).map(|(r, y)| r - y).collect();
        let mean = error.iter().sum::<f64>() / error.len().max(1) as f64;
        error.iter_mut().for_each(|e| *e -= mean);
        let squares = error.iter().map(|e| e * e).sum();
        (error, squares)
    };
    // The delay is at most half of the shortest segment.
    let most = segments.iter().map(Range::len).min().unwrap_or(0) / 2;
    let mut delay = whole_delay(wanted, measured, segments, most) as f64;
    let most = most as f64;
    let (mut error, mut squares) = about_mean(&shifted(wanted, segments, delay));
    for _ in 0..50 {
        let half = 0.5;
        let (before, after) = (shifted(wanted, segments, delay - half), shifted(wanted, segments, delay + half));
        let slope: Vec<f64> = after.iter().zip(&before).map(|(a, b)| a - b).collect();
        let mean = slope.iter().sum::<f64>() / slope.len().max(1) as f64;
        let own: f64 = slope.iter().map(|s| (s - mean) * (s - mean)).sum();
        if own == 0.0 {
            break;
        }
        let mut step = -slope.iter().zip(&error).map(|(s, e)| (s - mean) * e).sum::<f64>() / own;
        let better = loop {
            let at = (delay + step).clamp(-most, most);
            let (trial, sum) = about_mean(&shifted(wanted, segments, at));
            if sum < squares {
                (delay, error, squares) = (at, trial, sum);
                break true;
            }
            step /= 2.0;
            if step.abs() < 1e-4 {
                break false;
            }
        };
        if !better || step.abs() < 1e-3 {
            break;
        }
    }
    delay
}

/// Returns the delay of the reference in integer rows, from `-most` to `most`, with the smallest error about its mean.
/// Computes all of them at once by a Fourier transform.
fn whole_delay(wanted: &[f64], measured: &[f64], segments: &[Range<usize>], most: usize) -> i64 {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let (mean_r, mean_y) = (mean(wanted), mean(measured));
    // Sums of r(t − d), of its square, and of its product with y, for each delay from −most to most.
    let lags = 2 * most + 1;
    let (mut sums, mut squares, mut products) = (vec![0.0; lags], vec![0.0; lags], vec![0.0; lags]);
    for segment in segments {
        let r: Vec<f64> = wanted[segment.clone()].iter().map(|x| x - mean_r).collect();
        let y: Vec<f64> = measured[segment.clone()].iter().map(|x| x - mean_y).collect();
        let (Some(first), Some(last)) = (r.first().copied(), r.last().copied()) else { continue };
        let n = r.len();
        let correlation = correlation(&r, &y);
        let running = |x: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
            std::iter::once(0.0)
                .chain(x.scan(0.0, |sum, x| {
                    *sum += x;
                    Some(*sum)
                }))
                .collect()
        };
        let (of_r, of_y) = (running(&mut r.iter().copied()), running(&mut y.iter().copied()));
        let of_squares = running(&mut r.iter().map(|r| r * r));
        for lag in 0..lags {
            // The reference is held at its first value before its start, and at its last value after its end.
            let (held, rows, from, y_held) = if lag >= most {
                let late = lag - most;
                (first, late, 0..n - late, of_y[late])
            } else {
                let early = most - lag;
                (last, early, early..n, of_y[n] - of_y[n - early])
            };
            sums[lag] += of_r[from.end] - of_r[from.start] + rows as f64 * held;
            squares[lag] += of_squares[from.end] - of_squares[from.start] + rows as f64 * held * held;
            products[lag] += correlation[(lag + correlation.len() - most) % correlation.len()] + held * y_held;
        }
    }
    let n = wanted.len().max(1) as f64;
    let error = |lag: usize| squares[lag] - 2.0 * products[lag] - sums[lag] * sums[lag] / n;
    // If delays have equal errors, take the shortest. A difference of rounding errors does not count.
    let scale = squares.iter().copied().fold(0.0, f64::max);
    let mut best = most;
    for off in 1..=most {
        for lag in [most + off, most - off] {
            if error(lag) < error(best) - ROUNDING * scale {
                best = lag;
            }
        }
    }
    best as i64 - most as i64
}

/// Returns Σ r(k) y(k + d), at index d for d ≥ 0 and at length + d for d < 0.
fn correlation(r: &[f64], y: &[f64]) -> Vec<f64> {
    let length = (2 * r.len()).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, back) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let spectrum = |x: &[f64]| {
        let mut padded = x.to_vec();
        padded.resize(length, 0.0);
        let mut spectrum = forward.make_output_vec();
        // Cannot fail: the lengths come from the plan.
        let _ = forward.process(&mut padded, &mut spectrum);
        spectrum
    };
    let mut product: Vec<_> =
        spectrum(r).into_iter().zip(spectrum(y)).map(|(r, y)| r.conj() * y / length as f64).collect();
    // The first and the middle line of a real signal are real: removes the rounding error.
    for at in [0, length / 2] {
        product[at].im = 0.0;
    }
    let mut correlation = back.make_output_vec();
    let _ = back.process(&mut product, &mut correlation);
    correlation
}
