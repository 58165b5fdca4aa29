//! Measures the Everett surface from first-order descent curves, averaged over peak durations.

use hyst_core::Grid;

use super::EverettError;
use super::flank::Estimate;
use super::nodes::{Node, at, place};
use super::peaks::{Curves, Family, Peak, median};
use super::reader::{Reader, heights};
use crate::Samples;
use crate::model::capacity::NODES;
use crate::noise::{noise_floor, quantisation};

/// Minimum number of peak heights of a surface.
const MIN_HEIGHTS: usize = 4;

/// A measured Everett surface: `E(αᵢ, βⱼ) = f(αᵢ) − f(αᵢ, βⱼ)` \[output unit\] on a uniform grid, and the virgin curve.
///
/// Each family of peaks (one form, one duration) gives a surface. This is their mean. A structural mode has another
/// phase in each family, so its contribution averages out (Schirrer et al., section 3.2). Standard errors contain the
/// sensor noise only; for the scatter between families see [`scatter`](Self::scatter).
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Name of the record, for messages.
    pub(super) record: String,
    /// From the input at rest to the highest peak.
    pub(super) grid: Grid,
    pub(super) families: Vec<Family>,
    pub(super) passed_over: usize,
    pub(super) noise: f64,
    /// Sensor reading at virgin rest.
    pub(super) zero: f64,
    /// Node (i, j), j < i, at index `i (i − 1) / 2 + j`.
    pub(super) nodes: Vec<Node>,
    /// Standard deviation between the families at each node; 0 for one family.
    pub(super) scatter: Vec<f64>,
    /// Rise of the output from virgin rest to node i + 1.
    pub(super) virgin: Vec<Estimate>,
}

impl Surface {
    /// Finds the curves of a record and measures the surface on a grid of `cells` cells. If not given, it has as many
    /// cells as there are heights, up to the capacity of the host's operators.
    ///
    /// Nodes between two heights are interpolated along α. The output at β is read on the falling flanks from the rows
    /// within half a cell of it.
    ///
    /// # Errors
    /// If there are fewer than four curves, or no curve has data at a node.
    pub fn measure(record: &str, samples: &Samples, cells: Option<usize>) -> Result<Self, EverettError> {
        let mut curves = Curves::of(samples);
        let highest = samples.input_range().1;
        // A family gives a surface if it has enough heights up to the highest input.
        let complete = |peaks: &[Peak], curves: &Curves| {
            heights(peaks, curves.tolerance) >= MIN_HEIGHTS && peaks[0].height >= highest - 3.0 * curves.tolerance
        };
        let (kept, stray): (Vec<_>, Vec<_>) =
            std::mem::take(&mut curves.families).into_iter().partition(|(_, peaks)| complete(peaks, &curves));
        let found = stray.iter().map(|(_, peaks)| heights(peaks, curves.tolerance)).max().unwrap_or(0);
        curves.passed_over += stray.iter().map(|(_, peaks)| peaks.len()).sum::<usize>();
        if kept.is_empty() {
            let (record, passed_over) = (record.to_owned(), curves.passed_over);
            return Err(EverettError::TooFewCurves { record, found, needed: MIN_HEIGHTS, passed_over });
        }
        let most = kept.iter().map(|(_, peaks)| heights(peaks, curves.tolerance)).max().unwrap_or(MIN_HEIGHTS);
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

    /// Returns the grid, from the input at rest to the highest peak.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// Returns the families of peaks that were averaged.
    pub fn families(&self) -> &[Family] {
        &self.families
    }

    /// Returns the standard deviation of the sensor noise \[output unit\].
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Returns the input at node k.
    pub fn at(&self, k: usize) -> f64 {
        at(&self.grid, k)
    }

    /// Returns `E(αᵢ, βⱼ)` \[output unit\], 0 on the diagonal.
    ///
    /// # Panics
    /// If j > i or i is beyond the grid.
    pub fn value(&self, i: usize, j: usize) -> f64 {
        self.node(i, j).value
    }

    /// Returns the standard error of `E(αᵢ, βⱼ)` due to the sensor noise \[output unit\].
    ///
    /// # Panics
    /// As [`value`](Self::value).
    pub fn std_error(&self, i: usize, j: usize) -> f64 {
        let Node { top, end, .. } = self.node(i, j);
        (top + end).sqrt()
    }

    /// Returns the standard deviation between the families, RMS over the nodes \[output unit\]; 0 for one family.
    pub fn scatter(&self) -> f64 {
        (self.scatter.iter().map(|s| s * s).sum::<f64>() / self.scatter.len() as f64).sqrt()
    }

    /// Returns the rise of the output from virgin rest at the low end to node i; 0 at node 0.
    ///
    /// # Panics
    /// If i is beyond the grid.
    pub fn virgin(&self, i: usize) -> f64 {
        if i == 0 { 0.0 } else { self.virgin[i - 1].value }
    }

    pub(super) fn node(&self, i: usize, j: usize) -> Node {
        if i == j { Node::default() } else { self.nodes[place(i, j)] }
    }

    /// Returns the same surface with other values, in the order of the fields `nodes` and `virgin`.
    pub(super) fn with_values(&self, nodes: &[f64], virgin: &[f64]) -> Self {
        let mut other = self.clone();
        other.nodes.iter_mut().zip(nodes).for_each(|(n, v)| n.value = *v);
        other.virgin.iter_mut().zip(virgin).for_each(|(n, v)| n.value = *v);
        other
    }
}
