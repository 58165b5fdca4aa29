//! Grey wolf optimizer (GWO).

use super::population::{Draws, Pending, Points, comparable};
use super::{Asked, MethodError, Optimizer, SearchError};

/// Grey wolf optimizer as in eq. 27–29 and algorithm 1 of the paper on temperature-dependent models.
///
/// Every wolf moves to the mean of the three points `X_l − A |C X_l − x|`, where `X_l` are the best three points so
/// far, `A = 2 a r − a` and `C = 2 r`. r is a new random number for each coordinate; a falls from 2 to 0 over the
/// generations.
///
/// `C` pulls towards the origin of the coordinates. The origin is the centre of the box here and its lower corner in
/// the paper. An optimum far from it is found more slowly. Coordinates outside the box are set to the bound.
/// Differential evolution needs fewer evaluations for all models of this project.
#[derive(Clone, Debug)]
pub struct Gwo {
    wolves: Points,
    /// The best three points so far, the best first.
    leaders: Points,
    generation: u64,
    generations: u64,
    origin: f64,
    pending: Pending,
    draws: Draws,
}

impl Gwo {
    /// Creates a search with `wolves` (at least three) for `generations`. `origin` is the position of the origin of the
    /// paper's equations in the box (0..=1, along every coordinate): 0 as printed, 0.5 for the centre.
    ///
    /// # Errors
    /// If a setting is out of its range; the message names it.
    pub fn new(
        dimensions: usize,
        wolves: usize,
        generations: u64,
        origin: f64,
        seed: u64,
    ) -> Result<Self, MethodError> {
        MethodError::at_least("population", wolves, 3)?;
        MethodError::within("origin", origin, 0.0, 1.0)?;
        let mut draws = Draws::new(seed);
        Ok(Self {
            wolves: Points::latin(dimensions, wolves, &mut draws),
            leaders: Points { dimensions, at: vec![0.0; 3 * dimensions], costs: vec![f64::INFINITY; 3] },
            generation: 0,
            generations: generations.max(1),
            origin,
            pending: Pending::default(),
            draws,
        })
    }

    fn move_wolves(&mut self) {
        let a = 2.0 * (1.0 - (self.generation as f64 / self.generations as f64).min(1.0));
        for i in 0..self.wolves.len() {
            for d in 0..self.wolves.dimensions {
                let x = self.wolves.point(i)[d] - self.origin;
                let mut sum = 0.0;
                for l in 0..3 {
                    let leader = self.leaders.point(l)[d] - self.origin;
                    let distance = (2.0 * self.draws.uniform() * leader - x).abs();
                    sum += leader - (2.0 * a * self.draws.uniform() - a) * distance;
                }
                self.wolves.point_mut(i)[d] = (sum / 3.0 + self.origin).clamp(0.0, 1.0);
            }
        }
    }

    /// Inserts a point into the leaders if it is better than one of them.
    fn rank(&mut self, i: usize) {
        let cost = self.wolves.costs[i];
        let Some(place) = (0..3).find(|l| cost < self.leaders.costs[*l]) else { return };
        for l in (place..2).rev() {
            self.leaders.costs[l + 1] = self.leaders.costs[l];
            let before = self.leaders.point(l).to_vec();
            self.leaders.point_mut(l + 1).copy_from_slice(&before);
        }
        self.leaders.costs[place] = cost;
        let point = self.wolves.point(i).to_vec();
        self.leaders.point_mut(place).copy_from_slice(&point);
    }
}

impl Optimizer for Gwo {
    fn dimensions(&self) -> usize {
        self.wolves.dimensions
    }

    fn ask(&mut self) -> Asked<'_> {
        if self.pending.is_empty() {
            if self.generation > 0 {
                self.move_wolves();
            }
            // A wolf only matters if it is better than the third leader.
            let hopeless = self.leaders.costs[2];
            for i in 0..self.wolves.len() {
                self.pending.push(self.wolves.point(i), hopeless);
            }
        }
        self.pending.asked()
    }

    fn tell(&mut self, costs: &[f64]) -> Result<(), SearchError> {
        self.pending.check(costs)?;
        for (i, cost) in costs.iter().enumerate() {
            self.wolves.costs[i] = comparable(*cost);
            self.rank(i);
        }
        if self.generation == 0 {
            // With fewer than three finite costs the best point replaces the missing leaders.
            let (best, cost) = (self.leaders.point(0).to_vec(), self.leaders.costs[0]);
            for l in 1..3 {
                if !self.leaders.costs[l].is_finite() && cost.is_finite() {
                    self.leaders.point_mut(l).copy_from_slice(&best);
                }
            }
        }
        self.generation += 1;
        self.pending.clear();
        Ok(())
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.leaders.best().map(|i| (self.leaders.point(i), self.leaders.costs[i]))
    }

    fn extent(&self) -> f64 {
        self.wolves.extent()
    }
}
