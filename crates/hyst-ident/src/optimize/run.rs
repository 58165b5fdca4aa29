//! The loop of a search: costs in parallel, reasons to stop, what happened on the way.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{Optimizer, Space};

/// What is minimised. A call computes the costs of some points at once, so that an implementation can evaluate them side by side.
pub trait Cost: Sync {
    /// How many points one call likes to get.
    fn width(&self) -> usize {
        1
    }

    /// The costs of points (one after the other, in the units of the [`Space`]) into `costs`. A point's cost must depend on that
    /// point alone. From `hopeless` on, a cost changes nothing: its evaluation may be given up, with any larger number.
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

/// When a search ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// After this many evaluations (the generation in which they are reached is not begun).
    pub evaluations: u64,
    /// When the best cost is at most this.
    pub target: f64,
    /// When the population's largest extent is at most this share of the box.
    pub tolerance: f64,
    /// When the best cost has not fallen by a part in 10⁹ for so many generations.
    pub stall: u64,
}

impl Stop {
    /// After `evaluations`, or when the population has shrunk to 10⁻¹² of the box.
    pub fn after(evaluations: u64) -> Self {
        Self { evaluations, target: f64::NEG_INFINITY, tolerance: 1e-12, stall: u64::MAX }
    }
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stopped {
    /// Its evaluations were spent.
    Budget,
    /// The target was reached.
    Target,
    /// The population is in one place.
    Converged,
    /// Nothing better was found for long.
    Stalled,
    /// It was told to.
    Told,
}

/// One generation of a search.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TraceRow {
    /// Number of the generation, from zero.
    pub generation: u64,
    /// Evaluations so far.
    pub evaluations: u64,
    /// Lowest cost so far.
    pub cost: f64,
    /// Where it is, in the units of the space.
    pub values: Vec<f64>,
}

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Values of the variables.
    pub values: Vec<f64>,
    /// Their cost.
    pub cost: f64,
    /// Evaluations that it took.
    pub evaluations: u64,
    /// Why it ended.
    pub stopped: Stopped,
    /// The best of each generation.
    pub trace: Vec<TraceRow>,
}

/// How far a search is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Evaluations so far.
    pub evaluations: u64,
    /// Most that there will be.
    pub budget: u64,
    /// Lowest cost so far.
    pub cost: f64,
}

/// Why a search found nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SearchError {
    /// No point has a finite cost.
    #[error(
        "none of {evaluations} parameter sets within the bounds gives a finite output; the bounds that were tried: {bounds}"
    )]
    NeverFinite {
        /// How many were tried.
        evaluations: u64,
        /// The box.
        bounds: String,
    },
    /// Costs that do not belong to what was asked.
    #[error("{told} costs told, {asked} asked for")]
    Told {
        /// Costs asked for.
        asked: usize,
        /// Costs told.
        told: usize,
    },
    /// The optimizer searches another number of variables.
    #[error("the optimizer has {optimizer} coordinates, the space {space} variables")]
    Dimensions {
        /// Coordinates of the optimizer.
        optimizer: usize,
        /// Variables of the space.
        space: usize,
    },
    /// Fewer evaluations than one generation takes.
    #[error("{evaluations} evaluations are fewer than one generation of {population}")]
    TooFew {
        /// The evaluations allowed.
        evaluations: u64,
        /// The population.
        population: usize,
    },
    /// A search cannot be set up.
    #[error(transparent)]
    Method(#[from] super::MethodError),
}

/// Generations that may pass without one finite cost.
const FRUITLESS: u64 = 20;
/// Fall of the cost that counts as one.
const FALL: f64 = 1e-9;

/// Runs a search to its end. `watch` is called after every generation and may end it.
///
/// Costs are computed in parallel, in groups that depend on nothing but their order: any number of threads gives the same bits.
///
/// # Errors
/// If no point of the first twenty generations has a finite cost, or optimizer and space do not belong together.
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
        // One by one: who is left with several at the end of a generation keeps the others waiting.
        groups
            .zip(asked.hopeless.par_chunks(width))
            .with_max_len(1)
            .for_each(|((costs, points), hopeless)| cost.costs(points, hopeless, costs));
        evaluations += count as u64;
        optimizer.tell(&costs)?;
        let Some((point, best)) = optimizer.best() else {
            if generation + 1 >= FRUITLESS || evaluations + count as u64 > stop.evaluations {
                return Err(SearchError::NeverFinite { evaluations, bounds: bounds(space) });
            }
            continue;
        };
        trace.push(TraceRow { generation, evaluations, cost: best, values: space.values(point) });
        if best < lowest - FALL * lowest.abs() || !lowest.is_finite() {
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
