//! Columns of a basis for segments that do not start at rest: each segment follows its drive history.

use std::ops::Range;

use super::{Basis, Drag};

/// A drive with the history of each segment before it.
pub(crate) struct WithPast {
    pub(crate) drive: Vec<f64>,
    pub(crate) segments: Vec<Range<usize>>,
    /// The rows that belong to the record.
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

    /// Returns the rows of the record from a column over all rows.
    pub(crate) fn own(&self, column: &[f64]) -> Vec<f64> {
        self.own.iter().flat_map(|rows| column[rows.clone()].iter().copied()).collect()
    }
}

/// Returns the columns with the indices `of` of a basis over a drive, each segment after its history.
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

/// Returns the values of the same columns in these rows, which ascend.
pub(crate) fn columns_at(
    basis: &dyn Basis,
    of: Range<usize>,
    (drive, segments, pasts): (&[f64], &[Range<usize>], &[Vec<f64>]),
    drag: &Drag,
    rows: &[usize],
) -> Vec<Vec<f64>> {
    if pasts.iter().all(Vec::is_empty) {
        return basis.columns_at(of, drive, segments, drag, rows);
    }
    let all = WithPast::new(drive, segments, pasts);
    let own = |k: &usize| {
        let i = segments.partition_point(|segment| segment.end <= *k);
        all.own[i].start + k - segments[i].start
    };
    let rows: Vec<usize> = rows.iter().map(own).collect();
    basis.columns_at(of, &all.drive, &all.segments, drag, &rows)
}

/// Returns `Σᵢ wᵢ φᵢ` over a drive, each segment after its history, if that takes less work than the columns.
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
