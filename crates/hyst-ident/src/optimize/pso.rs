//! Particle swarm.

use super::population::{Draws, Pending, Points, comparable};
use super::{Asked, MethodError, Optimizer, SearchError};

/// A particle swarm with a global best (Kennedy & Eberhart 1995): `v ← w v + c₁ r₁ (own best − x) + c₂ r₂ (global best
/// − x)`, `x ← x + v`, with new random numbers r for each coordinate.
///
/// It converges only for `c₁ + c₂ < 24 (1 − w²) / (7 − 5w)` (Poli 2009). A particle that reaches a bound stops there;
/// the velocity is at most half of the box.
#[derive(Clone, Debug)]
pub struct Pso {
    inertia: f64,
    own: f64,
    common: f64,
    /// Present position of each particle, with the cost there.
    now: Points,
    velocity: Vec<f64>,
    /// Best position of each particle.
    bests: Points,
    pending: Pending,
    draws: Draws,
    started: bool,
}

/// Maximum motion of a particle along one coordinate per generation, as a share of the box.
const MAX_VELOCITY: f64 = 0.5;

impl Pso {
    /// Creates a swarm of `particles` (at least two) with inertia w in 0..=1.2 and learning factors c₁ = `own`, c₂ =
    /// `common` in 0..=4.
    ///
    /// # Errors
    /// If a setting is out of its range; the message names it.
    pub fn new(
        dimensions: usize,
        particles: usize,
        inertia: f64,
        own: f64,
        common: f64,
        seed: u64,
    ) -> Result<Self, MethodError> {
        MethodError::at_least("population", particles, 2)?;
        MethodError::within("inertia", inertia, 0.0, 1.2)?;
        MethodError::within("own", own, 0.0, 4.0)?;
        MethodError::within("common", common, 0.0, 4.0)?;
        let mut draws = Draws::new(seed);
        let now = Points::latin(dimensions, particles, &mut draws);
        let velocity = (0..dimensions * particles).map(|_| MAX_VELOCITY * (draws.uniform() - 0.5)).collect();
        let bests = now.clone();
        Ok(Self { inertia, own, common, now, velocity, bests, pending: Pending::default(), draws, started: false })
    }

    fn move_particles(&mut self) {
        let dimensions = self.now.dimensions;
        let leader = self.bests.best().unwrap_or(0);
        for i in 0..self.now.len() {
            for d in 0..dimensions {
                let x = self.now.point(i)[d];
                let pull = self.own * self.draws.uniform() * (self.bests.point(i)[d] - x)
                    + self.common * self.draws.uniform() * (self.bests.point(leader)[d] - x);
                let v = &mut self.velocity[i * dimensions + d];
                *v = (self.inertia * *v + pull).clamp(-MAX_VELOCITY, MAX_VELOCITY);
                let to = x + *v;
                if !(0.0..=1.0).contains(&to) {
                    *v = 0.0;
                }
                self.now.point_mut(i)[d] = to.clamp(0.0, 1.0);
            }
        }
    }
}

impl Optimizer for Pso {
    fn dimensions(&self) -> usize {
        self.now.dimensions
    }

    fn ask(&mut self) -> Asked<'_> {
        if self.pending.is_empty() {
            if self.started {
                self.move_particles();
            }
            for i in 0..self.now.len() {
                self.pending.push(self.now.point(i), self.bests.costs[i]);
            }
        }
        self.pending.asked()
    }

    fn tell(&mut self, costs: &[f64]) -> Result<(), SearchError> {
        self.pending.check(costs)?;
        for (i, cost) in costs.iter().enumerate() {
            let cost = comparable(*cost);
            if cost < self.bests.costs[i] {
                self.bests.costs[i] = cost;
                let here = self.now.point(i).to_vec();
                self.bests.point_mut(i).copy_from_slice(&here);
            }
        }
        self.started = true;
        self.pending.clear();
        Ok(())
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.bests.best().map(|i| (self.bests.point(i), self.bests.costs[i]))
    }

    fn extent(&self) -> f64 {
        self.now.extent()
    }
}
