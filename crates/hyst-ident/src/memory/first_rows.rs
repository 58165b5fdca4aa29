//! Errors of a fit in the first rows of a segment, in comparison with other rows.

use crate::criteria::{LAW_ACCURACY, MIN_RMSE_RATIO, MINOR_SHARE};
use crate::metrics::rms;
use crate::samples::Samples;
use crate::settle::{centre, windows};

/// Returns which segments start away from 0 V. Near 0 V the memory is that of rest.
pub(crate) fn away(samples: &Samples) -> Vec<bool> {
    let (low, high) = samples.input_range();
    let reach = low.abs().max(high.abs());
    samples.segments.iter().map(|s| samples.input[s.start].abs() > MINOR_SHARE * reach).collect()
}

/// Returns which segments have a larger error in their first rows than in other rows. `residual` is that of a fit
/// without those rows.
pub(crate) fn standing_out(samples: &Samples, residual: &[f64]) -> Vec<bool> {
    first_rows(samples, residual).iter().map(|rows| rows.stand_out()).collect()
}

/// Returns the segments as [`standing_out`] does. Near 0 V a segment counts only if the fit follows the hysteresis in
/// the other rows: they do not contain the first rise of a virgin actuator, and a fit without a missing effect may have
/// a larger error there.
pub(crate) fn standing_out_where_followed(samples: &Samples, residual: &[f64]) -> Vec<bool> {
    let accuracy = LAW_ACCURACY * rms(&samples.hysteresis().1);
    let rows = first_rows(samples, residual);
    let counts = |(rows, away): (&FirstRows, bool)| {
        let is_followed = away || rows.usual <= rows.count as f64 * accuracy * accuracy;
        is_followed && rows.stand_out()
    };
    rows.iter().zip(away(samples)).map(counts).collect()
}

/// Errors of a fit in the first rows of a segment, and in as many other rows \[Σ residual²\].
struct FirstRows {
    count: usize,
    squares: f64,
    usual: f64,
}

impl FirstRows {
    fn stand_out(&self) -> bool {
        self.squares >= MIN_RMSE_RATIO * MIN_RMSE_RATIO * self.usual
    }
}

fn first_rows(samples: &Samples, residual: &[f64]) -> Vec<FirstRows> {
    let windows = windows(samples);
    let centred = centre(samples, residual, &windows, &samples.blind);
    let of = |i: usize| {
        let start = samples.segments[i].start;
        let rows: Vec<usize> = (start..start + windows[i]).filter(|k| !samples.blind[*k]).collect();
        let squares = rows.iter().map(|k| centred[*k] * centred[*k]).sum();
        FirstRows { count: rows.len(), squares, usual: level(samples, &centred, &windows, i) }
    };
    (0..samples.segments.len()).map(of).collect()
}

/// Returns the Σ residual² that the start-up window of a segment would have with the mean square of the rows outside of
/// all windows. `centred` is the residual without the sensor's zero.
pub(crate) fn level(samples: &Samples, centred: &[f64], windows: &[usize], segment: usize) -> f64 {
    let others = samples.segments.iter().zip(windows).flat_map(|(s, w)| s.start + w..s.end);
    let others = others.filter(|k| !samples.blind[*k]).map(|k| centred[k] * centred[k]);
    let (sum, rows) = others.fold((0.0, 0usize), |(sum, rows), square| (sum + square, rows + 1));
    let start = samples.segments[segment].start;
    let own = (start..start + windows[segment]).filter(|k| !samples.blind[*k]).count();
    sum * own as f64 / rows.max(1) as f64
}
