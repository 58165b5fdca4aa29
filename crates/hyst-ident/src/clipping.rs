//! Rows in which the sensor stands at the end of its range.
//!
//! There it shows the same figure again and again, to the last digit, while elsewhere the last digits move: of the motion such
//! a row says only that it lies beyond. A mechanical stop or a held drive still has the sensor's noise on it.

use std::ops::Range;

use crate::samples::range;

/// Rows of the same figure that make the output stand.
const STANDS: usize = 10;
/// Share of the other rows that may stand too, if the last digits are said to move.
const STILL: f64 = 0.01;
/// Share of the other rows in which the third difference turns: three quarters in noise, few in a smooth motion without it.
const TURNS: f64 = 0.3;

/// Rows at an end of the sensor's range.
#[derive(Clone, Debug, PartialEq)]
pub struct Clipped {
    /// What the sensor shows there \[output unit\].
    pub at: f64,
    /// The rows, from 0, in uninterrupted intervals.
    pub intervals: Vec<Range<usize>>,
}

/// Marks the clipped rows of an output.
pub(crate) fn clipped_rows(output: &[f64], segments: &[Range<usize>]) -> Vec<bool> {
    let (low, high) = range(output.iter().copied());
    let (mut clipped, mut stands) = (vec![false; output.len()], 0);
    for s in segments {
        let mut end = s.start;
        for run in output[s.clone()].chunk_by(|a, b| a == b) {
            end += run.len();
            if run.len() >= STANDS {
                if run[0] == low || run[0] == high {
                    clipped[end - run.len()..end].fill(true);
                } else {
                    stands += run.len();
                }
            }
        }
    }
    // A play without noise stands at every turn, and so do digits that are coarser than the noise: that is no end of a range.
    let rows = segments.iter().flat_map(|s| s.start + 4..s.end).filter(|k| !clipped[*k]).count();
    if stands as f64 > STILL * rows as f64 || !last_digits_move(output, segments, &clipped) {
        clipped.fill(false);
    }
    clipped
}

/// Whether the last digits of an output move from row to row, in the rows that are not left out: it has noise beyond its digits.
pub(crate) fn last_digits_move(output: &[f64], segments: &[Range<usize>], left_out: &[bool]) -> bool {
    let inner = || segments.iter().flat_map(|s| s.start + 4..s.end).filter(|k| !left_out[*k]);
    let third = |k: usize| output[k] - 3.0 * output[k - 1] + 3.0 * output[k - 2] - output[k - 3];
    let turns = inner().filter(|k| third(*k) * third(k - 1) < 0.0).count();
    let rows = inner().count();
    rows > 0 && turns as f64 >= TURNS * rows as f64
}

/// The lower and the upper end of the sensor's range, where rows of an output lie at them.
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

    /// What is found in one segment.
    fn found_in(output: &[f64]) -> Vec<Clipped> {
        clipped(output, &[Range { start: 0, end: output.len() }])
    }

    /// A sine with moving last digits.
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
    fn plays_without_noise_stand_where_they_turn() {
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
    fn a_constant_output_is_another_fault() {
        assert_eq!(found_in(&[1.0; 100]), []);
    }
}
