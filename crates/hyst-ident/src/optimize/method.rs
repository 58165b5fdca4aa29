//! Searches by name, and their presets.

use super::error::{MethodError, NAMES};
use super::{De, Gwo, Optimizer, Pso, Shade};

/// A search and its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// [`Shade`].
    Shade {
        /// Initial number of members; `None` to derive it from the number of evaluations.
        population: Option<usize>,
    },
    /// [`De`].
    De {
        /// Number of members.
        population: usize,
        /// F.
        factor: f64,
        /// CR.
        crossover: f64,
    },
    /// [`Pso`].
    Pso {
        /// Number of particles.
        population: usize,
        /// w.
        inertia: f64,
        /// c₁.
        own: f64,
        /// c₂.
        common: f64,
    },
    /// [`Gwo`].
    Gwo {
        /// Number of wolves.
        population: usize,
        /// Position of the origin of its equations in the box.
        origin: f64,
    },
}

impl Method {
    /// Names for [`named`](Self::named).
    pub const NAMES: [&'static str; 6] = NAMES;

    /// Returns a search by its name, with settings for a number of variables:
    ///
    /// - `de`: L-SHADE with one member per 300 evaluations, at least 20 and at most 18 per variable or 120; the best
    ///   choice for all models of this project.
    /// - `de-rand-1-bin`: ten members per variable, F = 0.5, CR = 0.9 (Storn & Price).
    /// - `pso`: 40 particles, Clerc's constriction (w = 0.7298, c = 1.49618).
    /// - `pso-xie`: 30 particles, w = 0.8, c = 1.5, as in the paper on activation functions (200 iterations there).
    ///   Slightly beyond the stability limit, so the swarm does not converge fully.
    /// - `gwo`: 50 wolves, origin in the centre of the box.
    /// - `gwo-paper`: 100 wolves, origin in its lower corner, as in the paper on temperature-dependent models (3000
    ///   generations).
    ///
    /// # Errors
    /// If the name is unknown.
    pub fn named(name: &str, dimensions: usize) -> Result<Self, MethodError> {
        Ok(match name {
            "de" => Self::Shade { population: None },
            "de-rand-1-bin" => Self::De { population: 10 * dimensions.max(1), factor: 0.5, crossover: 0.9 },
            "pso" => Self::Pso { population: 40, inertia: 0.7298, own: 1.49618, common: 1.49618 },
            "pso-xie" => Self::Pso { population: 30, inertia: 0.8, own: 1.5, common: 1.5 },
            "gwo" => Self::Gwo { population: 50, origin: 0.5 },
            "gwo-paper" => Self::Gwo { population: 100, origin: 0.0 },
            _ => return Err(MethodError::Unknown { name: name.into() }),
        })
    }

    /// Returns the same search with another population.
    #[must_use]
    pub fn with_population(mut self, count: usize) -> Self {
        match &mut self {
            Self::Shade { population } => *population = Some(count),
            Self::De { population, .. } | Self::Pso { population, .. } | Self::Gwo { population, .. } => {
                *population = count;
            }
        }
        self
    }

    /// Returns the initial number of members, particles or wolves.
    pub fn members(&self, dimensions: usize, evaluations: u64) -> usize {
        match *self {
            Self::Shade { population } => population.unwrap_or_else(|| default_population(dimensions, evaluations)),
            Self::De { population, .. } | Self::Pso { population, .. } | Self::Gwo { population, .. } => population,
        }
    }

    /// Creates the search for a number of variables and of evaluations.
    ///
    /// # Errors
    /// If a setting is out of its range.
    pub fn build(
        &self,
        dimensions: usize,
        evaluations: u64,
        seed: u64,
    ) -> Result<Box<dyn Optimizer + Send>, MethodError> {
        Ok(match *self {
            Self::Shade { .. } => {
                Box::new(Shade::new(dimensions, self.members(dimensions, evaluations), evaluations, seed)?)
            }
            Self::De { population, factor, crossover } => {
                Box::new(De::new(dimensions, population, factor, crossover, seed)?)
            }
            Self::Pso { population, inertia, own, common } => {
                Box::new(Pso::new(dimensions, population, inertia, own, common, seed)?)
            }
            Self::Gwo { population, origin } => {
                let generations = evaluations / (population.max(1) as u64);
                Box::new(Gwo::new(dimensions, population, generations, origin, seed)?)
            }
        })
    }
}

/// Returns the number of members for [`Shade`]. Its authors use 18 per variable for 10,000 evaluations per variable.
/// With fewer evaluations such a population has too few generations to converge. One member per 300 evaluations gives
/// about 600 generations.
fn default_population(dimensions: usize, evaluations: u64) -> usize {
    let most = (18 * dimensions).clamp(20, 120);
    usize::try_from(evaluations / 300).unwrap_or(most).clamp(20, most)
}
