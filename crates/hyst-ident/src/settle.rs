//! Start-up rows: a transient from before the record.
//!
//! A model starts each segment at rest with virgin memory. A real record may start in another state: still ringing, or
//! with an unknown memory. The transient decays, or is erased once the input has swept its range. Until then the
//! residual says nothing about the model. Rows that are the only ones to pass a part of the range stay in the fit and
//! in the error.

use std::ops::Range;

use crate::Samples;
use crate::criteria::{DOMINANT_SHARE, LARGE_RATIO, MINOR_SHARE, NEGLIGIBLE_SHARE};
use crate::statistics::range;

/// Returns the length of the start-up window of each segment: twice the rows until the input has swept its range, at
/// most half of the segment.
pub(crate) fn windows(samples: &Samples) -> Vec<usize> {
    let window = |s: &Range<usize>| {
        let u = &samples.input[s.clone()];
        let (low, high) = range(u.iter().copied());
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        let swept = u.iter().position(|u| {
            (least, most) = (least.min(*u), most.max(*u));
            most - least >= DOMINANT_SHARE * (high - low)
        });
        (2 * swept.unwrap_or(0)).min(u.len() / 2)
    };
    samples.segments.iter().map(window).collect()
}

/// Number of levels into which the range of the input is divided.
const LEVELS: usize = 256;

/// The levels of the input that some rows pass.
#[derive(Clone, Copy)]
struct Levels([bool; LEVELS]);

impl Levels {
    const NONE: Self = Self([false; LEVELS]);

    /// Returns the level of an input between `low` and `high`.
    fn index(u: f64, (low, high): (f64, f64)) -> usize {
        // The conversion from float saturates and maps NaN to 0.
        (((u - low) / (high - low) * LEVELS as f64) as usize).min(LEVELS - 1)
    }

    /// Adds all levels between two levels.
    fn pass(&mut self, from: usize, to: usize) {
        self.0[from.min(to)..=from.max(to)].fill(true);
    }

    fn and(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] || other.0[i]))
    }

    /// Returns the share of the levels in `of` that these contain.
    fn share(&self, of: &Self) -> f64 {
        let all = of.0.iter().filter(|l| **l).count();
        let both = of.0.iter().zip(&self.0).filter(|(of, own)| **of && **own).count();
        both as f64 / all.max(1) as f64
    }
}

/// Returns the last row of each segment from which the rest of it still passes all of its levels but a negligible share,
/// together with the rows outside of the start-up windows of the other segments.
fn seen_again(samples: &Samples, windows: &[usize]) -> Vec<usize> {
    let span = samples.input_range();
    // Pairs of successive rows that the sensor shows, by the later one.
    let steps = |rows: Range<usize>| {
        let shown = rows.clone().skip(1).filter(|k| !samples.blind[*k] && !samples.blind[*k - 1]);
        shown.map(|k| (k, Levels::index(samples.input[k - 1], span), Levels::index(samples.input[k], span)))
    };
    let passed = |rows: Range<usize>| {
        let mut levels = Levels::NONE;
        steps(rows).for_each(|(_, from, to)| levels.pass(from, to));
        levels
    };
    let known: Vec<Levels> = samples.segments.iter().zip(windows).map(|(s, w)| passed(s.start + w..s.end)).collect();
    let gather = |all: &mut Levels, own: &Levels| Some(std::mem::replace(all, all.and(own)));
    let before = known.iter().scan(Levels::NONE, gather);
    let mut after: Vec<Levels> = known.iter().rev().scan(Levels::NONE, gather).collect();
    after.reverse();
    let rows = |((before, after), s): ((Levels, &Levels), &Range<usize>)| {
        let own = passed(s.clone());
        let mut seen = before.and(after);
        let mut share = seen.share(&own);
        let again = steps(s.clone()).collect::<Vec<_>>().into_iter().rev().find(|(_, from, to)| {
            if !seen.0[*from] || !seen.0[*to] {
                seen.pass(*from, *to);
                share = seen.share(&own);
            }
            share >= 1.0 - NEGLIGIBLE_SHARE
        });
        again.map_or(0, |(k, ..)| k - 1 - s.start)
    };
    before.zip(&after).zip(&samples.segments).map(rows).collect()
}

/// Marks the start-up windows of the segments that `of` selects by their index.
fn mark_windows(rows: &mut [bool], samples: &Samples, of: impl Fn(usize) -> bool) {
    for (_, (segment, window)) in samples.segments.iter().zip(windows(samples)).enumerate().filter(|(i, _)| of(*i)) {
        rows[segment.start..segment.start + window].fill(true);
    }
}

/// Returns the record with all start-up windows marked as start-up rows.
pub(crate) fn without_beginnings(samples: &Samples) -> Samples {
    let mut rest = samples.clone();
    mark_windows(&mut rest.settling, samples, |_| true);
    rest
}

/// Marks the start-up windows of the segments with start-up rows.
pub(crate) fn unknown_beginnings(samples: &Samples) -> Vec<bool> {
    let (mut unknown, starts) = (vec![false; samples.len()], started(samples, &samples.settling));
    if starts.contains(&true) {
        mark_windows(&mut unknown, samples, |i| starts[i]);
    }
    unknown
}

/// Returns the length of the first cycle of each segment: until its drive has swept its range and passes its first
/// value in the initial direction. Returns `None` if it never does.
pub(crate) fn first_cycles(samples: &Samples) -> Vec<Option<usize>> {
    let cycle = |s: &Range<usize>| {
        let u = &samples.input[s.clone()];
        let (low, high) = range(u.iter().copied());
        let start = *u.first()?;
        let rises = *u.iter().find(|u| **u != start)? > start;
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        u.windows(2).position(|u| {
            (least, most) = (least.min(u[1]), most.max(u[1]));
            let passes = if rises { u[0] < start && start <= u[1] } else { u[0] > start && start >= u[1] };
            passes && most - least >= DOMINANT_SHARE * (high - low)
        })
    };
    samples.segments.iter().map(|s| cycle(s).map(|before| before + 1)).collect()
}

/// Marks the start-up rows and the rows without valid sensor values, given measured minus predicted output. Rows that
/// are the only ones to pass a part of the range are not marked.
pub(crate) fn start_up_rows(samples: &Samples, residual: &[f64]) -> Vec<bool> {
    let (windows, blind) = (windows(samples), &samples.blind);
    let mut needed_from: Option<Vec<usize>> = None;
    let centred = centre(samples, residual, &windows, blind);
    let outside = || {
        let rows = samples.segments.iter().zip(&windows).flat_map(|(s, w)| s.start + w..s.end);
        rows.filter(|k| !blind[*k]).map(|k| centred[k])
    };
    let n = outside().count().max(1) as f64;
    let rms = (outside().map(|r| r * r).sum::<f64>() / n).sqrt();
    let largest = outside().fold(0.0f64, |m, r| m.max(r.abs()));
    let mut settling = blind.clone();
    let (low, high) = samples.input_range();
    for (i, (s, window)) in samples.segments.iter().zip(&windows).enumerate() {
        let rows: Vec<f64> = (s.start..s.start + window).map(|k| if blind[k] { 0.0 } else { centred[k] }).collect();
        if !rows.iter().any(|r| r.abs() > LARGE_RATIO * largest && r.abs() > 6.0 * rms) {
            continue;
        }
        let last = rows.iter().rposition(|r| r.abs() > largest.max(4.0 * rms)).unwrap_or(0);
        // From rest the memory is known. After the first branches, which may be virgin, a transient can only ring or
        // creep, and it decays. A later error, such as in a sweep through a mode, belongs to the record.
        let power = |rows: &[f64]| rows.iter().map(|r| r * r).sum::<f64>();
        let (first, second) = rows[..=last].split_at(last.div_ceil(2));
        let at_rest = samples.input[s.start].abs() < MINOR_SHARE * low.abs().max(high.abs());
        if at_rest && last > 2 * first_turn(&samples.input[s.clone()]) && power(first) < power(second) {
            continue;
        }
        // The transient continues below the level of the residual for about half of its visible duration.
        let needed_from = needed_from.get_or_insert_with(|| seen_again(samples, &windows))[i];
        let end = (last + last / 2 + 1).min(rows.len()).min(needed_from);
        settling[s.start..s.start + end].fill(true);
    }
    settling
}

/// Returns which segments have start-up rows.
pub(crate) fn started(samples: &Samples, settling: &[bool]) -> Vec<bool> {
    let starts = |s: &Range<usize>| s.clone().any(|k| settling[k] && !samples.blind[k]);
    samples.segments.iter().map(starts).collect()
}

/// Returns the number of rows until a drive from rest reverses for the first time.
fn first_turn(u: &[f64]) -> usize {
    let (low, high) = range(u.iter().copied());
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    let turned = u.iter().position(|u| {
        (least, most) = (least.min(*u), most.max(*u));
        (most - u).min(u - least) > NEGLIGIBLE_SHARE * (high - low)
    });
    turned.unwrap_or(u.len())
}

/// Returns the residual minus the mean of each file outside of the start-up windows: another sensor zero is no
/// transient.
pub(crate) fn centre(samples: &Samples, residual: &[f64], windows: &[usize], blind: &[bool]) -> Vec<f64> {
    let mut centred = residual.to_vec();
    for file in 0..samples.files() {
        let own =
            || samples.segments.iter().zip(windows).zip(&samples.file_of_segment).filter(move |(_, f)| **f == file);
        let (mut sum, mut n) = (0.0, 0usize);
        for ((s, w), _) in own() {
            for k in (s.start + w..s.end).filter(|k| !blind[*k]) {
                sum += residual[k];
                n += 1;
            }
        }
        let mean = sum / n.max(1) as f64;
        for ((s, _), _) in own() {
            centred[s.clone()].iter_mut().for_each(|r| *r -= mean);
        }
    }
    centred
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the number of start-up rows for a residual in a drive of many cycles from rest.
    fn missed(of: impl Fn(f64) -> f64) -> usize {
        let phase = |k: i32| std::f64::consts::TAU * f64::from(k) / 100.0;
        let input: Vec<f64> = (0..3000).map(|k| (1.0 - phase(k).cos()) * (0.2 + f64::from(k) / 3000.0)).collect();
        let samples = Samples::of_columns(1e-3, input.clone(), input);
        let residual: Vec<f64> = (0..3000).map(|k| of(f64::from(k)) + 0.01 * (0.7 * f64::from(k)).sin()).collect();
        count(&start_up_rows(&samples, &residual))
    }

    #[test]
    fn a_decay_from_the_first_row_is_start_up_and_a_later_error_is_not() {
        assert!((300..1000).contains(&missed(|k| (-k / 100.0).exp())), "{}", missed(|k| (-k / 100.0).exp()));
        // A sweep through a mode.
        assert_eq!(missed(|k| (-((k - 900.0) / 150.0).powi(2)).exp()), 0);
        // On the first branch, before the drive reverses.
        assert!(missed(|k| (-((k - 30.0) / 10.0).powi(2)).exp()) > 30);
    }

    /// Returns the number of rows of each segment that may be left out, for a drive through these corners with ten rows
    /// between two; the sensor does not show the rows in `hidden`.
    fn needed_from(corners: &[&[f64]], hidden: Range<usize>) -> Vec<usize> {
        let line = |w: &[f64]| (0..10).map(|i| w[0] + (w[1] - w[0]) * f64::from(i) / 10.0).collect::<Vec<_>>();
        let mut segments = Vec::new();
        let mut input: Vec<f64> = Vec::new();
        for corners in corners {
            let start = input.len();
            corners.windows(2).for_each(|w| input.extend(line(w)));
            input.extend(corners.last());
            segments.push(start..input.len());
        }
        let mut samples = Samples::of_columns(1e-3, input.clone(), input);
        samples.file_of_segment = vec![0; segments.len()];
        samples.pasts = vec![Vec::new(); segments.len()];
        samples.segments = segments;
        samples.blind[hidden].fill(true);
        seen_again(&samples, &windows(&samples))
    }

    #[test]
    fn rows_that_alone_pass_a_level_are_kept() {
        assert_eq!(needed_from(&[&[0.0, 1.0]], 0..0), [0], "one ramp");
        assert_eq!(needed_from(&[&[0.0, 1.0, 0.0, 1.0, 0.0]], 0..0), [30], "the last fall is enough");
        assert_eq!(needed_from(&[&[0.0, 1.0, 0.0, 1.0, 0.0]], 12..41), [0], "the sensor hides the repetition");
        // Each of two segments with a single sweep is start-up window in its first half.
        assert_eq!(needed_from(&[&[0.0, 1.0, 0.0], &[0.0, 1.0, 0.0]], 0..0), [19, 19], "either of two falls");
        assert_eq!(needed_from(&[&[0.0, 1.0], &[0.0, 1.0]], 0..0), [0, 0], "nothing else shows the lower halves");
        assert_eq!(needed_from(&[&[0.0, 1.0, 0.0, 1.0], &[4.0, 5.0, 4.0, 5.0]], 0..0), [20, 20], "apart");
        assert_eq!(needed_from(&[&[2.0, 2.0]], 0..0), [9], "a constant drive");
    }

    #[test]
    fn a_cycle_ends_at_the_first_value_in_the_initial_direction() {
        let cycle = |input: Vec<f64>| first_cycles(&Samples::of_columns(1e-3, input.clone(), input))[0];
        let sine =
            |phase: f64| (0..300).map(|k| (std::f64::consts::TAU * f64::from(k) / 100.0 + phase).sin()).collect();
        // One period for any phase.
        for phase in [0.3, 1.0, 2.0, 4.0] {
            assert!(
                cycle(sine(phase)).is_some_and(|rows| rows.abs_diff(100) <= 1),
                "{phase}: {:?}",
                cycle(sine(phase))
            );
        }
        assert_eq!(cycle((0..100).map(f64::from).collect()), None);
        assert_eq!(cycle(vec![1.0; 100]), None);
    }

    fn count(settling: &[bool]) -> usize {
        settling.iter().filter(|s| **s).count()
    }
}
