//! Errors of searches and of their settings.

/// Names of the searches.
pub(super) const NAMES: [&str; 6] = ["de", "de-rand-1-bin", "pso", "pso-xie", "gwo", "gwo-paper"];

/// Errors of the settings of a search.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MethodError {
    /// The population is too small.
    #[error("{setting} = {value}: this search needs at least {least}")]
    TooFew {
        /// The setting.
        setting: &'static str,
        /// Its value.
        value: usize,
        /// Its minimum.
        least: usize,
    },
    /// A setting is out of its range.
    #[error("{setting} = {value}: it has to be from {lower} to {upper}")]
    OutOfRange {
        /// The setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// The name is unknown.
    #[error("unknown search {name}; available searches: {}", NAMES.join(", "))]
    Unknown {
        /// The name given.
        name: String,
    },
}

impl MethodError {
    pub(super) fn at_least(setting: &'static str, value: usize, least: usize) -> Result<(), Self> {
        if value >= least { Ok(()) } else { Err(Self::TooFew { setting, value, least }) }
    }

    pub(super) fn within(setting: &'static str, value: f64, lower: f64, upper: f64) -> Result<(), Self> {
        if (lower..=upper).contains(&value) { Ok(()) } else { Err(Self::OutOfRange { setting, value, lower, upper }) }
    }
}

/// Errors of a search.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SearchError {
    /// No point has a finite cost.
    #[error("none of {evaluations} parameter sets gives a finite output; check the bounds: {bounds}")]
    NeverFinite {
        /// Number of evaluations.
        evaluations: u64,
        /// The bounds.
        bounds: String,
    },
    /// The number of costs differs from the number of points.
    #[error("{told} costs for {asked} points")]
    Told {
        /// Number of points.
        asked: usize,
        /// Number of costs.
        told: usize,
    },
    /// The optimizer has another number of variables.
    #[error("the optimizer has {optimizer} coordinates, the space {space} variables")]
    Dimensions {
        /// Number of coordinates of the optimizer.
        optimizer: usize,
        /// Number of variables of the space.
        space: usize,
    },
    /// The evaluations are fewer than one generation.
    #[error("{evaluations} evaluations are fewer than one generation of {population}")]
    TooFew {
        /// Maximum number of evaluations.
        evaluations: u64,
        /// The population.
        population: usize,
    },
    /// A setting of the search is invalid.
    #[error(transparent)]
    Method(#[from] MethodError),
}
