//! Features of the drive: holds, and rising and falling branches.

use std::ops::Range;

use crate::Samples;
use crate::noise::noise_floor;

/// A hold after a motion.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Hold {
    /// Its rows.
    pub(super) rows: Range<usize>,
    /// End of the hold before it: the motion is in between.
    pub(super) before: usize,
}

/// Whether the drive rises, falls or is at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Branch {
    Rising,
    Falling,
    AtRest,
}

/// The drive is at rest while it stays within this share of its span (or within its own noise) …
const MAX_REST_CHANGE: f64 = 5e-4;
/// … for this share of the longest segment and for this many rows: a slow turning point is no rest.
const MIN_REST_SHARE: f64 = 0.025;
const MIN_REST_ROWS: usize = 20;

/// Returns the rests of the drive, including those at the start of a segment.
fn rests(samples: &Samples) -> Vec<Range<usize>> {
    let (low, high) = samples.input_range();
    let room = (MAX_REST_CHANGE * (high - low)).max(4.0 * noise_floor(&samples.input, &samples.segments));
    let longest = samples.segments.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    let least = ((MIN_REST_SHARE * longest as f64) as usize).max(MIN_REST_ROWS);
    let mut found = Vec::new();
    for segment in &samples.segments {
        let mut start = segment.start;
        while start < segment.end {
            let level = samples.input[start];
            let length = samples.input[start..segment.end].iter().take_while(|u| (*u - level).abs() <= room).count();
            if length >= least {
                found.push(start..start + length);
                start += length;
            } else {
                // Large steps: in a slow motion every row would otherwise be examined many times.
                start += (length / 8).max(1);
            }
        }
    }
    found
}

/// Returns the rests that follow a motion.
pub(super) fn holds(samples: &Samples) -> Vec<Hold> {
    let rests = rests(samples);
    let mut found = Vec::new();
    for segment in &samples.segments {
        let mut before = segment.start;
        for rest in rests.iter().filter(|r| segment.contains(&r.start)) {
            if rest.start > segment.start {
                found.push(Hold { rows: rest.clone(), before });
            }
            before = rest.end - 1;
        }
    }
    found
}

/// Returns the rate of the drive at every row \[input unit/s\], over four sample periods.
pub(super) fn rates(samples: &Samples) -> Vec<f64> {
    let mut rates = vec![0.0; samples.len()];
    for (i, s) in samples.segments.iter().enumerate() {
        for k in s.clone() {
            let (a, b) = (k.saturating_sub(2).max(s.start), (k + 2).min(s.end - 1));
            let seconds = b.saturating_sub(a).max(1) as f64 * samples.period_of(i);
            rates[k] = (samples.input[b] - samples.input[a]) / seconds;
        }
    }
    rates
}

/// Returns the branch of every row.
pub(super) fn branches(samples: &Samples) -> Vec<Branch> {
    let mut branches: Vec<Branch> = rates(samples)
        .into_iter()
        .map(|r| match r {
            r if r > 0.0 => Branch::Rising,
            r if r < 0.0 => Branch::Falling,
            _ => Branch::AtRest,
        })
        .collect();
    for rest in rests(samples) {
        branches[rest].fill(Branch::AtRest);
    }
    branches
}

/// Returns a clock that continues from file to file, if each file has its own clock \[s\].
pub(super) fn clock(samples: &Samples) -> Vec<f64> {
    let (mut shift, mut last) = (0.0, f64::NEG_INFINITY);
    let mut clock = Vec::with_capacity(samples.len());
    for s in &samples.segments {
        let first = samples.time[s.start];
        if first + shift <= last {
            shift = last + samples.period - first;
        }
        clock.extend(samples.time[s.clone()].iter().map(|t| t + shift));
        last = clock.last().copied().unwrap_or(last);
    }
    clock
}

#[cfg(test)]
mod tests {
    use super::super::tests::samples_of;
    use super::*;

    #[test]
    fn holds_are_found_and_turning_points_are_not_holds() {
        // Rest, ramp, hold, ramp down, hold; then a slow cosine without any rest.
        let level = |k: usize| match k {
            0..100 => 0.0,
            100..200 => (k - 100) as f64,
            200..400 => 100.0,
            400..450 => 100.0 - (k - 400) as f64,
            _ => 50.0,
        };
        let stairs: Vec<f64> = (0..700).map(level).collect();
        let cosine: Vec<f64> = (0..2000).map(|k| 50.0 - 50.0 * (0.01 * f64::from(k)).cos()).collect();
        let samples = samples_of(1e-3, &[stairs, cosine]);
        let found = holds(&samples);
        assert_eq!(found, [Hold { rows: 200..401, before: 100 }, Hold { rows: 450..700, before: 400 }]);
        let branches = branches(&samples);
        assert_eq!([50, 150, 300, 430, 800, 1200].map(|k| branches[k]), {
            use Branch::{AtRest, Falling, Rising};
            [AtRest, Rising, AtRest, Falling, Rising, Falling]
        });
    }

    #[test]
    fn clocks_of_files_follow_each_other() {
        let mut samples = samples_of(0.5, &[vec![0.0; 3], vec![0.0; 2], vec![0.0; 2]]);
        samples.time = vec![0.0, 0.5, 1.0, 4.0, 4.5, 0.0, 0.5];
        assert_eq!(clock(&samples), [0.0, 0.5, 1.0, 4.0, 4.5, 5.0, 5.5]);
    }
}
