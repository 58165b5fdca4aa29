//! Several searches with different seeds, and the scatter of their results.

use std::ops::ControlFlow;

use super::{Cost, Found, Method, Progress, SearchError, Space, Stop, Variable, minimize};

/// Scatter of a number over trials, as in a box plot.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Minimum.
    pub lowest: f64,
    /// A quarter of the trials is below it.
    pub lower_quartile: f64,
    /// Half of the trials is below it.
    pub median: f64,
    /// Three quarters of the trials are below it.
    pub upper_quartile: f64,
    /// Maximum.
    pub highest: f64,
}

impl Spread {
    /// Returns the scatter of some numbers, with interpolated quartiles; `None` for no number.
    pub fn of(numbers: &[f64]) -> Option<Self> {
        let mut sorted = numbers.to_vec();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let at = |share: f64| {
            let position = share * last as f64;
            let (low, high) = (sorted[position.floor() as usize], sorted[position.ceil() as usize]);
            if low == high { low } else { low + (high - low) * position.fract() }
        };
        Some(Self {
            lowest: at(0.0),
            lower_quartile: at(0.25),
            median: at(0.5),
            upper_quartile: at(0.75),
            highest: at(1.0),
        })
    }
}

/// Results of several searches.
#[derive(Clone, Debug, PartialEq)]
pub struct Trials {
    /// The variables; the values of a [`Found`] are in this order.
    pub variables: Vec<Variable>,
    /// Result of each search, in the order of the seeds.
    pub found: Vec<Found>,
}

impl Trials {
    /// Returns the best one.
    pub fn best(&self) -> Option<&Found> {
        self.found.iter().min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// Returns the scatter of the costs.
    pub fn costs(&self) -> Option<Spread> {
        Spread::of(&self.found.iter().map(|f| f.cost).collect::<Vec<_>>())
    }
}

/// Runs a search `count` times, with seeds `seed`, `seed + 1`, …
///
/// # Errors
/// As [`minimize`]; also if `count` is zero.
pub fn trials(
    space: &Space,
    cost: &dyn Cost,
    method: &Method,
    stop: &Stop,
    seed: u64,
    count: usize,
    watch: &mut dyn FnMut(usize, Progress) -> ControlFlow<()>,
) -> Result<Trials, SearchError> {
    super::MethodError::at_least("trials", count, 1)?;
    // Before memory is allocated for a huge population.
    let population = method.members(space.dimensions(), stop.evaluations);
    if population as u64 > stop.evaluations {
        return Err(SearchError::TooFew { evaluations: stop.evaluations, population });
    }
    let mut found = Vec::new();
    for trial in 0..count {
        let mut search = method.build(space.dimensions(), stop.evaluations, seed.wrapping_add(trial as u64))?;
        found.push(minimize(space, cost, search.as_mut(), stop, &mut |p| watch(trial, p))?);
    }
    Ok(Trials { variables: space.variables().to_vec(), found })
}
