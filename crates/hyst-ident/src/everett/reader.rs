//! Reads the curves of one family on a grid: Everett values at its nodes, and the virgin curve.

use hyst_core::Grid;

use super::flank::{Estimate, Flank};
use super::nodes::{Node, at};
use super::peaks::{Family, Peak};
use crate::Samples;

/// Returns the number of different heights of peaks that are sorted by height.
pub(super) fn heights(peaks: &[Peak], tolerance: f64) -> usize {
    let mut last = f64::INFINITY;
    let mut count = 0;
    for peak in peaks {
        if last - peak.height > tolerance {
            (last, count) = (peak.height, count + 1);
        }
    }
    count
}

/// Reads the curves of one family on the grid.
pub(super) struct Reader<'a> {
    pub(super) samples: &'a Samples,
    pub(super) grid: Grid,
    /// Variance of the sensor noise.
    pub(super) noise: f64,
    /// Change of the input that counts as none.
    pub(super) tolerance: f64,
}

/// One curve at the inputs of the grid below its height: the height, the output there, the outputs at the βⱼ.
struct Row {
    height: f64,
    top: Estimate,
    ends: Vec<Option<Estimate>>,
}

impl Reader<'_> {
    pub(super) fn at(&self, k: usize) -> f64 {
        at(&self.grid, k)
    }

    fn half_cell(&self) -> f64 {
        0.5 * (self.grid.high - self.grid.low) / self.grid.cells as f64
    }

    fn row(&self, peak: &Peak) -> Option<Row> {
        let rows = peak.falling.clone();
        let (input, output) = (&self.samples.input[rows.clone()], &self.samples.output[rows]);
        let flank = Flank { input, output, noise: self.noise };
        let below = (0..=self.grid.cells).take_while(|j| self.at(*j) < peak.height - self.tolerance);
        let ends = below.map(|j| flank.at(self.at(j), self.half_cell())).collect();
        Some(Row { height: peak.height, top: flank.at(peak.height, self.half_cell())?, ends })
    }

    /// Returns the nodes of one family; `None` for a node without a curve.
    pub(super) fn nodes(&self, peaks: &[Peak]) -> Vec<Option<Node>> {
        let mut rows: Vec<Row> = peaks.iter().filter_map(|p| self.row(p)).collect();
        rows.sort_by(|a, b| a.height.total_cmp(&b.height));
        let node = |row: &Row, j: usize| -> Option<Node> {
            let end = (*row.ends.get(j)?)?;
            Some(Node { value: row.top.value - end.value, top: row.top.variance, end: end.variance })
        };
        let mut nodes = Vec::new();
        for i in 1..=self.grid.cells {
            let alpha = self.at(i);
            // Curves of the height of the node, or the next lower and the next higher one.
            let own: Vec<&Row> = rows.iter().filter(|r| (r.height - alpha).abs() <= self.tolerance).collect();
            let lower = rows.iter().rfind(|r| r.height < alpha);
            let upper = rows.iter().find(|r| r.height > alpha);
            for j in 0..i {
                let mean = || {
                    let all: Vec<Node> = own.iter().filter_map(|r| node(r, j)).collect();
                    all.split_first().map(|(first, rest)| {
                        rest.iter().zip(2..).fold(*first, |m, (n, k)| m.towards(*n, 1.0 / f64::from(k)))
                    })
                };
                let between = || {
                    // A curve that ends below β is replaced by the diagonal, where the surface is zero.
                    let zero = (self.at(j), Some(Node::default()));
                    let (from, low) = lower.filter(|r| r.ends.len() > j).map_or(zero, |r| (r.height, node(r, j)));
                    let (to, high) = upper.map(|r| (r.height, node(r, j)))?;
                    Some(low?.towards(high?, (alpha - from) / (to - from)))
                };
                nodes.push(if own.is_empty() { between() } else { mean() });
            }
        }
        nodes
    }

    /// Returns the sensor zero and the virgin curve at nodes 1, 2 …, where the record contains it: at peaks that were
    /// the highest since the device was at rest.
    pub(super) fn virgin(&self, families: &[(Family, Vec<Peak>)]) -> (f64, Vec<Option<Estimate>>) {
        let mut points: Vec<(f64, Estimate)> = Vec::new();
        let mut zeros = Vec::new();
        for (segment, rows) in self.samples.segments.iter().enumerate() {
            let peaks = families.iter().flat_map(|(_, peaks)| peaks);
            let mut own: Vec<&Peak> = peaks.filter(|p| p.segment == segment && p.first_so_high).collect();
            own.sort_by_key(|p| p.top);
            let Some(first) = own.first() else { continue };
            // The rise to the first peak, from the first row: the device is at virgin rest at its low end.
            let rise = rows.start..first.top + 1;
            let (input, output) = (&self.samples.input[rise.clone()], &self.samples.output[rise]);
            let rise = Flank { input, output, noise: self.noise };
            let Some(rest) = rise.at(self.grid.low, self.half_cell().min(0.5 * (first.height - self.grid.low))) else {
                continue;
            };
            zeros.push(rest.value);
            points.extend(own.iter().filter_map(|p| {
                let top = self.row(p)?.top;
                Some((p.height, Estimate { value: top.value - rest.value, variance: top.variance + rest.variance }))
            }));
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let curve = (1..=self.grid.cells).map(|i| {
            let alpha = self.at(i);
            let own: Vec<&Estimate> =
                points.iter().filter(|p| (p.0 - alpha).abs() <= self.tolerance).map(|p| &p.1).collect();
            if let Some((first, rest)) = own.split_first() {
                let mean = rest.iter().zip(2..).fold(**first, |m, (e, k)| m.towards(**e, 1.0 / f64::from(k)));
                return Some(mean);
            }
            let lower = points.iter().rfind(|p| p.0 < alpha);
            let (from, low) = lower.map_or((self.grid.low, Estimate::default()), |p| *p);
            let (to, high) = points.iter().find(|p| p.0 > alpha)?;
            Some(low.towards(*high, (alpha - from) / (to - from)))
        });
        let curve = curve.collect();
        (zeros.iter().sum::<f64>() / zeros.len().max(1) as f64, curve)
    }
}
