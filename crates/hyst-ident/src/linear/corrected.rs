//! Loops without the structure's share: its phase lag and gain at the drive's frequency removed before hysteresis is judged
//! (paper 2, Fig. 12 and 13).

use std::f64::consts::TAU;

use serde::Serialize;

use super::LinearError;
use super::error::require;
use super::fundamental::strongest;

/// How far a loop is from a straight line, in percent of the output's span.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LoopFigures {
    /// Greatest opening between rising and falling branch at the same wanted value, over levels from 10 to 90 %.
    pub width_percent: f64,
    /// Root mean square of what the best straight line misses.
    pub rmse_percent: f64,
}

/// A loop before and after the correction.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrectedLoop {
    /// Frequency of the drive \[Hz\].
    pub hz: f64,
    /// Whole cycles that the figures are over; the first of the record is left out as start-up.
    pub cycles: usize,
    /// Gain that was removed \[y/x\].
    pub gain: f64,
    /// As measured.
    pub raw: LoopFigures,
    /// Without the structure's phase and gain.
    pub corrected: LoopFigures,
    /// The wanted value x of each row.
    pub wanted: Vec<f64>,
    /// Measured output of each row.
    pub measured: Vec<f64>,
    /// The output without the structure's lag, offset and gain: on the scale of x.
    pub straightened: Vec<f64>,
}

/// Removes a structure's phase (negative for a lag, \[rad\]) at the drive's frequency from `y`, as a shift in time, and its gain
/// and offset, by a straight line fitted to `x`, and measures the loop of `y` over `x` before and after. `x` is the drive, or
/// the reference that an inversion was to follow.
///
/// The phase has to be the structure's own, from a linear model or a drive too small for hysteresis: the lag of the
/// fundamental of a large sine is for a part the very loop that is to be judged.
///
/// # Errors
/// When `x` is no sine of two cycles or more, or a number is out of range.
pub fn corrected_loop(
    period: f64,
    x: &[f64],
    y: &[f64],
    hz: Option<f64>,
    phase: f64,
) -> Result<CorrectedLoop, LinearError> {
    require("phase", phase.to_degrees(), phase.abs() <= TAU, "between -360 and 360 degrees")?;
    let no_sine = |reason: &str| LinearError::NoSine { reason: reason.into() };
    let hz = hz.or_else(|| strongest(x, period)).ok_or_else(|| no_sine("it does not move"))?;
    require("hz", hz, hz.is_finite() && hz > 0.0, "a positive number")?;
    let cycle = 1.0 / (hz * period);
    let shift = -phase / TAU * cycle;
    let start = cycle.round() as usize;
    let room = x.len().min(y.len()) as f64 - cycle - shift.abs() - 3.0;
    let cycles = (room / cycle).floor();
    if !(cycles >= 1.0 && cycle >= 12.0) {
        return Err(no_sine("it takes two cycles of at least 12 rows"));
    }
    // A lead is taken from the first cycle, which no figure is of.
    let rows = start..start + (cycles * cycle).round() as usize;
    let wanted = x[rows.clone()].to_vec();
    let measured = y[rows.clone()].to_vec();
    let shifted: Vec<f64> = rows.map(|t| between(y, t as f64 + shift)).collect();
    let raw = line(&wanted, &measured);
    let (offset, gain, corrected) = line(&wanted, &shifted);
    Ok(CorrectedLoop {
        hz,
        cycles: cycles as usize,
        gain,
        raw: figures(&wanted, &measured, raw.2),
        corrected: figures(&wanted, &shifted, corrected),
        straightened: shifted.iter().map(|y| (y - offset) / gain).collect(),
        wanted,
        measured,
    })
}

/// The value at a place between two rows: the cubic through the four rows around it.
fn between(y: &[f64], at: f64) -> f64 {
    let i = (at.floor().max(1.0) as usize).min(y.len() - 3);
    let x = at - i as f64;
    let [a, b, c, d] = [y[i - 1], y[i], y[i + 1], y[i + 2]];
    let third = (d - a) / 6.0 + (b - c) / 2.0;
    let second = (a + c) / 2.0 - b;
    let first = c - b - second - third;
    ((third * x + second) * x + first) * x + b
}

/// Offset and slope of the best straight line, and the root mean square of what it misses.
fn line(x: &[f64], y: &[f64]) -> (f64, f64, f64) {
    let n = x.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (mx, my) = (mean(x), mean(y));
    let xx = x.iter().map(|x| (x - mx).powi(2)).sum::<f64>();
    let slope = x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>() / xx.max(f64::MIN_POSITIVE);
    let missed = x.iter().zip(y).map(|(x, y)| (y - my - slope * (x - mx)).powi(2)).sum::<f64>();
    (my - slope * mx, slope, (missed / n).sqrt())
}

fn figures(x: &[f64], y: &[f64], missed: f64) -> LoopFigures {
    let (low, high) = crate::samples::range(x.iter().copied());
    let (least, most) = crate::samples::range(y.iter().copied());
    let span = (most - least).max(f64::MIN_POSITIVE);
    let width = (2..=18)
        .map(|i| low + (high - low) * f64::from(i) / 20.0)
        .filter_map(|level| Some((mean_at(x, y, level, true)? - mean_at(x, y, level, false)?).abs()))
        .fold(0.0, f64::max);
    LoopFigures { width_percent: 100.0 * width / span, rmse_percent: 100.0 * missed / span }
}

/// Mean of y where x passes a level upwards or downwards.
fn mean_at(x: &[f64], y: &[f64], level: f64, rising: bool) -> Option<f64> {
    let passed = x.windows(2).zip(y.windows(2)).filter_map(|(x, y)| {
        let through = if rising { x[0] < level && x[1] >= level } else { x[0] > level && x[1] <= level };
        through.then(|| y[0] + (y[1] - y[0]) * (level - x[0]) / (x[1] - x[0]))
    });
    let (sum, count) = passed.fold((0.0, 0_u32), |(sum, count), y| (sum + y, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}
