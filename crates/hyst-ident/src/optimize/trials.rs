//! Several searches with different seeds, and how their results scatter.

use std::ops::ControlFlow;

use super::{Cost, Found, Method, Progress, SearchError, Space, Stop, Variable, minimize};

/// How one number scatters over trials: what a box plot shows.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Smallest.
    pub lowest: f64,
    /// A quarter of the trials lies below it.
    pub lower_quartile: f64,
    /// Half of the trials lies below it.
    pub median: f64,
    /// Three quarters of the trials lie below it.
    pub upper_quartile: f64,
    /// Largest.
    pub highest: f64,
}

impl Spread {
    /// Of some numbers, quartiles interpolated between neighbours; `None` of nothing.
    pub fn of(numbers: &[f64]) -> Option<Self> {
        let mut sorted = numbers.to_vec();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let at = |share: f64| {
            let place = share * last as f64;
            let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
            if low == high { low } else { low + (high - low) * place.fract() }
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

/// Several searches.
#[derive(Clone, Debug, PartialEq)]
pub struct Trials {
    /// What is searched; the values of a [`Found`] are in this order.
    pub variables: Vec<Variable>,
    /// What each found, in the order of their seeds.
    pub found: Vec<Found>,
}

impl Trials {
    /// The best of them.
    pub fn best(&self) -> Option<&Found> {
        self.found.iter().min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// How the costs scatter.
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
    // Before there is memory asked for that nobody has.
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
