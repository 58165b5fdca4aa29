//! The Everett surface that a record's first-order descent curves show, averaged over peak durations.

use hyst_core::Grid;

use super::EverettError;
use super::flank::Estimate;
use super::peaks::{Curves, Family, Peak, median};
use super::reader::{Reader, heights};
use crate::Samples;
use crate::model::capacity::NODES;
use crate::noise::{noise_floor, quantisation};

/// Heights that a surface needs at least.
const FEWEST: usize = 4;

/// A node of the surface: the fall of the output from α to β.
///
/// The output at the top is shared by a whole row of nodes, so its error is kept apart: it cancels between neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Node {
    pub(super) value: f64,
    /// Variance of the output at the top.
    pub(super) top: f64,
    /// Variance of the output at β.
    pub(super) end: f64,
}

/// An Everett surface as measured: `E(αᵢ, βⱼ) = f(αᵢ) − f(αᵢ, βⱼ)` \[output unit\] on a uniform grid, and the virgin curve.
///
/// Each family of peaks (one form, one duration) gives a surface of its own; the mean of them is this one. A mode of the
/// structure meets each family at another phase, so that its part averages out (Schirrer et al., section 3.2). Standard
/// errors are those that the sensor's noise leaves, not the scatter between families, which is in [`scatter`](Self::scatter).
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Name of the record, for messages.
    pub(super) record: String,
    /// From the input at rest to the highest peak.
    pub(super) grid: Grid,
    pub(super) families: Vec<Family>,
    pub(super) passed_over: usize,
    pub(super) noise: f64,
    /// What the sensor shows at virgin rest.
    pub(super) zero: f64,
    /// Node (i, j), j < i, at place `i (i − 1) / 2 + j`.
    pub(super) nodes: Vec<Node>,
    /// Standard deviation between the families at each node; 0 of one family.
    pub(super) scatter: Vec<f64>,
    /// What the output gains from virgin rest up to node i + 1.
    pub(super) virgin: Vec<Estimate>,
}

/// Place of node (i, j), j < i.
pub(super) fn place(i: usize, j: usize) -> usize {
    i * (i - 1) / 2 + j
}

impl Surface {
    /// Finds the curves of a record and measures the surface on a grid of `cells` cells; as many as there are heights, if
    /// not given, up to the capacity of the host's operators.
    ///
    /// Inputs between two heights are interpolated along α, a row's β is read on the falling flanks from the rows within
    /// half a cell of it.
    ///
    /// # Errors
    /// If there are fewer than four curves, or a node that no curve shows.
    pub fn measure(record: &str, samples: &Samples, cells: Option<usize>) -> Result<Self, EverettError> {
        let mut curves = Curves::of(samples);
        let highest = samples.input_range().1;
        // A family shows a surface if it has some heights and goes all the way up.
        let complete = |peaks: &[Peak], curves: &Curves| {
            heights(peaks, curves.tolerance) >= FEWEST && peaks[0].height >= highest - 3.0 * curves.tolerance
        };
        let (kept, stray): (Vec<_>, Vec<_>) =
            std::mem::take(&mut curves.families).into_iter().partition(|(_, peaks)| complete(peaks, &curves));
        let found = stray.iter().map(|(_, peaks)| heights(peaks, curves.tolerance)).max().unwrap_or(0);
        curves.passed_over += stray.iter().map(|(_, peaks)| peaks.len()).sum::<usize>();
        if kept.is_empty() {
            let (record, passed_over) = (record.to_owned(), curves.passed_over);
            return Err(EverettError::TooFewCurves { record, found, needed: FEWEST, passed_over });
        }
        let most = kept.iter().map(|(_, peaks)| heights(peaks, curves.tolerance)).max().unwrap_or(FEWEST);
        let cells = cells.unwrap_or(most).clamp(2, NODES - 1);
        let mut tops: Vec<f64> = kept.iter().map(|(_, peaks)| peaks[0].height).collect();
        let high = median(&mut tops).unwrap_or(highest);
        let grid = Grid { low: curves.low, high, cells };
        let sigma = noise_floor(&samples.output, &samples.segments).max(quantisation(&samples.output));
        let reader = Reader { samples, grid, noise: sigma * sigma, tolerance: curves.tolerance };
        let families: Vec<Vec<Option<Node>>> = kept.iter().map(|(_, peaks)| reader.nodes(peaks)).collect();
        let count = cells * (cells + 1) / 2;
        let (mut nodes, mut scatter) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for i in 1..=cells {
            for j in 0..i {
                let own: Vec<Node> = families.iter().filter_map(|f| f[place(i, j)]).collect();
                let n = own.len() as f64;
                if own.is_empty() {
                    let (alpha, beta) = (reader.at(i), reader.at(j));
                    return Err(EverettError::Unseen { record: record.to_owned(), alpha, beta });
                }
                let sum = |f: fn(&Node) -> f64| own.iter().map(f).sum::<f64>();
                let value = sum(|n| n.value) / n;
                let squares = own.iter().map(|n| (n.value - value) * (n.value - value)).sum::<f64>();
                scatter.push(if own.len() > 1 { (squares / (n - 1.0)).sqrt() } else { 0.0 });
                nodes.push(Node { value, top: sum(|n| n.top) / (n * n), end: sum(|n| n.end) / (n * n) });
            }
        }
        let (zero, virgin) = reader.virgin(&kept);
        let lowest = |i: usize| nodes[place(i, 0)];
        let virgin = (1..=cells).zip(virgin).map(|(i, v)| {
            let Node { value, top, end } = lowest(i);
            v.unwrap_or(Estimate { value, variance: top + end })
        });
        let virgin = virgin.collect();
        Ok(Self {
            record: record.to_owned(),
            grid,
            families: kept.into_iter().map(|(family, _)| family).collect(),
            passed_over: curves.passed_over,
            noise: sigma,
            zero,
            nodes,
            scatter,
            virgin,
        })
    }

    /// The grid: from the input at rest to the highest peak.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The families of peaks that were averaged.
    pub fn families(&self) -> &[Family] {
        &self.families
    }

    /// Standard deviation of the sensor's noise \[output unit\].
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Input at node k.
    pub fn at(&self, k: usize) -> f64 {
        at(&self.grid, k)
    }

    /// `E(αᵢ, βⱼ)` \[output unit\], 0 on the diagonal.
    ///
    /// # Panics
    /// If j > i or i is beyond the grid.
    pub fn value(&self, i: usize, j: usize) -> f64 {
        self.node(i, j).value
    }

    /// Standard error of `E(αᵢ, βⱼ)` from the sensor's noise \[output unit\].
    ///
    /// # Panics
    /// As [`value`](Self::value).
    pub fn std_error(&self, i: usize, j: usize) -> f64 {
        let Node { top, end, .. } = self.node(i, j);
        (top + end).sqrt()
    }

    /// Standard deviation between the families, root of its mean square over the nodes \[output unit\]; 0 of one family.
    pub fn scatter(&self) -> f64 {
        (self.scatter.iter().map(|s| s * s).sum::<f64>() / self.scatter.len() as f64).sqrt()
    }

    /// What the output gains from virgin rest at the low end up to node i; 0 at node 0.
    ///
    /// # Panics
    /// If i is beyond the grid.
    pub fn virgin(&self, i: usize) -> f64 {
        if i == 0 { 0.0 } else { self.virgin[i - 1].value }
    }

    pub(super) fn node(&self, i: usize, j: usize) -> Node {
        if i == j { Node::default() } else { self.nodes[place(i, j)] }
    }

    /// The same surface with other values: `nodes` and `virgin` as the fields of that name.
    pub(super) fn with_values(&self, nodes: &[f64], virgin: &[f64]) -> Self {
        let mut other = self.clone();
        other.nodes.iter_mut().zip(nodes).for_each(|(n, v)| n.value = *v);
        other.virgin.iter_mut().zip(virgin).for_each(|(n, v)| n.value = *v);
        other
    }
}

pub(super) fn at(grid: &Grid, k: usize) -> f64 {
    grid.low + (grid.high - grid.low) * k as f64 / grid.cells as f64
}

impl Node {
    pub(super) fn towards(self, other: Self, share: f64) -> Self {
        let (a, b) = (1.0 - share, share);
        Self {
            value: a * self.value + b * other.value,
            top: a * a * self.top + b * b * other.top,
            end: a * a * self.end + b * b * other.end,
        }
    }
}
