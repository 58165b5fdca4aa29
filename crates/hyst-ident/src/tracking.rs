//! Computes how well an output follows its reference, as in scanning: the total error, the error near turning points
//! and between them, the error after the best constant delay, and gain and phase of each harmonic of a periodic
//! reference.

mod delay;
mod harmonics;

use std::ops::Range;

use serde::Serialize;

use crate::metrics::{Errors, MetricsError};
use crate::repetition::turns;
use crate::statistics::range;
use delay::{delay, shifted};
pub use harmonics::Harmonic;
use harmonics::harmonics;

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

/// Minimum size of a turn, as a share of the span of the reference.
const MIN_TURN_SHARE: f64 = 1e-2;
/// Rows near a turning point, as a share of the distance to the next one.
const NEAR_SHARE: f64 = 0.1;
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

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

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
