//! Removes the phase lag and the gain of the structure at the frequency of the drive from a loop, to show the
//! hysteresis (paper 2, Fig. 12 and 13).

use std::f64::consts::TAU;

use serde::Serialize;

use super::LinearError;
use super::error::require;
use super::fundamental::strongest;

/// Deviation of a loop from a straight line, in percent of the span of the output.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LoopFigures {
    /// Maximum distance of rising and falling branch at the same value of x, over levels from 10 to 90 %.
    pub width_percent: f64,
    /// RMS residual of the best straight line.
    pub rmse_percent: f64,
}

/// A loop before and after the correction.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrectedLoop {
    /// Frequency of the drive \[Hz\].
    pub hz: f64,
    /// Number of cycles that were evaluated; the first one of the record is left out as start-up.
    pub cycles: usize,
    /// Removed gain \[y/x\].
    pub gain: f64,
    /// Without correction.
    pub raw: LoopFigures,
    /// Without phase and gain of the structure.
    pub corrected: LoopFigures,
    /// x of each row.
    pub wanted: Vec<f64>,
    /// Measured output of each row.
    pub measured: Vec<f64>,
    /// Output without lag, offset and gain of the structure, on the scale of x.
    pub straightened: Vec<f64>,
}

/// Removes the phase of a structure (negative for a lag, \[rad\]) at the frequency of the drive from `y` by a shift in
/// time, and its gain and offset by a straight line fitted to `x`. Measures the loop of `y` over `x` before and after.
/// `x` is the drive, or the reference of an inversion.
///
/// The phase must be that of the structure, from a linear model or from a drive too small for hysteresis: the phase lag
/// of the fundamental of a large sine contains the hysteresis.
///
/// # Errors
/// If `x` is not a sine of two cycles or more, or a number is out of range.
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
        return Err(no_sine("two cycles of at least 12 rows are needed"));
    }
    // For a phase lead, rows of the first cycle are used, which is not evaluated.
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

/// Returns the value between two rows, from the cubic through the four nearest rows.
fn between(y: &[f64], at: f64) -> f64 {
    let i = (at.floor().max(1.0) as usize).min(y.len() - 3);
    let x = at - i as f64;
    let [a, b, c, d] = [y[i - 1], y[i], y[i + 1], y[i + 2]];
    let third = (d - a) / 6.0 + (b - c) / 2.0;
    let second = (a + c) / 2.0 - b;
    let first = c - b - second - third;
    ((third * x + second) * x + first) * x + b
}

/// Returns offset and slope of the best straight line, and its RMS residual.
fn line(x: &[f64], y: &[f64]) -> (f64, f64, f64) {
    let n = x.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (mx, my) = (mean(x), mean(y));
    let xx = x.iter().map(|x| (x - mx).powi(2)).sum::<f64>();
    let slope = x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>() / xx.max(f64::MIN_POSITIVE);
    let squares = x.iter().zip(y).map(|(x, y)| (y - my - slope * (x - mx)).powi(2)).sum::<f64>();
    (my - slope * mx, slope, (squares / n).sqrt())
}

fn figures(x: &[f64], y: &[f64], residual: f64) -> LoopFigures {
    let (low, high) = crate::statistics::range(x.iter().copied());
    let (least, most) = crate::statistics::range(y.iter().copied());
    let span = (most - least).max(f64::MIN_POSITIVE);
    let width = (2..=18)
        .map(|i| low + (high - low) * f64::from(i) / 20.0)
        .filter_map(|level| Some((mean_at(x, y, level, true)? - mean_at(x, y, level, false)?).abs()))
        .fold(0.0, f64::max);
    LoopFigures { width_percent: 100.0 * width / span, rmse_percent: 100.0 * residual / span }
}

/// Returns the mean of y where x crosses a level upwards or downwards.
fn mean_at(x: &[f64], y: &[f64], level: f64, rising: bool) -> Option<f64> {
    let crossings = x.windows(2).zip(y.windows(2)).filter_map(|(x, y)| {
        let crosses = if rising { x[0] < level && x[1] >= level } else { x[0] > level && x[1] <= level };
        crosses.then(|| y[0] + (y[1] - y[0]) * (level - x[0]) / (x[1] - x[0]))
    });
    let (sum, count) = crossings.fold((0.0, 0_u32), |(sum, count), y| (sum + y, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}
