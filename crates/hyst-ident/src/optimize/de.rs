//! Differential evolution, DE/rand/1/bin.

use super::population::{Draws, Pending, Points, comparable};
use super::{Asked, MethodError, Optimizer, SearchError};

/// Classical differential evolution (Storn & Price 1997).
///
/// For each member `xᵢ` a mutant `v = x_a + F (x_b − x_c)` is formed of three other members. The trial point takes each
/// coordinate of the mutant with probability CR (at least one). It replaces the member if its cost is lower. A
/// coordinate outside the box is set halfway between that of the member and the bound.
#[derive(Clone, Debug)]
pub struct De {
    factor: f64,
    crossover: f64,
    members: Points,
    pending: Pending,
    draws: Draws,
    started: bool,
}

impl De {
    /// Creates a search with `population` members (at least four), factor F in 0..=2 and crossover rate CR in 0..=1.
    ///
    /// # Errors
    /// If a setting is out of its range; the message names it.
    pub fn new(
        dimensions: usize,
        population: usize,
        factor: f64,
        crossover: f64,
        seed: u64,
    ) -> Result<Self, MethodError> {
        MethodError::at_least("population", population, 4)?;
        MethodError::within("factor", factor, 0.0, 2.0)?;
        MethodError::within("crossover", crossover, 0.0, 1.0)?;
        let mut draws = Draws::new(seed);
        let members = Points::latin(dimensions, population, &mut draws);
        Ok(Self { factor, crossover, members, pending: Pending::default(), draws, started: false })
    }

    fn trial(&mut self, i: usize) -> Vec<f64> {
        let n = self.members.len();
        let mut others = [i; 3];
        for k in 0..3 {
            loop {
                let j = self.draws.index(n);
                if j != i && !others[..k].contains(&j) {
                    others[k] = j;
                    break;
                }
            }
        }
        let forced = self.draws.index(self.members.dimensions);
        let mut trial = self.members.point(i).to_vec();
        for (d, x) in trial.iter_mut().enumerate() {
            if self.draws.uniform() < self.crossover || d == forced {
                let [a, b, c] = others.map(|j| self.members.point(j)[d]);
                *x = inside(a + self.factor * (b - c), *x);
            }
        }
        trial
    }
}

/// Returns `to`; if it is outside 0..=1, the point halfway between `from` and the bound.
pub(super) fn inside(to: f64, from: f64) -> f64 {
    if to < 0.0 {
        0.5 * from
    } else if to > 1.0 {
        0.5 * (1.0 + from)
    } else {
        to
    }
}

impl Optimizer for De {
    fn dimensions(&self) -> usize {
        self.members.dimensions
    }

    fn ask(&mut self) -> Asked<'_> {
        if self.pending.is_empty() {
            for i in 0..self.members.len() {
                let (point, hopeless) = if self.started {
                    (self.trial(i), self.members.costs[i])
                } else {
                    (self.members.point(i).to_vec(), f64::INFINITY)
                };
                self.pending.push(&point, hopeless);
            }
        }
        self.pending.asked()
    }

    fn tell(&mut self, costs: &[f64]) -> Result<(), SearchError> {
        self.pending.check(costs)?;
        let dimensions = self.members.dimensions;
        for (i, (cost, point)) in costs.iter().zip(self.pending.points.chunks_exact(dimensions)).enumerate() {
            let cost = comparable(*cost);
            if !self.started || cost < self.members.costs[i] {
                self.members.point_mut(i).copy_from_slice(point);
                self.members.costs[i] = cost;
            }
        }
        self.started = true;
        self.pending.clear();
        Ok(())
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.members.best().map(|i| (self.members.point(i), self.members.costs[i]))
    }

    fn extent(&self) -> f64 {
        self.members.extent()
    }
}
