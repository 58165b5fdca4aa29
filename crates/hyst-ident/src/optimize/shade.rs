//! Adaptive differential evolution: L-SHADE.

use super::de::inside;
use super::population::{Draws, Pending, Points, comparable};
use super::{Asked, MethodError, Optimizer, SearchError};

/// Success-history based adaptive differential evolution with linear population reduction (Tanabe & Fukunaga 2014).
///
/// Mutants are `v = xᵢ + F (x_p − xᵢ) + F (x_a − x_b)`, with x_p one of the best `p N`, and x_b also from an archive of
/// replaced members. F and CR are random about means that follow the successful values. Settings of the paper: memory
/// of 6, p = 0.11, archive 2.6 N, 4 members at the end. The population is reduced with the number of evaluations, in
/// steps of two (here only), so the budget of evaluations must be known.
///
/// Half of the trial points are crossed along the principal axes of the better half of the members instead of the
/// coordinates (Guo & Yang 2015, IEEE Trans. Evol. Comput. 19): the parameters of a hysteresis model are correlated,
/// and steps along the coordinates make little progress in a narrow oblique valley.
#[derive(Clone, Debug)]
pub struct Shade {
    members: Points,
    archive: Vec<Vec<f64>>,
    factors: [f64; MEMORY],
    /// `None`: the crossover rate is fixed at 0 (terminal value of the paper).
    crossovers: [Option<f64>; MEMORY],
    slot: usize,
    used: Vec<(f64, f64)>,
    pending: Pending,
    draws: Draws,
    initial: usize,
    spent: u64,
    budget: u64,
    started: bool,
}

const MEMORY: usize = 6;
/// p: share of the best members for x_p.
const BEST_SHARE: f64 = 0.11;
/// Size of the archive, as a multiple of the population.
const ARCHIVE_RATIO: f64 = 2.6;
/// Minimum population.
const MIN_POPULATION: usize = 4;
/// Share of the trial points that are crossed along the principal axes.
const ROTATED_SHARE: f64 = 0.5;
/// Width of the distributions of F and CR about their means.
const DISTRIBUTION_WIDTH: f64 = 0.1;

impl Shade {
    /// Creates a search with an initial `population` (at least four) for `budget` evaluations.
    ///
    /// # Errors
    /// If a setting is out of its range; the message names it.
    pub fn new(dimensions: usize, population: usize, budget: u64, seed: u64) -> Result<Self, MethodError> {
        MethodError::at_least("population", population, MIN_POPULATION)?;
        let mut draws = Draws::new(seed);
        let members = Points::latin(dimensions, population, &mut draws);
        Ok(Self {
            members,
            archive: Vec::new(),
            factors: [0.5; MEMORY],
            crossovers: [Some(0.5); MEMORY],
            slot: 0,
            used: Vec::new(),
            pending: Pending::default(),
            draws,
            initial: population,
            spent: 0,
            budget,
            started: false,
        })
    }

    /// Returns F and CR of one trial point.
    fn settings(&mut self) -> (f64, f64) {
        let slot = self.draws.index(MEMORY);
        let crossover = match self.crossovers[slot] {
            Some(mean) => (mean + DISTRIBUTION_WIDTH * self.draws.normal()).clamp(0.0, 1.0),
            None => 0.0,
        };
        loop {
            let factor = self.draws.cauchy(self.factors[slot], DISTRIBUTION_WIDTH);
            if factor > 0.0 {
                return (factor.min(1.0), crossover);
            }
        }
    }

    fn trial(&mut self, i: usize, ranked: &[usize], axes: &[Vec<f64>]) -> Vec<f64> {
        let n = self.members.len();
        let (factor, crossover) = self.settings();
        self.used.push((factor, crossover));
        let leaders = ((BEST_SHARE * n as f64).round() as usize).clamp(2, n);
        let leader = ranked[self.draws.index(leaders)];
        let a = loop {
            let a = self.draws.index(n);
            if a != i {
                break a;
            }
        };
        let b = loop {
            let b = self.draws.index(n + self.archive.len());
            if b != i && b != a {
                break b;
            }
        };
        let forced = self.draws.index(self.members.dimensions);
        let mut trial = self.members.point(i).to_vec();
        let (leader, a) = (self.members.point(leader), self.members.point(a));
        let replaced = if b < n { self.members.point(b) } else { &self.archive[b - n] };
        let step = |d: usize| factor * (leader[d] - trial[d]) + factor * (a[d] - replaced[d]);
        let mut step: Vec<f64> = (0..trial.len()).map(step).collect();
        let rotated = self.draws.uniform() < ROTATED_SHARE;
        if rotated {
            step = axes.iter().map(|axis| axis.iter().zip(&step).map(|(a, s)| a * s).sum()).collect();
        }
        for (d, s) in step.iter_mut().enumerate() {
            if self.draws.uniform() >= crossover && d != forced {
                *s = 0.0;
            }
        }
        if rotated {
            let back = |d: usize| axes.iter().zip(&step).map(|(axis, s)| axis[d] * s).sum();
            step = (0..trial.len()).map(back).collect();
        }
        for (x, s) in trial.iter_mut().zip(step) {
            *x = inside(*x + s, *x);
        }
        trial
    }

    /// Updates the means with the successful settings, weighted by their gain.
    fn learn(&mut self, succeeded: &[(f64, f64, f64)]) {
        let total: f64 = succeeded.iter().map(|s| s.2).sum();
        if succeeded.is_empty() || total.is_nan() || total <= 0.0 {
            return;
        }
        // A gain from an infinite cost has no size: all successes then have the same weight.
        let weight = |gain: f64| if total.is_finite() { gain / total } else { 1.0 / succeeded.len() as f64 };
        let lehmer = |of: &dyn Fn(&(f64, f64, f64)) -> f64| {
            let squares: f64 = succeeded.iter().map(|s| weight(s.2) * of(s) * of(s)).sum();
            let plain: f64 = succeeded.iter().map(|s| weight(s.2) * of(s)).sum();
            if plain > 0.0 { Some(squares / plain) } else { None }
        };
        if let Some(mean) = lehmer(&|s| s.0) {
            self.factors[self.slot] = mean;
        }
        self.crossovers[self.slot] = match self.crossovers[self.slot] {
            Some(_) => lehmer(&|s| s.1),
            None => None,
        };
        self.slot = (self.slot + 1) % MEMORY;
    }

    /// Removes the worst members down to the population for the number of evaluations so far.
    fn shrink(&mut self) {
        let share = (self.spent as f64 / self.budget.max(1) as f64).min(1.0);
        let target = self.initial as f64 + (MIN_POPULATION as f64 - self.initial as f64) * share;
        // In steps of two: an odd generation leaves one core idle for half of an evaluation.
        let target = (target.round() as usize).next_multiple_of(2).max(MIN_POPULATION);
        if target < self.members.len() {
            let mut kept = self.members.ranked();
            kept.truncate(target);
            // In their old order: the order only affects the random numbers.
            kept.sort_unstable();
            let at = kept.iter().flat_map(|i| self.members.point(*i).to_vec()).collect();
            let costs = kept.iter().map(|i| self.members.costs[*i]).collect();
            self.members = Points { dimensions: self.members.dimensions, at, costs };
        }
        self.trim_archive();
    }

    fn trim_archive(&mut self) {
        let room = (ARCHIVE_RATIO * self.members.len() as f64).round() as usize;
        while self.archive.len() > room {
            let out = self.draws.index(self.archive.len());
            self.archive.swap_remove(out);
        }
    }
}

impl Optimizer for Shade {
    fn dimensions(&self) -> usize {
        self.members.dimensions
    }

    fn ask(&mut self) -> Asked<'_> {
        if self.pending.is_empty() {
            self.used.clear();
            let ranked = self.members.ranked();
            let axes = self.members.axes(&ranked[..ranked.len().div_ceil(2)]);
            for i in 0..self.members.len() {
                let (point, hopeless) = if self.started {
                    (self.trial(i, &ranked, &axes), self.members.costs[i])
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
        self.spent += costs.len() as u64;
        let dimensions = self.members.dimensions;
        let mut succeeded = Vec::new();
        for (i, (cost, point)) in costs.iter().zip(self.pending.points.chunks_exact(dimensions)).enumerate() {
            let (cost, before) = (comparable(*cost), self.members.costs[i]);
            if !self.started {
                self.members.costs[i] = cost;
            } else if cost < before {
                let (factor, crossover) = self.used[i];
                succeeded.push((factor, crossover, before - cost));
                self.archive.push(self.members.point(i).to_vec());
                self.members.point_mut(i).copy_from_slice(point);
                self.members.costs[i] = cost;
            }
        }
        self.started = true;
        self.pending.clear();
        self.learn(&succeeded);
        self.shrink();
        Ok(())
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.members.best().map(|i| (self.members.point(i), self.members.costs[i]))
    }

    fn extent(&self) -> f64 {
        self.members.extent()
    }
}
