//! The classical Preisach operator as an Everett map on a grid, the dynamic model based on it, and their inverses.
//!
//! The output is a sum over relays (α, β) with α ≥ β. Their common memory is the stack of dominating reversals
//! (Mayergoyz 2003). `reversals.rs` is that stack, `everett.rs` the map, `surface.rs` the map from measured tables,
//! `operator.rs` the operator and its inverse, `inverse_surface.rs` the approximate inverse, `mirror.rs` and `dpm/` the
//! dynamic model.

mod dpm;
mod everett;
mod inverse_surface;
mod mirror;
mod operator;
mod params;
mod reversals;
mod surface;

pub use dpm::{Dpm, DpmParams, DpmState, DpmSurfaceInverse};
pub use everett::{Cell, Everett, Grid};
pub use inverse_surface::InverseSurface;
pub use mirror::{Mirror, MirrorParams};
pub use operator::{EverettInverse, PreisachState};
pub use params::{PreisachParams, preisach_cell};
pub use reversals::Reversals;
pub use surface::{SurfaceRule, Violation, surface_violations};
