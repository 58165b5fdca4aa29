//! Global searches over a box: differential evolution, particle swarm, grey wolves.
//!
//! Each is an [`Optimizer`]: it *asks* for the costs of a generation of points and is *told* them, so that a caller can drive it
//! himself. [`minimize`] does it for him: costs in parallel, random draws serial, so that a seed gives the same bits on any
//! number of threads. A cost that is no number loses against every other.
//!
//! | search | file | source |
//! |---|---|---|
//! | differential evolution, DE/rand/1/bin | `de.rs` | Storn & Price (1997), J. Glob. Optim. 11 |
//! | adaptive differential evolution (L-SHADE) | `shade.rs` | Tanabe & Fukunaga (2014), CEC |
//! | particle swarm | `pso.rs` | Kennedy & Eberhart (1995); constriction: Clerc & Kennedy (2002) |
//! | grey wolves | `gwo.rs` | Mirjalili et al. (2014), Adv. Eng. Softw. 69 |
//!
//! `method.rs` names them and their presets (the settings of the papers among them), `space.rs` is the box, `run.rs` the loop
//! with its reasons to stop, `trials.rs` repeats a search and says how its results scatter.

mod de;
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
pub use gwo::Gwo;
pub use method::{Method, MethodError};
pub use pso::Pso;
pub use run::{Cost, Found, Progress, SearchError, Stop, Stopped, TraceRow, minimize};
pub use shade::Shade;
pub use space::{Scale, Space, SpaceError, Variable};
pub use trials::{Spread, Trials, trials};

/// Points whose costs an optimizer wants to know.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The points one after the other, each of [`Optimizer::dimensions`] coordinates in 0..=1.
    pub points: &'a [f64],
    /// For each point, the cost from which on it changes nothing whatever it is: its evaluation may be given up there, and
    /// any number at least as large be told.
    pub hopeless: &'a [f64],
}

/// A search in the unit cube that asks for costs and is told them.
pub trait Optimizer {
    /// Coordinates of a point.
    fn dimensions(&self) -> usize;

    /// The next points. Asking again before telling gives the same ones.
    fn ask(&mut self) -> Asked<'_>;

    /// The costs of the points last asked for, in their order. What is no finite number loses.
    ///
    /// # Errors
    /// If nothing was asked or the number of costs is not that of the points.
    fn tell(&mut self, costs: &[f64]) -> Result<(), SearchError>;

    /// The best point so far and its cost.
    fn best(&self) -> Option<(&[f64], f64)>;

    /// Largest extent of the present population along any coordinate, as a share of the box: small when it has converged.
    fn extent(&self) -> f64;
}
