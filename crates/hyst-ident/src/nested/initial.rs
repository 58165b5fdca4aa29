//! Initial values of slow states at the start of a segment.
//!
//! A creep element that is not at rest when a segment begins, `x(0) ≠ v(0)`, adds `c (x(0) − v(0)) exp(−t/τ)` to its
//! response from rest. The record does not contain the initial values, so they are unknowns, bounded by the range of
//! the motion. A few unknowns per segment represent all elements, since elements with similar time constants have
//! similar states. In the same way the actuator need not have had the first measured temperature: a late expansion adds
//! `ε (x(0) − T(0)) exp(−t/τ)`.

use std::ops::Range;

use super::Hypothesis;
use crate::Samples;
use crate::statistics::range;

/// Number of unknowns per segment: for fast, medium and slow elements.
const BANDS: usize = 3;
/// Maximum number of segments with unknowns; the longest ones are used.
const MAX_SEGMENTS: usize = 8;

/// Elements of one band in one segment.
pub(super) struct Relaxation {
    rows: Range<usize>,
    /// Share and time constant in rows of each element.
    elements: Vec<(f64, f64)>,
}

impl Relaxation {
    /// Adds the response of the elements to an initial deviation `away`.
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

/// Returns the number of unknowns of a record.
pub(super) fn count(samples: &Samples, h: &Hypothesis) -> usize {
    let bands = if h.effects.creep.is_some() { BANDS } else { 0 } + usize::from(h.expands_late().is_some());
    bands * samples.segments.len().min(MAX_SEGMENTS)
}

/// Returns all relaxations of a record, segment by segment: first those of the creep, then those of the expansion.
pub(super) fn relaxations(samples: &Samples, h: &Hypothesis) -> Vec<Relaxation> {
    if !h.initial_state {
        return Vec::new();
    }
    let mut longest: Vec<(usize, f64)> =
        samples.segments.iter().enumerate().map(|(i, s)| (i, s.len() as f64 * samples.period_of(i))).collect();
    longest.sort_by(|a, b| b.1.total_cmp(&a.1));
    longest.truncate(MAX_SEGMENTS);
    longest.sort_by_key(|(i, _)| *i);
    let mut bands: Vec<Vec<(f64, f64)>> = Vec::new();
    if let Some(creep) = &h.effects.creep {
        let elements: Vec<(f64, f64)> = creep.shares.iter().copied().zip(creep.seconds.iter().copied()).collect();
        let n = elements.len();
        bands.extend((0..BANDS).map(|band| elements[band * n / BANDS..(band + 1) * n / BANDS].to_vec()));
    }
    bands.extend(h.expands_late().map(|seconds| vec![(1.0, seconds)]));
    let relaxation = |i: usize, band: &[(f64, f64)]| {
        let in_rows = |(c, tau): &(f64, f64)| (*c, tau / samples.period_of(i));
        Relaxation { rows: samples.segments[i].clone(), elements: band.iter().map(in_rows).collect() }
    };
    bands.iter().flat_map(|band| longest.iter().map(|(i, _)| relaxation(*i, band))).collect()
}

/// Returns the column of each relaxation.
pub(crate) fn columns(samples: &Samples, h: &Hypothesis) -> Vec<Vec<f64>> {
    let column = |of: &Relaxation| {
        let mut column = vec![0.0; samples.len()];
        of.add_to(&mut column, 1.0);
        column
    };
    relaxations(samples, h).iter().map(column).collect()
}

/// Returns the largest possible initial deviation: the range of the measured output \[y\].
pub(super) fn farthest(samples: &Samples) -> f64 {
    let (low, high) = range(samples.output.iter().copied());
    high - low
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Effects;
    use hyst_core::CreepParams;

    #[test]
    fn bands_of_equal_deviation_add_up_to_that_of_the_whole_creep() {
        let mut samples = Samples::of_columns(0.1, vec![0.0; 300], vec![0.0; 300]);
        samples.segments = vec![0..100, 100..300];
        samples.file_of_segment = vec![0, 0];
        let creep = CreepParams { seconds: vec![0.5, 2.0, 7.0, 30.0], shares: vec![0.01, 0.02, 0.03, 0.04] };
        let h = Hypothesis {
            initial_state: true,
            ..Hypothesis::of(Effects { creep: Some(creep.clone()), ..Effects::default() })
        };
        let all = columns(&samples, &h);
        assert_eq!((all.len(), count(&samples, &h)), (2 * BANDS, 2 * BANDS));
        let whole = |t: f64| creep.seconds.iter().zip(&creep.shares).map(|(tau, c)| c * (-t / tau).exp()).sum::<f64>();
        for k in 0..300 {
            let passed = if k < 100 { k } else { k - 100 };
            let sum: f64 = all.iter().map(|c| c[k]).sum();
            assert!((sum - whole(0.1 * passed as f64)).abs() < 1e-12);
        }
    }
}
