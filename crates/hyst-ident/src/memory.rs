//! Where the drive was before a segment began.
//!
//! A model's memory is virgin at the start of a segment. An actuator that was cycled before the record began, or that rests away from 0 V, remembers
//! something else. Of all that happened, a memory that wipes out keeps only the extremes that are in force (Mayergoyz, Mathematical Models of Hysteresis,
//! 1991), so few turns of the drive describe it. They are the initial condition of the record, and are estimated from its first rows, like that of any
//! dynamic system.

use std::ops::Range;

use rayon::prelude::*;

use crate::base::{Basis, Drag};
use crate::nested::Fitted;
use crate::samples::{Samples, range};
use crate::settle::{AT_REST, first_cycles, started, windows};

/// Levels at which the drive may have turned, over the range of the record.
const LEVELS: usize = 13;
/// And on either side of it.
const BEYOND: usize = 6;
/// Turns of a decaying drive, as one that demagnetises.
const DECAY: usize = 16;
/// Amplitudes of such a drive.
const AMPLITUDES: usize = 6;
/// Rows from one turn to the next.
const ROWS: usize = 16;
/// RMS residual of the first rows from rest over that after a past, from which on the past is taken: where it explains less, something else acts, a
/// transient of the sensor or an effect that is missing.
const HELPS: f64 = 2.0;

/// Pasts of a segment that begins at `u0` \[V\], as the drive went from 0 V on until then, without `u0` itself.
pub(crate) fn pasts(u0: f64, (low, high): (f64, f64)) -> Vec<Vec<f64>> {
    let (span, inside) = (high - low, LEVELS - 1);
    let level = |i: usize| low + span * (i as f64 - BEYOND as f64) / inside as f64;
    // Beyond the range, too: a device that is driven to one side is poled to it, and wide plays come to rest about any voltage.
    let levels = || (0..LEVELS + 2 * BEYOND).map(level).filter(|u| (u - u0).abs() > 1e-9 * span);
    let mut turns: Vec<Vec<f64>> = levels().map(|u| vec![u]).collect();
    // Two turns on one side of where the record begins wipe each other out.
    for first in levels() {
        turns.extend(levels().filter(|second| (second - u0) * (first - u0) < 0.0).map(|second| vec![first, second]));
    }
    for i in 1..=AMPLITUDES {
        let amplitude = span * i as f64 / AMPLITUDES as f64;
        let turn = |k: usize| {
            let size = amplitude * (1.0 - k as f64 / DECAY as f64);
            u0 + if k.is_multiple_of(2) { size } else { -size }
        };
        turns.push((0..DECAY).map(turn).collect());
    }
    turns.iter().map(|turns| path(turns, u0)).collect()
}

/// From 0 V from turn to turn, and on to `u0` without reaching it.
fn path(turns: &[f64], u0: f64) -> Vec<f64> {
    let mut from = 0.0;
    let mut path = vec![from];
    for to in turns.iter().copied().chain([u0]) {
        path.extend((1..=ROWS).map(|i| from + (to - from) * i as f64 / ROWS as f64));
        from = to;
    }
    path.pop();
    path
}

/// Segments whose past is worth asking for: a start-up shows, and they do not begin near 0 V. There the memory is that of a rest, and what stands out
/// is a transient.
pub(crate) fn asked(samples: &Samples, settling: &[bool]) -> Vec<bool> {
    let (low, high) = samples.input_range();
    let away = |s: &Range<usize>| samples.input[s.start].abs() > AT_REST * low.abs().max(high.abs());
    samples.segments.iter().zip(started(samples, settling)).map(|(s, starts)| starts && away(s)).collect()
}

/// A drive with the past of each segment before it.
pub(crate) struct WithPast {
    pub(crate) drive: Vec<f64>,
    pub(crate) segments: Vec<Range<usize>>,
    /// Rows of it that are the record's.
    own: Vec<Range<usize>>,
}

impl WithPast {
    pub(crate) fn new(drive: &[f64], segments: &[Range<usize>], pasts: &[Vec<f64>]) -> Self {
        let mut all = Self { drive: Vec::with_capacity(drive.len()), segments: Vec::new(), own: Vec::new() };
        for (i, segment) in segments.iter().enumerate() {
            let start = all.drive.len();
            let past = pasts.get(i).map_or(&[][..], Vec::as_slice);
            all.drive.extend(past);
            all.drive.extend(&drive[segment.clone()]);
            all.segments.push(start..all.drive.len());
            all.own.push(start + past.len()..all.drive.len());
        }
        all
    }

    /// The rows of the record, of a column over all rows.
    pub(crate) fn own(&self, column: &[f64]) -> Vec<f64> {
        self.own.iter().flat_map(|rows| column[rows.clone()].iter().copied()).collect()
    }
}

/// The columns `of` a base over a drive, each segment after its past.
pub(crate) fn columns(
    basis: &dyn Basis,
    of: Range<usize>,
    drive: &[f64],
    segments: &[Range<usize>],
    pasts: &[Vec<f64>],
    drag: &Drag,
) -> Vec<Vec<f64>> {
    if pasts.iter().all(Vec::is_empty) {
        return basis.columns(of, drive, segments, drag);
    }
    let all = WithPast::new(drive, segments, pasts);
    let columns = basis.columns(of, &all.drive, &all.segments, drag);
    columns.iter().map(|column| all.own(column)).collect()
}

/// `Σᵢ wᵢ φᵢ` over a drive, each segment after its past, where that is less work than the columns are.
pub(crate) fn combined(
    basis: &dyn Basis,
    weights: &[f64],
    drive: &[f64],
    segments: &[Range<usize>],
    pasts: &[Vec<f64>],
    drag: &Drag,
) -> Option<Vec<f64>> {
    if pasts.iter().all(Vec::is_empty) {
        return basis.combined(weights, drive, segments, drag);
    }
    let all = WithPast::new(drive, segments, pasts);
    basis.combined(weights, &all.drive, &all.segments, drag).map(|v| all.own(&v))
}

/// The past of each segment after which a fitted base follows its first rows [`best`]; none of segments that are not `asked` for. A past for each of
/// some 340 combinations of turns is tried over the rows in which a start-up may lie, at most half of the segment.
pub(crate) fn recalled(samples: &Samples, basis: &dyn Basis, fitted: &Fitted, asked: &[bool]) -> Vec<Vec<f64>> {
    let (weights, windows, cycles) = (&fitted.weights[..], windows(samples), first_cycles(samples));
    let of_segment = |i: usize| -> Vec<f64> {
        let (start, window) = (samples.segments[i].start, windows[i]);
        if window == 0 || !asked[i] {
            return Vec::new();
        }
        let (all, rows) = (0..window, start..start + window);
        let zero = fitted.zeros.get(samples.file_of_segment[i]).or(fitted.zeros.first()).copied().unwrap_or(0.0);
        let drive = &samples.input[rows.clone()];
        let squares = |past: &Vec<f64>| -> f64 {
            let (whole, pasts) = (std::slice::from_ref(&all), std::slice::from_ref(past));
            let output = combined(basis, weights, drive, whole, pasts, &Drag::NONE).unwrap_or_else(|| {
                let columns = columns(basis, 0..basis.len(), drive, whole, pasts, &Drag::NONE);
                let at = |k: usize| columns.iter().zip(weights).map(|(c, w)| w * c[k]).sum();
                (0..window).map(at).collect()
            });
            let left = rows.clone().zip(output).filter(|(k, _)| !samples.blind[*k]);
            left.map(|(k, v)| (samples.output[k] - zero - v).powi(2)).sum()
        };
        let mut pasts = pasts(samples.input[start], samples.input_range());
        // Or it went on as it does afterwards.
        pasts.extend(cycles[i].map(|rows| samples.input[start..start + rows].to_vec()));
        best(pasts, squares)
    };
    (0..asked.len()).map(of_segment).collect()
}

/// The past after which least is left; none unless that is at most the share [`HELPS`] says of what a start from rest leaves.
pub(crate) fn best(pasts: Vec<Vec<f64>>, squares: impl Fn(&Vec<f64>) -> f64 + Sync) -> Vec<f64> {
    let from_rest = squares(&Vec::new());
    let all: Vec<f64> = pasts.par_iter().map(&squares).collect();
    let (_, least) = range(all.iter().map(|x| -x));
    let found = all.iter().position(|x| *x == -least).filter(|_| HELPS * HELPS * -least < from_rest);
    found.map(|at| pasts.into_iter().nth(at).unwrap_or_default()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{PiBasis, PreisachBasis};
    use crate::fit::{FitOptions, fit_settled};

    const PAST: [f64; 3] = [0.0, 95.0, 20.0];

    /// An actuator of few plays that was driven up and back before its record begins at 45 V; its drive goes over the range later.
    fn samples() -> Samples {
        let turns = [45.0, 70.0, 30.0, 60.0, 5.0, 100.0, 0.0, 90.0, 10.0, 100.0, 0.0, 60.0];
        let leg = |pair: &[f64]| {
            let (from, to) = (pair[0], pair[1]);
            (0..150).map(move |i| from + (to - from) * f64::from(i) / 150.0).collect::<Vec<_>>()
        };
        let input: Vec<f64> = turns.windows(2).flat_map(leg).collect();
        let whole = std::slice::from_ref(&(0..input.len())).to_vec();
        let plays = PiBasis { thresholds: vec![8.0, 17.0, 31.0, 42.0], floor: 0.0, falls: false };
        let past = path(&PAST[1..], 45.0);
        let columns = columns(&plays, 0..5, &input, &whole, &[past], &Drag::NONE);
        let noise = |k: usize| 0.005 * (1e3 * (k as f64).sin()).sin();
        let weights = [0.1, 0.02, 0.015, 0.02, 0.01];
        let output = (0..input.len())
            .map(|k| columns.iter().zip(weights).map(|(c, w)| w * c[k]).sum::<f64>() + noise(k))
            .collect();
        Samples::of_columns(1e-3, input, output)
    }

    #[test]
    fn a_past_leaves_what_the_same_drive_leaves_in_a_record() {
        let samples = samples();
        let past = path(&PAST[1..], 45.0);
        assert!(past[0] == 0.0 && past.last().is_some_and(|u| (20.0..45.0).contains(u)), "{past:?}");
        let with: Vec<f64> = past.iter().chain(&samples.input).copied().collect();
        let all = std::slice::from_ref(&(0..with.len())).to_vec();
        for basis in [&PiBasis::for_samples(&samples) as &dyn Basis, &PreisachBasis::for_samples(&samples, 8)] {
            let of = 0..basis.len();
            let pasts = std::slice::from_ref(&past);
            let own = columns(basis, of.clone(), &samples.input, &samples.segments, pasts, &Drag::NONE);
            let whole = basis.columns(of, &with, &all, &Drag::NONE);
            assert!(own.iter().zip(&whole).all(|(own, whole)| *own == whole[past.len()..]));
        }
    }

    /// No row is lost to a start-up, on either base, once it is known where the drive has been.
    #[test]
    fn a_record_that_begins_in_mid_cycle_is_followed_from_its_first_row() {
        for kind in 0..2 {
            let mut samples = samples();
            let bases: [Box<dyn Basis>; 2] =
                [Box::new(PiBasis::for_samples(&samples)), Box::new(PreisachBasis::for_samples(&samples, 12))];
            let (fitted, left) =
                fit_settled(&mut samples, bases[kind].as_ref(), &FitOptions::default(), &String::new).unwrap();
            assert!(!samples.pasts[0].is_empty() && samples.settling.iter().all(|s| !s), "{kind}: {:?}", samples.pasts);
            // Noise of 5 nm at most; the plays of the base are not those of the actuator.
            let largest = left.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
            assert!(largest < 0.1, "{kind}: {largest}, RMSE {}", fitted.rmse());
        }
    }

    #[test]
    fn a_record_from_rest_needs_no_past() {
        let input: Vec<f64> = (0..2000).map(|k| 50.0 - 50.0 * (f64::from(k) / 80.0).cos()).collect();
        let plays = PiBasis { thresholds: vec![8.0, 17.0, 31.0], floor: 0.0, falls: false };
        let whole = std::slice::from_ref(&(0..input.len())).to_vec();
        let columns = plays.columns(0..4, &input, &whole, &Drag::NONE);
        let output = (0..input.len()).map(|k| columns.iter().map(|c| 0.05 * c[k]).sum()).collect();
        let mut samples = Samples::of_columns(1e-3, input, output);
        let basis = PiBasis::for_samples(&samples);
        fit_settled(&mut samples, &basis, &FitOptions::default(), &String::new).unwrap();
        assert!(samples.pasts[0].is_empty());
    }
}
