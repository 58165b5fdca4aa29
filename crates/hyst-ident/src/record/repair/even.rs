//! Segments after interruptions, and even times in each segment.

use std::ops::Range;

use super::cubic::monotone;
use super::rows::{Repaired, channels, keep, relabel, rows_word};
use super::steps::{Times, is_irregular, split_at_gaps};
use crate::record::assembly::Columns;
use crate::record::grid::Printed;

/// Largest deviation from an even grid that the note calls jitter \[periods, rms\].
const MAX_JITTER: f64 = 0.2;

/// Begins a segment after each interruption and resamples uneven times. Irregular times are left to later checks.
pub(super) fn make_even(
    samples: &mut Columns,
    printed: &mut Printed,
    done: &mut Repaired,
    mut segments: Vec<Range<usize>>,
) {
    let rows = samples.time.len();
    let mut gaps = Vec::new();
    segments = segments.into_iter().flat_map(|rows| split_at_gaps(&samples.time, rows, &mut gaps)).collect();
    if !gaps.is_empty() {
        let alone = segments.iter().filter(|rows| rows.len() < 2).count();
        let longest = gaps.iter().fold(0.0_f64, |m, g| m.max(*g));
        let before = |row: &usize| samples.time[*row] - samples.time[row - 1] == longest;
        let at = (1..rows).find(before).map_or(0, |row| done.row(row) + 1);
        let what = match gaps.len() {
            1 => format!("an interruption of {longest:.3} s before row {at}: a segment begins there"),
            more => format!(
                "{more} interruptions of up to {longest:.3} s (the longest before row {at}): a segment begins after each"
            ),
        };
        done.note(format!("{what}; the state of the actuator at its start is estimated"));
        if alone > 0 && alone < segments.len() {
            let mut kept = vec![true; rows];
            segments.iter().filter(|rows| rows.len() < 2).for_each(|rows| kept[rows.clone()].fill(false));
            relabel(samples, &segments);
            keep(samples, done, &kept);
            done.note(format!("{} between two interruptions: left out", rows_word(alone)));
        } else {
            relabel(samples, &segments);
        }
    }
    if let Times::Uneven(segments) = Times::of(samples, *printed) {
        // Later checks refuse times that do not follow a grid.
        if segments.iter().any(|rows| is_irregular(&samples.time[rows.clone()])) {
            return;
        }
        let (rms, most) = resample(samples, done, &segments);
        *printed = Printed::EXACT;
        let what = if rms > MAX_JITTER { "times are uneven: they deviate from an even grid" } else { "times jitter" };
        done.note(format!(
            "{what} by {:.2} % of a sample period (rms; at most {:.2} %): resampled to even steps by a monotone cubic",
            100.0 * rms,
            100.0 * most
        ));
    }
}

/// Resamples each segment to an even grid with the same number of rows.
///
/// Returns the rms and the maximum deviation of the times from the grid \[periods\].
fn resample(samples: &mut Columns, done: &mut Repaired, segments: &[Range<usize>]) -> (f64, f64) {
    let old = samples.time.clone();
    let (mut squares, mut most) = (0.0, 0.0_f64);
    let mut periods: Vec<f64> = Vec::new();
    for rows in segments.iter().filter(|rows| rows.len() >= 2) {
        let t = &old[rows.clone()];
        periods.push((t[t.len() - 1] - t[0]) / (t.len() - 1) as f64);
    }
    // Segments with nearly the same rate get one period, the median.
    let median = {
        let mut sorted = periods.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    for rows in segments.iter().filter(|rows| rows.len() >= 2) {
        let t = &old[rows.clone()];
        let own = (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64;
        let shared = (own - median).abs() * (t.len() - 1) as f64;
        let h = round_period(if shared < 0.5 * median { median } else { own }, t);
        for (k, row) in rows.clone().enumerate() {
            let even = t[0] + k as f64 * h;
            let off = (old[row] - even) / h;
            squares += off * off;
            most = most.max(off.abs());
            samples.time[row] = even;
        }
    }
    let time = samples.time.clone();
    if !done.missing.is_empty() {
        let old_missing = done.missing.clone();
        for rows in segments {
            for row in rows.clone() {
                let after = rows.start + old[rows.clone()].partition_point(|t| *t < time[row]);
                let near = |row: usize| old_missing[row.clamp(rows.start, rows.end - 1)];
                done.missing[row] = near(after) || near(after.saturating_sub(1));
            }
        }
    }
    for values in channels(samples) {
        for rows in segments.iter().filter(|rows| rows.len() >= 2) {
            let moved = monotone(&old[rows.clone()], &values[rows.clone()], &time[rows.clone()]);
            values[rows.clone()].copy_from_slice(&moved);
        }
    }
    done.changed = true;
    done.resampled = true;
    ((squares / old.len() as f64).sqrt(), most)
}

/// Returns the period of the nearest whole rate \[Hz\], if the times of a segment do not distinguish it from `h`.
fn round_period(h: f64, t: &[f64]) -> f64 {
    let rate = (1.0 / h).round();
    let whole = 1.0 / rate;
    if rate >= 1.0 && (whole - h).abs() * (t.len() - 1) as f64 <= 0.5 * h { whole } else { h }
}
