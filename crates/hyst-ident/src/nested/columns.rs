//! The base's columns behind what leads to the hysteresis: kept where they are few, made anew where they would fill the memory.

use std::borrow::Cow;

use super::{Hypothesis, Problem, SignalPath};
use crate::Samples;
use crate::base::Drag;

/// Numbers that are kept at most: 64 MB.
const KEPT: usize = 8_000_000;

/// Whether the columns of a base of this width are kept for a record.
pub(super) fn may_be_kept(samples: &Samples, width: usize) -> bool {
    samples.len().saturating_mul(width) <= KEPT
}

/// Columns of one base for one drive.
pub(super) enum BaseColumns<'a> {
    Kept(Cow<'a, [Vec<f64>]>),
    Made { problem: &'a Problem<'a>, drive: Vec<f64>, drag: Drag },
}

impl BaseColumns<'_> {
    /// Gives `each` the number and a copy of every column, in order.
    pub(super) fn each(&self, each: &mut dyn FnMut(usize, &mut [f64])) {
        match self {
            Self::Kept(columns) => {
                let mut copy = Vec::new();
                for (c, column) in columns.iter().enumerate() {
                    copy.clone_from(column);
                    each(c, &mut copy);
                }
            }
            Self::Made { problem, drive, drag } => {
                problem.basis.columns(drive, &problem.samples.segments, drag, each);
            }
        }
    }

    /// Σ wᵢ φᵢ over the rows of a record.
    pub(super) fn combined(&self, weights: &[f64], rows: usize) -> Vec<f64> {
        let mut v = vec![0.0; rows];
        let mut add = |c: usize, column: &[f64]| {
            if let Some(w) = weights.get(c) {
                v.iter_mut().zip(column).for_each(|(v, x)| *v += w * x);
            }
        };
        match self {
            Self::Kept(columns) => columns.iter().enumerate().for_each(|(c, column)| add(c, column)),
            Self::Made { .. } => self.each(&mut |c, column| add(c, column)),
        }
        v
    }
}

impl Problem<'_> {
    /// The base's columns for what leads to the hysteresis.
    pub(super) fn columns<'b>(&'b self, path: &SignalPath<'_>, h: &Hypothesis) -> BaseColumns<'b> {
        if let (false, Some(raw)) = (h.changes_the_base(), &self.raw) {
            return BaseColumns::Kept(Cow::Borrowed(raw));
        }
        let drag = h.drag.map_or(Drag::NONE, |p| p.at(self.samples.period));
        let made = BaseColumns::Made { problem: self, drive: path.input_side(), drag };
        if !may_be_kept(self.samples, self.width) {
            return made;
        }
        let mut columns = Vec::with_capacity(self.width);
        made.each(&mut |_, column| columns.push(column.to_vec()));
        BaseColumns::Kept(Cow::Owned(columns))
    }
}
