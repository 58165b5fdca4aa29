//! Global searches over a box: differential evolution, particle swarm, grey wolves.
//!
//! Each is an [`Optimizer`] with an ask-and-tell interface: it asks for the costs of a generation of points, and the
//! caller returns them. [`minimize`] is the usual caller. It computes costs in parallel; random numbers are drawn
//! serially, so a seed gives the same bits on any number of threads. A cost that is not a number is worse than every
//! other.
//!
//! | search | file | source |
//! |---|---|---|
//! | differential evolution, DE/rand/1/bin | `de.rs` | Storn & Price (1997), J. Glob. Optim. 11 |
//! | adaptive differential evolution (L-SHADE) | `shade.rs` | Tanabe & Fukunaga (2014), CEC |
//! | particle swarm | `pso.rs` | Kennedy & Eberhart (1995); constriction: Clerc & Kennedy (2002) |
//! | grey wolves | `gwo.rs` | Mirjalili et al. (2014), Adv. Eng. Softw. 69 |
//!
//! `method.rs` contains their names and presets (with the settings of the papers), `space.rs` the box, `run.rs` the
//! loop and its stop conditions, and `trials.rs` repeated searches and the scatter of their results.

mod de;
mod error;
mod gwo;
mod method;
mod population;
mod pso;
mod run;
mod shade;
mod space;
#[cfg(test)]
mod tests;
mod trials;

pub use de::De;
pub use error::{MethodError, SearchError};
pub use gwo::Gwo;
pub use method::Method;
pub use pso::Pso;
pub use run::{Cost, Found, Progress, Stop, Stopped, TraceRow, minimize};
pub use shade::Shade;
pub use space::{Scale, Space, SpaceError, Variable};
pub use trials::{Spread, Trials, trials};

/// Points whose costs an optimizer asks for.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The points one after another, each of [`Optimizer::dimensions`] coordinates in 0..=1.
    pub points: &'a [f64],
    /// Limit for each point: a cost at or above it has no influence on the search. The evaluation may stop there and
    /// return any number at or above the limit.
    pub hopeless: &'a [f64],
}

/// A search in the unit cube with an ask-and-tell interface.
pub trait Optimizer {
    /// Returns the number of coordinates of a point.
    fn dimensions(&self) -> usize;

    /// Returns the next points. A second call before [`tell`](Self::tell) returns the same ones.
    fn ask(&mut self) -> Asked<'_>;

    /// Receives the costs of the last points, in their order. A cost that is not finite is the worst.
    ///
    /// # Errors
    /// If no points were asked for, or the number of costs differs from that of the points.
    fn tell(&mut self, costs: &[f64]) -> Result<(), SearchError>;

    /// Returns the best point so far and its cost.
    fn best(&self) -> Option<(&[f64], f64)>;

    /// Returns the largest extent of the population along any coordinate, as a share of the box; small after
    /// convergence.
    fn extent(&self) -> f64;
}
