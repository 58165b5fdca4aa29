//! Finds the valid surface nearest to a measured one.

use serde::Serialize;

use super::EverettError;
use super::nodes::place;
use super::surface::Surface;
use crate::lsq::{Order, nearest_ordered};

/// Minimum slope of every branch, as a share of the mean gain, as in the least-squares fits: the inverse then amplifies
/// by at most 20.
const MIN_SLOPE_SHARE: f64 = 0.05;

/// Correction of the nodes of a surface that made it valid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Moved {
    /// Largest move of a node \[output unit\].
    pub largest: f64,
    /// RMS move \[output unit\].
    pub rms: f64,
    /// Largest move in standard errors of the node.
    pub largest_sigmas: f64,
    /// Nodes that moved by more than their standard error.
    pub nodes: usize,
}

impl Surface {
    /// Returns the surface with the smallest `Σ ((E − E_measured) / standard error)²` that satisfies the constraints,
    /// and its distance from the measured one. Constraints: E rises with α and falls with β, and the virgin curve
    /// rises, each by at least 5 % of the mean gain per cell; the virgin curve is not below E(α, low).
    ///
    /// # Errors
    /// If the solver does not converge.
    pub fn nearest_valid(&self) -> Result<(Self, Moved), EverettError> {
        let cells = self.grid.cells;
        let least = MIN_SLOPE_SHARE * self.value(cells, 0).max(0.0) / cells as f64;
        let corner = self.nodes.len();
        let mut orders = Vec::with_capacity(2 * corner + 2 * cells);
        for i in 1..=cells {
            for j in 0..i {
                // Next to the diagonal both neighbours are 0.
                let before = (i > j + 1).then(|| place(i - 1, j));
                orders.push(Order { upper: place(i, j), lower: before, least });
                if i > j + 1 {
                    orders.push(Order { upper: place(i, j), lower: Some(place(i, j + 1)), least });
                }
            }
            let virgin = corner + i - 1;
            orders.push(Order { upper: virgin, lower: (i > 1).then(|| virgin - 1), least });
            orders.push(Order { upper: virgin, lower: Some(place(i, 0)), least: 0.0 });
        }
        let measured = self.nodes.iter().map(|n| (n.value, n.top + n.end));
        let (target, variance): (Vec<f64>, Vec<f64>) =
            measured.chain(self.virgin.iter().map(|v| (v.value, v.variance))).unzip();
        let weight: Vec<f64> = variance.iter().map(|v| 1.0 / v).collect();
        let found = nearest_ordered(&target, &weight, &orders)
            .ok_or_else(|| EverettError::Unsolvable { record: self.record.clone() })?;
        let (nodes, virgin) = found.split_at(corner);
        let moves =
            || nodes.iter().zip(&target).zip(&variance).map(|((x, t), v)| ((x - t).abs(), (x - t).abs() / v.sqrt()));
        let moved = Moved {
            largest: moves().fold(0.0, |m, d| m.max(d.0)),
            rms: (moves().map(|d| d.0 * d.0).sum::<f64>() / corner as f64).sqrt(),
            largest_sigmas: moves().fold(0.0, |m, d| m.max(d.1)),
            nodes: moves().filter(|d| d.1 > 1.0).count(),
        };
        Ok((self.with_values(nodes, virgin), moved))
    }
}
