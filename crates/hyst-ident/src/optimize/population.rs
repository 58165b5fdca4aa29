//! Common parts of the searches: points with costs, and random numbers.

use nalgebra::{DMatrix, SymmetricEigen};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Asked, SearchError};

/// Random numbers of a search; a seed gives the same numbers on every machine.
#[derive(Clone, Debug)]
pub(super) struct Draws(ChaCha8Rng);

impl Draws {
    pub(super) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Returns a uniform number in [0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        // 53 random bits.
        (self.0.random::<u64>() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Returns a uniform index in [0, n).
    pub(super) fn index(&mut self, n: usize) -> usize {
        ((self.uniform() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// Returns a standard normal number (Box and Muller).
    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Returns a Cauchy number with this centre and half width.
    pub(super) fn cauchy(&mut self, at: f64, half_width: f64) -> f64 {
        at + half_width * (std::f64::consts::PI * (self.uniform() - 0.5)).tan()
    }
}

/// Returns a cost for comparisons: a cost that is not a number is the worst.
pub(super) fn comparable(cost: f64) -> f64 {
    if cost.is_nan() { f64::INFINITY } else { cost }
}

/// Points in one list, with their costs.
#[derive(Clone, Debug)]
pub(super) struct Points {
    pub(super) dimensions: usize,
    pub(super) at: Vec<f64>,
    pub(super) costs: Vec<f64>,
}

impl Points {
    /// Returns a Latin hypercube sample (McKay et al. 1979): each coordinate is covered evenly, even with few points.
    pub(super) fn latin(dimensions: usize, count: usize, draws: &mut Draws) -> Self {
        let mut at = vec![0.0; dimensions * count];
        let mut order: Vec<usize> = (0..count).collect();
        for d in 0..dimensions {
            for i in (1..count).rev() {
                order.swap(i, draws.index(i + 1));
            }
            for (i, stratum) in order.iter().enumerate() {
                at[i * dimensions + d] = (*stratum as f64 + draws.uniform()) / count as f64;
            }
        }
        Self { dimensions, at, costs: vec![f64::INFINITY; count] }
    }

    pub(super) fn len(&self) -> usize {
        self.costs.len()
    }

    pub(super) fn point(&self, i: usize) -> &[f64] {
        &self.at[i * self.dimensions..(i + 1) * self.dimensions]
    }

    pub(super) fn point_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.at[i * self.dimensions..(i + 1) * self.dimensions]
    }

    /// Returns the index of the lowest cost, the first of equal ones; `None` if no cost is finite.
    pub(super) fn best(&self) -> Option<usize> {
        (0..self.len())
            .filter(|i| self.costs[*i].is_finite())
            .min_by(|a, b| self.costs[*a].total_cmp(&self.costs[*b]).then(a.cmp(b)))
    }

    /// Returns the indices from the lowest to the highest cost, equal ones in their order.
    pub(super) fn ranked(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by(|a, b| self.costs[*a].total_cmp(&self.costs[*b]).then(a.cmp(b)));
        order
    }

    /// Returns the principal axes of some of the points, each of unit length.
    pub(super) fn axes(&self, of: &[usize]) -> Vec<Vec<f64>> {
        let mean = |d: usize| of.iter().map(|i| self.point(*i)[d]).sum::<f64>() / of.len().max(1) as f64;
        let mean: Vec<f64> = (0..self.dimensions).map(mean).collect();
        let product = |i: &usize, r: usize, c: usize| (self.point(*i)[r] - mean[r]) * (self.point(*i)[c] - mean[c]);
        let scatter =
            DMatrix::from_fn(self.dimensions, self.dimensions, |r, c| of.iter().map(|i| product(i, r, c)).sum::<f64>());
        SymmetricEigen::new(scatter).eigenvectors.column_iter().map(|axis| axis.iter().copied().collect()).collect()
    }

    /// Returns the largest range of a coordinate.
    pub(super) fn extent(&self) -> f64 {
        let range = |d: usize| {
            let (low, high) = crate::statistics::range(self.at.iter().skip(d).step_by(self.dimensions).copied());
            high - low
        };
        (0..self.dimensions).map(range).fold(0.0, f64::max)
    }
}

/// Points that were asked for and whose costs are not known yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Pending {
    pub(super) points: Vec<f64>,
    pub(super) hopeless: Vec<f64>,
}

impl Pending {
    pub(super) fn is_empty(&self) -> bool {
        self.hopeless.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.hopeless.clear();
    }

    pub(super) fn push(&mut self, point: &[f64], hopeless: f64) {
        self.points.extend_from_slice(point);
        self.hopeless.push(hopeless);
    }

    pub(super) fn asked(&self) -> Asked<'_> {
        Asked { points: &self.points, hopeless: &self.hopeless }
    }

    pub(super) fn check(&self, costs: &[f64]) -> Result<(), SearchError> {
        if self.hopeless.len() == costs.len() && !costs.is_empty() {
            Ok(())
        } else {
            Err(SearchError::Told { asked: self.hopeless.len(), told: costs.len() })
        }
    }
}
