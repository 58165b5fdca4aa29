//! Computes how well an output follows its reference, as in scanning: the total error, the error near turning points
//! and between them, the error after the best constant delay, and gain and phase of each harmonic of a periodic
//! reference.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::Complex;
use realfft::RealFftPlanner;
use serde::Serialize;

use crate::metrics::{Errors, MetricsError};
use crate::range;
use crate::repetition::turns;

/// Tracking errors of one run. Errors are reference minus output over all rows, unless noted otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tracking {
    /// Root mean square \[output unit\].
    pub rmse: f64,
    /// RMSE in percent of the span of the reference.
    pub nrmse_percent: f64,
    /// Maximum absolute error \[output unit\].
    pub max_abs: f64,
    /// RMSE over the last half, in which the start has less influence \[output unit\].
    pub rmse_last_half: f64,
    /// Mean of output minus reference: a zero, or the memory of earlier runs \[output unit\].
    pub mean: f64,
    /// RMSE about that mean \[output unit\].
    pub rmse_about_mean: f64,
    /// Delay by which the reference was shifted, if allowed \[s\].
    pub delay_s: Option<f64>,
    /// `None` if the reference has no turning point.
    pub turning: Option<Turning>,
    /// Harmonics of a reference that repeats one loop; otherwise empty.
    pub harmonics: Vec<Harmonic>,
}

/// The error near the turning points of the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Turning {
    /// Number of turning points.
    pub points: usize,
    /// Share of the time between two of them that counts as near, at each end \[%\].
    pub near_percent: f64,
    /// RMSE near them \[output unit\].
    pub rmse: f64,
    /// Maximum absolute error near them \[output unit\].
    pub max_abs: f64,
    /// RMSE of all other rows \[output unit\].
    pub rmse_between: f64,
}

/// One harmonic of a periodic reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Harmonic {
    /// Number; 1 is the fundamental.
    pub number: usize,
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Amplitude of the reference \[output unit\].
    pub amplitude: f64,
    /// Amplitude of the output divided by that of the reference.
    pub gain: f64,
    /// Phase of the output relative to the reference; negative if the output is late \[degrees\].
    pub phase_deg: f64,
}

/// Minimum size of a turn, as a share of the span of the reference.
const MIN_TURN_SHARE: f64 = 1e-2;
/// Rows near a turning point, as a share of the distance to the next one.
const NEAR_SHARE: f64 = 0.1;
/// Minimum amplitude of a harmonic, as a share of the strongest one.
const MIN_HARMONIC_SHARE: f64 = 5e-3;
/// Maximum count of harmonics.
const MAX_HARMONICS: usize = 8;
/// Highest number of a harmonic.
const MAX_HARMONIC_NUMBER: usize = 40;
/// Maximum deviation of the distances of turns in a periodic reference, as a share of its period.
const PERIOD_TOLERANCE: f64 = 0.01;
/// Maximum difference of the maxima, and of the minima, of a periodic reference, as a share of its span.
const EXTREMUM_TOLERANCE: f64 = 0.02;
/// Minimum difference of two sums of squares, relative to such a sum.
const ROUNDING: f64 = 1e-12;

impl Tracking {
    /// Computes the errors over all rows. Between `segments` the drive was at rest. With `allow_delay` the reference is
    /// shifted by the constant delay or lead with the smallest error.
    ///
    /// # Errors
    /// If the columns differ in length, are empty, or contain values that are not finite.
    pub fn of(
        wanted: &[f64],
        measured: &[f64],
        segments: &[Range<usize>],
        rate_hz: f64,
        allow_delay: bool,
    ) -> Result<Self, MetricsError> {
        Errors::of(wanted, measured, &vec![false; wanted.len()])?;
        let rows = |segment: &Range<usize>| segment.start.min(wanted.len())..segment.end.min(wanted.len());
        let segments: Vec<Range<usize>> = segments.iter().map(rows).collect();
        let delay = allow_delay.then(|| delay(wanted, measured, &segments));
        let late = delay.map(|delay| shifted(wanted, &segments, delay));
        let wanted = late.as_deref().unwrap_or(wanted);
        let errors = Errors::of(wanted, measured, &vec![false; wanted.len()])?;
        let error: Vec<f64> = wanted.iter().zip(measured).map(|(r, y)| r - y).collect();
        let mean = -error.iter().sum::<f64>() / error.len().max(1) as f64;
        let turns_of = turns_of(wanted, &segments);
        let longest = segments.iter().zip(&turns_of).max_by_key(|(segment, _)| segment.len());
        Ok(Self {
            rmse: errors.rmse,
            nrmse_percent: errors.nrmse_percent,
            max_abs: errors.max_abs,
            rmse_last_half: rms(error[error.len() / 2..].iter()),
            mean,
            rmse_about_mean: (errors.rmse * errors.rmse - mean * mean).max(0.0).sqrt(),
            delay_s: delay.map(|rows| rows / rate_hz),
            turning: Turning::of(&error, &segments, &turns_of),
            harmonics: longest.map_or_else(Vec::new, |(segment, turns)| {
                harmonics(&wanted[segment.clone()], &measured[segment.clone()], turns, rate_hz)
            }),
        })
    }
}

impl Turning {
    fn of(error: &[f64], segments: &[Range<usize>], turns: &[Vec<usize>]) -> Option<Self> {
        let mut near = vec![false; error.len()];
        for (segment, turns) in segments.iter().zip(turns) {
            let ends = std::iter::once(0).chain(turns.iter().copied()).chain([segment.len().saturating_sub(1)]);
            let ends: Vec<usize> = ends.collect();
            for w in ends.windows(3) {
                let before = (NEAR_SHARE * (w[1] - w[0]) as f64).round() as usize;
                let after = (NEAR_SHARE * w[2].saturating_sub(w[1]) as f64).round() as usize;
                let rows = segment.start + w[1] - before..(segment.start + w[1] + after + 1).min(segment.end);
                near[rows].fill(true);
            }
        }
        let points = turns.iter().map(Vec::len).sum();
        let at = |close: bool| error.iter().zip(&near).filter(move |(_, near)| **near == close).map(|(e, _)| e);
        (points > 0).then(|| Self {
            points,
            near_percent: 100.0 * NEAR_SHARE,
            rmse: rms(at(true)),
            max_abs: at(true).fold(0.0, |most, e| most.max(e.abs())),
            rmse_between: rms(at(false)),
        })
    }
}

/// Returns the rows at which the reference turns, relative to the first row of each segment.
fn turns_of(wanted: &[f64], segments: &[Range<usize>]) -> Vec<Vec<usize>> {
    let (low, high) = range(wanted.iter().copied());
    let of = |segment: &Range<usize>| {
        // A start at an extremum is not a turn.
        turns(&wanted[segment.clone()], MIN_TURN_SHARE * (high - low))
            .iter()
            .map(|(row, _)| *row)
            .filter(|row| *row > 0)
            .collect()
    };
    segments.iter().map(of).collect()
}

fn rms<'a>(error: impl Iterator<Item = &'a f64>) -> f64 {
    let (sum, rows) = error.fold((0.0, 0usize), |(sum, rows), e| (sum + e * e, rows + 1));
    (sum / rows.max(1) as f64).sqrt()
}

/// Returns the reference delayed by `rows`; the first and the last value are held.
fn shifted(wanted: &[f64], segments: &[Range<usize>], rows: f64) -> Vec<f64> {
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
fn delay(wanted: &[f64], measured: &[f64], segments: &[Range<usize>]) -> f64 {
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

/// Returns gain and phase over whole periods, from the first maximum (or minimum) to the last one; empty if the
/// reference is not periodic.
fn harmonics(wanted: &[f64], measured: &[f64], turns: &[usize], rate_hz: f64) -> Vec<Harmonic> {
    // A period is the distance of every second turn; at least two periods are required.
    let same_kind: Vec<usize> = turns.iter().copied().step_by(2).collect();
    let (Some(first), Some(last)) = (same_kind.first(), same_kind.last()) else { return Vec::new() };
    let periods = same_kind.len() - 1;
    let period = (last - first) as f64 / periods.max(1) as f64;
    let regular = |w: &[usize]| ((w[1] - w[0]) as f64 - period).abs() <= PERIOD_TOLERANCE * period + 1.0;
    let (low, high) = range(wanted.iter().copied());
    let is_alike = |from: usize| {
        let (low_turn, high_turn) = range(turns.iter().skip(from).step_by(2).map(|row| wanted[*row]));
        high_turn - low_turn <= EXTREMUM_TOLERANCE * (high - low)
    };
    if periods < 2 || !same_kind.windows(2).all(regular) || !is_alike(0) || !is_alike(1) {
        return Vec::new();
    }
    let highest = MAX_HARMONIC_NUMBER.min(((period / 2.0) as usize).saturating_sub(1));
    let of: Vec<(usize, Complex<f64>, Complex<f64>)> = (1..=highest)
        .map(|number| {
            let turn = TAU * number as f64 / period;
            let sum = |x: &[f64]| -> Complex<f64> {
                let rows = x[*first..*last].iter().enumerate();
                rows.map(|(k, x)| Complex::from_polar(*x, -turn * k as f64)).sum::<Complex<f64>>()
                    * (2.0 / (last - first) as f64)
            };
            (number, sum(wanted), sum(measured))
        })
        .collect();
    let strongest = of.iter().map(|(_, r, _)| r.norm()).fold(0.0, f64::max);
    of.into_iter()
        .filter(|(_, r, _)| r.norm() > 0.0 && r.norm() >= MIN_HARMONIC_SHARE * strongest)
        .take(MAX_HARMONICS)
        .map(|(number, r, y)| Harmonic {
            number,
            frequency_hz: number as f64 * rate_hz / period,
            amplitude: r.norm(),
            gain: y.norm() / r.norm(),
            phase_deg: (y / r).arg().to_degrees(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(t: f64) -> f64 {
        10.0 * (1.0 - (2.0 * t.rem_euclid(1.0) - 1.0).abs())
    }

    fn rows(of: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..5000).map(|k| of(5.0 * f64::from(k) / 5000.0)).collect()
    }

    fn whole() -> Vec<Range<usize>> {
        std::iter::once(0..5000).collect()
    }

    #[test]
    fn a_delay_is_found_and_removed() {
        let (wanted, measured) = (rows(triangle), rows(|t| triangle((t - 0.0123).max(0.0)) + 0.3));
        let of = |allow| Tracking::of(&wanted, &measured, &whole(), 1000.0, allow).unwrap();
        let (plain, late) = (of(false), of(true));
        assert!(plain.delay_s.is_none() && (late.delay_s.unwrap() - 0.0123).abs() < 1e-5, "{late:?}");
        assert!(
            (late.rmse - 0.3).abs() < 1e-3 && late.rmse_about_mean < 0.01 && plain.rmse_about_mean > 0.2,
            "{late:?}"
        );
        // A delay of 12.3 ms is 4.43° at 1 Hz, and three times that at 3 Hz.
        let phases: Vec<f64> = plain.harmonics.iter().map(|h| h.phase_deg / h.number as f64).collect();
        assert!(phases.len() > 4 && phases.iter().all(|p| (p + 360.0 * 0.0123).abs() < 0.05), "{phases:?}");
        assert!(late.harmonics.iter().all(|h| h.phase_deg.abs() < 0.5 && (h.gain - 1.0).abs() < 0.01), "{late:?}");
        let odd = plain.harmonics.iter().all(|h| h.number % 2 == 1 && (h.frequency_hz - h.number as f64).abs() < 1e-9);
        assert!(odd, "{plain:?}");
    }

    #[test]
    fn a_delay_beyond_a_step_and_beyond_half_a_period_is_found() {
        let stairs = |t: f64| 2.0 * (10.0 * triangle(0.2 * t)).floor() / 10.0;
        // 30 Hz, and a delay of more than half its period.
        let fast = |t: f64| triangle(30.0 * t) * (1.0 + 0.1 * t);
        for (reference, delay) in [(&stairs as &dyn Fn(f64) -> f64, 0.25), (&fast, 0.021), (&fast, -0.021)] {
            let (wanted, measured) = (rows(reference), rows(|t| reference((t - delay).clamp(0.0, 4.999)) + 0.1));
            let found = Tracking::of(&wanted, &measured, &whole(), 1000.0, true).unwrap();
            assert!(
                (found.delay_s.unwrap() - delay).abs() < 1e-4 && found.rmse_about_mean < 0.02,
                "{delay}: {found:?}"
            );
        }
    }

    #[test]
    fn a_growing_or_decaying_reference_has_no_harmonics() {
        let wanted = rows(|t| (-0.3 * t).exp() * (TAU * 5.0 * t).sin());
        let found = Tracking::of(&wanted, &wanted, &whole(), 1000.0, false).unwrap();
        assert!(found.turning.is_some() && found.harmonics.is_empty(), "{found:?}");
    }

    #[test]
    fn rounded_corners_are_an_error_at_the_turning_points() {
        // The reference starts and ends between two corners.
        let wanted = rows(|t| triangle(t + 0.25));
        let measured = rows(|t| (-30..=30).map(|k| triangle(t + 0.25 + 1e-3 * f64::from(k))).sum::<f64>() / 61.0);
        let turning = Tracking::of(&wanted, &measured, &whole(), 1000.0, false).unwrap().turning.unwrap();
        assert_eq!(turning.points, 10);
        assert!(turning.rmse > 10.0 * turning.rmse_between && turning.max_abs > 0.25, "{turning:?}");
    }

    #[test]
    fn stairs_and_single_ramps_have_no_turns_and_no_harmonics() {
        let stairs = rows(|t| t.floor());
        let found = Tracking::of(&stairs, &stairs, &[0..2000, 2000..5000], 1000.0, true).unwrap();
        assert_eq!((found.rmse, found.turning, found.harmonics.len()), (0.0, None, 0));
        assert_eq!(found.delay_s, Some(0.0));
        Tracking::of(&stairs, &stairs[1..], &whole(), 1000.0, true).unwrap_err();
    }
}
