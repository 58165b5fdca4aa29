//! Rows in which the sensor is at the end of its range (clipping).
//!
//! There the sensor repeats one value to the last digit, while the last digits change in all other rows. The motion in
//! such a row is only known to be outside the range. At a mechanical stop or with a held drive, the sensor noise still
//! changes the last digits.

use std::ops::Range;

use crate::statistics::range;

/// Fewest equal rows in sequence that count as constant.
const MIN_CONSTANT_ROWS: usize = 10;
/// Largest share of constant rows inside the range. With more, an output without noise is assumed.
const MAX_CONSTANT_SHARE: f64 = 0.01;
/// Smallest share of rows in which the third difference changes its sign, for an output with noise. Noise has about
/// 75 %, a smooth motion without noise has few.
const MIN_SIGN_CHANGE_SHARE: f64 = 0.3;

/// Rows at one end of the sensor range.
#[derive(Clone, Debug, PartialEq)]
pub struct Clipped {
    /// The value of the sensor at this end \[output unit\].
    pub at: f64,
    /// The rows, counted from 0, in contiguous intervals.
    pub intervals: Vec<Range<usize>>,
}

/// Marks the clipped rows of an output.
pub(crate) fn clipped_rows(output: &[f64], segments: &[Range<usize>]) -> Vec<bool> {
    let (low, high) = range(output.iter().copied());
    let (mut clipped, mut constant) = (vec![false; output.len()], 0);
    for s in segments {
        let mut end = s.start;
        for run in output[s.clone()].chunk_by(|a, b| a == b) {
            end += run.len();
            if run.len() >= MIN_CONSTANT_ROWS {
                if run[0] == low || run[0] == high {
                    clipped[end - run.len()..end].fill(true);
                } else {
                    constant += run.len();
                }
            }
        }
    }
    // A play operator without noise is constant after every turn, and so are digits coarser than the noise. This is not
    // clipping.
    let rows = segments.iter().flat_map(|s| s.start + 4..s.end).filter(|k| !clipped[*k]).count();
    if constant as f64 > MAX_CONSTANT_SHARE * rows as f64 || !last_digits_move(output, segments, &clipped) {
        clipped.fill(false);
    }
    clipped
}

/// Returns whether the last digits of an output change from row to row, except in the rows `left_out`: the noise
/// exceeds the resolution.
pub(crate) fn last_digits_move(output: &[f64], segments: &[Range<usize>], left_out: &[bool]) -> bool {
    let inner = || segments.iter().flat_map(|s| s.start + 4..s.end).filter(|k| !left_out[*k]);
    let third = |k: usize| output[k] - 3.0 * output[k - 1] + 3.0 * output[k - 2] - output[k - 3];
    let sign_changes = inner().filter(|k| third(*k) * third(k - 1) < 0.0).count();
    let rows = inner().count();
    rows > 0 && sign_changes as f64 >= MIN_SIGN_CHANGE_SHARE * rows as f64
}

/// Finds the rows of an output at the lower and the upper end of the sensor range.
pub fn clipped(output: &[f64], segments: &[Range<usize>]) -> Vec<Clipped> {
    let marked = clipped_rows(output, segments);
    let (low, high) = range(output.iter().copied());
    let at = |end: f64| {
        let mut intervals: Vec<Range<usize>> = Vec::new();
        for row in (0..output.len()).filter(|k| marked[*k] && output[*k] == end) {
            match intervals.last_mut() {
                Some(interval) if interval.end == row => interval.end += 1,
                _ => intervals.push(row..row + 1),
            }
        }
        (!intervals.is_empty()).then_some(Clipped { at: end, intervals })
    };
    [at(low), at(high)].into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the clipped rows of one segment.
    fn found_in(output: &[f64]) -> Vec<Clipped> {
        clipped(output, &[Range { start: 0, end: output.len() }])
    }

    /// A sine with changing last digits.
    fn sine(rows: usize) -> Vec<f64> {
        (0..rows).map(|k| (0.01 * k as f64).sin() + 1e-4 * (1e4 * (k as f64).sqrt()).sin()).collect()
    }

    #[test]
    fn rows_at_the_ends_of_the_range_are_found() {
        let y: Vec<f64> = sine(2000).iter().map(|y| y.clamp(-2.0, 0.8)).collect();
        let found = found_in(&y);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].at, 0.8);
        assert_eq!(found[0].intervals.iter().map(Range::len).sum::<usize>(), y.iter().filter(|y| **y == 0.8).count());
        assert!(found[0].intervals.iter().all(|rows| y[rows.clone()].iter().all(|y| *y == 0.8)));
    }

    #[test]
    fn a_noisy_peak_and_coarse_digits_are_not_clipped() {
        assert_eq!(found_in(&sine(2000)), []);
        let coarse: Vec<f64> = sine(2000).iter().map(|y| (10.0 * y).round() / 10.0).collect();
        assert_eq!(found_in(&coarse), []);
    }

    #[test]
    fn a_play_operator_without_noise_is_not_clipped() {
        let mut p = 0.0;
        let y: Vec<f64> = (0..2000)
            .map(|k| (0.01 * f64::from(k)).sin())
            .map(|u| {
                p = hyst_core::play(p, u, 0.2);
                p
            })
            .collect();
        assert_eq!(found_in(&y), []);
    }

    #[test]
    fn a_constant_output_is_not_clipped() {
        assert_eq!(found_in(&[1.0; 100]), []);
    }
}
