//! Division of a record into blocks. A block is a contiguous piece of one segment.

use std::ops::Range;

use crate::Samples;

/// Number of blocks of a record.
pub(crate) const BLOCKS: usize = 64;
/// Maximum number of rows of a fit; longer records are thinned evenly after filtering.
pub(crate) const ROWS: usize = 40_000;

/// Division of a record into blocks.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    /// Rows of each block.
    pub(crate) rows: Vec<Range<usize>>,
    /// One of `stride` rows counts.
    pub(crate) stride: usize,
}

impl Blocks {
    /// Returns about `count` blocks of equal length, none across a segment border, with at most about `budget` rows
    /// that count.
    pub(crate) fn new(samples: &Samples, count: usize, budget: usize) -> Self {
        let target = (samples.len() / count.max(1)).max(1);
        let mut rows = Vec::new();
        for segment in &samples.segments {
            let pieces = (segment.len() as f64 / target as f64).round().max(1.0) as usize;
            for i in 0..pieces {
                let at = |i: usize| segment.start + segment.len() * i / pieces;
                rows.push(at(i)..at(i + 1));
            }
        }
        Self { rows, stride: samples.len().div_ceil(budget.max(1)).max(1) }
    }

    /// Returns the rows of block `b` that count.
    pub(crate) fn used<'a>(&'a self, b: usize, samples: &'a Samples) -> impl Iterator<Item = usize> + 'a {
        let rows = self.rows[b].clone();
        // One row of each stretch, at a scattered position: with an even stride a tone would alias to a constant.
        let scattered = move |first: usize| {
            let place = (first as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 33;
            (first + place as usize % self.stride).min(rows.end - 1)
        };
        self.rows[b].clone().step_by(self.stride).map(scattered).filter(|k| !samples.settling[*k])
    }

    /// Returns the rows of all blocks that count, in order.
    pub(crate) fn all_used<'a>(&'a self, samples: &'a Samples) -> impl Iterator<Item = usize> + 'a {
        (0..self.rows.len()).flat_map(|b| self.used(b, samples))
    }

    /// Returns how many of [`all_used`](Self::all_used) are in each segment.
    pub(crate) fn used_of_segments(&self, samples: &Samples) -> Vec<usize> {
        let of = |segment: &Range<usize>| {
            let own = (0..self.rows.len()).filter(|b| segment.contains(&self.rows[*b].start));
            own.map(|b| self.used(b, samples).count()).sum()
        };
        samples.segments.iter().map(of).collect()
    }
}

/// Deals the blocks in turn to `count` folds, so that each fold has blocks of every segment.
pub(crate) fn folds_interleaved(blocks: &Blocks, count: usize) -> Vec<Vec<usize>> {
    let n = blocks.rows.len();
    // Shifted by one in each round, so that segments of equal length do not lose the same part together.
    let fold = |b: usize| (b + b / count) % count;
    (0..count.min(n))
        .map(|f| (0..n).filter(|b| fold(*b) == f).collect())
        .filter(|f: &Vec<usize>| !f.is_empty())
        .collect()
}
