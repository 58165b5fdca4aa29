//! What a creep still owes to the time before a segment.
//!
//! An element of a creep that was not at rest when a segment began, `x(0) ≠ v(0)`, adds `c (x(0) − v(0)) exp(−t/τ)` to what it adds from
//! rest. Nothing that the record holds says how far each was away: these are unknowns of their own, but each element was somewhere within the motion. Few
//! unknowns for each segment stand for all elements, since those of neighbouring time constants were in neighbouring places.

use std::ops::Range;

use hyst_core::CreepParams;

use crate::Samples;
use crate::samples::range;

/// Unknowns of a segment: how far its quick, its middle and its slow elements were away.
const BANDS: usize = 3;
/// Segments, the longest ones, that get unknowns.
const MOST_SEGMENTS: usize = 8;

/// Elements of one band in one segment.
pub(super) struct Relaxation {
    rows: Range<usize>,
    /// Shares, and the rows until 1/e is left of each.
    elements: Vec<(f64, f64)>,
}

impl Relaxation {
    /// What they add in a row for each unit that they were away.
    pub(super) fn at(&self, row: usize) -> f64 {
        if !self.rows.contains(&row) {
            return 0.0;
        }
        let passed = (row - self.rows.start) as f64;
        self.elements.iter().map(|(c, rows)| c * (-passed / rows).exp()).sum()
    }

    /// Adds what they add when they were `away`.
    pub(super) fn add_to(&self, motion: &mut [f64], away: f64) {
        for (c, rows) in self.elements.iter().filter(|_| away != 0.0) {
            let (mut left, kept) = (c * away, (-1.0 / rows).exp());
            for y in &mut motion[self.rows.clone()] {
                *y += left;
                left *= kept;
            }
        }
    }
}

/// How many there are in a record.
pub(super) fn count(samples: &Samples) -> usize {
    BANDS * samples.segments.len().min(MOST_SEGMENTS)
}

/// All of a record, segment by segment.
pub(super) fn relaxations(samples: &Samples, creep: &CreepParams<Vec<f64>>) -> Vec<Relaxation> {
    let mut longest: Vec<(usize, f64)> =
        samples.segments.iter().enumerate().map(|(i, s)| (i, s.len() as f64 * samples.period_of(i))).collect();
    longest.sort_by(|a, b| b.1.total_cmp(&a.1));
    longest.truncate(MOST_SEGMENTS);
    longest.sort_by_key(|(i, _)| *i);
    let elements: Vec<(f64, f64)> = creep.shares.iter().copied().zip(creep.seconds.iter().copied()).collect();
    let of = |(i, _): (usize, f64)| {
        let rows = samples.segments[i].clone();
        (0..BANDS).map(move |band| (i, rows.clone(), band))
    };
    let relaxation = |(i, rows, band): (usize, Range<usize>, usize)| {
        let n = elements.len();
        let own = &elements[band * n / BANDS..(band + 1) * n / BANDS];
        Relaxation { rows, elements: own.iter().map(|(c, tau)| (*c, tau / samples.period_of(i))).collect() }
    };
    longest.into_iter().flat_map(of).map(relaxation).collect()
}

/// What each adds in each row.
pub(crate) fn columns(samples: &Samples, creep: &CreepParams<Vec<f64>>) -> Vec<Vec<f64>> {
    let column = |of: &Relaxation| {
        let mut column = vec![0.0; samples.len()];
        of.add_to(&mut column, 1.0);
        column
    };
    relaxations(samples, creep).iter().map(column).collect()
}

/// How far an element was away at most, as far as the sensor has shown \[y\].
pub(super) fn farthest(samples: &Samples) -> f64 {
    let (low, high) = range(samples.output.iter().copied());
    high - low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_that_were_away_add_up_to_what_a_creep_adds_that_was() {
        let mut samples = Samples::of_columns(0.1, vec![0.0; 300], vec![0.0; 300]);
        samples.segments = vec![0..100, 100..300];
        samples.file_of_segment = vec![0, 0];
        let creep = CreepParams { seconds: vec![0.5, 2.0, 7.0, 30.0], shares: vec![0.01, 0.02, 0.03, 0.04] };
        let all = columns(&samples, &creep);
        assert_eq!((all.len(), count(&samples)), (2 * BANDS, 2 * BANDS));
        let whole = |t: f64| creep.seconds.iter().zip(&creep.shares).map(|(tau, c)| c * (-t / tau).exp()).sum::<f64>();
        for k in 0..300 {
            let passed = if k < 100 { k } else { k - 100 };
            let own = &all[if k < 100 { 0..BANDS } else { BANDS..2 * BANDS }];
            let sum: f64 = own.iter().map(|c| c[k]).sum();
            assert!((sum - whole(0.1 * passed as f64)).abs() < 1e-12);
            let at: f64 = relaxations(&samples, &creep).iter().map(|r| r.at(k)).sum();
            assert!((at - sum).abs() < 1e-12);
        }
    }
}
