//! The loop of a search: costs in parallel, stop conditions, and the trace.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::error::SearchError;
use super::{Optimizer, Space};

/// The function to minimise. A call computes the costs of several points, so an implementation can evaluate them
/// together.
pub trait Cost: Sync {
    /// Returns the preferred number of points per call.
    fn width(&self) -> usize {
        1
    }

    /// Writes the costs of points (one after another, in the units of the [`Space`]) to `costs`. The cost of a point
    /// must depend on that point only. A cost at or above `hopeless` has no influence: its evaluation may stop and
    /// return any larger number.
    fn costs(&self, points: &[f64], hopeless: &[f64], costs: &mut [f64]);
}

/// A function of one point is a cost.
impl<F: Fn(&[f64]) -> f64 + Sync> Cost for F {
    fn costs(&self, points: &[f64], _hopeless: &[f64], costs: &mut [f64]) {
        let dimensions = points.len() / costs.len().max(1);
        for (cost, point) in costs.iter_mut().zip(points.chunks_exact(dimensions)) {
            *cost = self(point);
        }
    }
}

/// Stop conditions of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Maximum number of evaluations. A generation that would exceed it is not started.
    pub evaluations: u64,
    /// Stops if the best cost is at most this.
    pub target: f64,
    /// Stops if the largest extent of the population is at most this share of the box.
    pub tolerance: f64,
    /// Stops if the best cost has not fallen by 10⁻⁹ of its value for this number of generations.
    pub stall: u64,
}

impl Stop {
    /// Returns the conditions: at most `evaluations`, or a population extent of at most 10⁻¹² of the box.
    pub fn after(evaluations: u64) -> Self {
        Self { evaluations, target: f64::NEG_INFINITY, tolerance: 1e-12, stall: u64::MAX }
    }
}

/// Reason why a search stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stopped {
    /// The evaluations are used up.
    Budget,
    /// The cost reached the target.
    Target,
    /// The population has converged.
    Converged,
    /// The cost did not fall any more.
    Stalled,
    /// The caller stopped it.
    Told,
}

/// One generation of a search.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TraceRow {
    /// Number of the generation, from 0.
    pub generation: u64,
    /// Evaluations so far.
    pub evaluations: u64,
    /// Lowest cost so far.
    pub cost: f64,
    /// Values of the variables with that cost, in the units of the space.
    pub values: Vec<f64>,
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Values of the variables.
    pub values: Vec<f64>,
    /// Their cost.
    pub cost: f64,
    /// Number of evaluations.
    pub evaluations: u64,
    /// Reason why it stopped.
    pub stopped: Stopped,
    /// The best of each generation.
    pub trace: Vec<TraceRow>,
}

/// Progress of a search.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Evaluations so far.
    pub evaluations: u64,
    /// Maximum number of evaluations.
    pub budget: u64,
    /// Lowest cost so far.
    pub cost: f64,
}

/// Maximum number of generations without a finite cost.
const MAX_GENERATIONS_WITHOUT_COST: u64 = 20;
/// Minimum relative fall of the cost that counts.
const MIN_RELATIVE_FALL: f64 = 1e-9;

/// Runs a search to its end. `watch` is called after every generation and may stop the search.
///
/// Costs are computed in parallel, in groups that depend only on their order. Any number of threads gives the same
/// bits.
///
/// # Errors
/// If no point of the first twenty generations has a finite cost, or the optimizer and the space have different
/// dimensions.
pub fn minimize(
    space: &Space,
    cost: &dyn Cost,
    optimizer: &mut dyn Optimizer,
    stop: &Stop,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Found, SearchError> {
    let dimensions = space.dimensions();
    if optimizer.dimensions() != dimensions {
        return Err(SearchError::Dimensions { optimizer: optimizer.dimensions(), space: dimensions });
    }
    let width = cost.width().max(1);
    let (mut values, mut costs) = (Vec::new(), Vec::new());
    let (mut evaluations, mut trace) = (0u64, Vec::<TraceRow>::new());
    let (mut lowest, mut since) = (f64::INFINITY, 0u64);
    for generation in 0.. {
        let asked = optimizer.ask();
        let count = asked.hopeless.len();
        if evaluations + count as u64 > stop.evaluations {
            if generation == 0 {
                return Err(SearchError::TooFew { evaluations: stop.evaluations, population: count });
            }
            return Ok(end(optimizer, space, evaluations, Stopped::Budget, trace));
        }
        values.resize(count * dimensions, 0.0);
        costs.clear();
        costs.resize(count, f64::INFINITY);
        for (value, point) in values.chunks_exact_mut(dimensions).zip(asked.points.chunks_exact(dimensions)) {
            space.values_into(point, value);
        }
        let groups = costs.par_chunks_mut(width).zip(values.par_chunks(width * dimensions));
        // Groups are distributed one by one, so no thread has several groups left at the end of a generation.
        groups
            .zip(asked.hopeless.par_chunks(width))
            .with_max_len(1)
            .for_each(|((costs, points), hopeless)| cost.costs(points, hopeless, costs));
        evaluations += count as u64;
        optimizer.tell(&costs)?;
        let Some((point, best)) = optimizer.best() else {
            if generation + 1 >= MAX_GENERATIONS_WITHOUT_COST || evaluations + count as u64 > stop.evaluations {
                return Err(SearchError::NeverFinite { evaluations, bounds: bounds(space) });
            }
            continue;
        };
        trace.push(TraceRow { generation, evaluations, cost: best, values: space.values(point) });
        if best < lowest - MIN_RELATIVE_FALL * lowest.abs() || !lowest.is_finite() {
            (lowest, since) = (best, 0);
        } else {
            since += 1;
        }
        let stopped = if watch(Progress { evaluations, budget: stop.evaluations, cost: best }).is_break() {
            Some(Stopped::Told)
        } else if best <= stop.target {
            Some(Stopped::Target)
        } else if optimizer.extent() <= stop.tolerance {
            Some(Stopped::Converged)
        } else if since >= stop.stall {
            Some(Stopped::Stalled)
        } else {
            None
        };
        if let Some(stopped) = stopped {
            return Ok(end(optimizer, space, evaluations, stopped, trace));
        }
    }
    Err(SearchError::NeverFinite { evaluations, bounds: bounds(space) })
}

fn end(optimizer: &dyn Optimizer, space: &Space, evaluations: u64, stopped: Stopped, trace: Vec<TraceRow>) -> Found {
    let (values, cost) = optimizer.best().map_or((Vec::new(), f64::INFINITY), |(p, cost)| (space.values(p), cost));
    Found { values, cost, evaluations, stopped, trace }
}

fn bounds(space: &Space) -> String {
    let of = |v: &super::Variable| format!("{} {} … {}", v.name, v.lower, v.upper);
    space.variables().iter().map(of).collect::<Vec<_>>().join(", ")
}
