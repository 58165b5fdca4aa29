//! Drives for the identification or the test of an actuator.
//!
//! A [`Drive`] is a sequence of segments, each of one [`Shape`]. Every segment starts and ends with the device at rest
//! at the lowest voltage, stays between the lowest and the highest voltage, and does not exceed the slew limit. Random
//! parts depend on the seed only.

mod crest;
mod drive;
mod error;
mod forc;
mod full_span;
mod identification;
mod limits;
mod multisine;
mod sampled;
mod scan;
mod separate;
mod shapes;
#[cfg(test)]
mod tests;
mod waves;

pub use drive::Drive;
pub use error::ExciteError;
pub use forc::{Forc, Peak};
pub use full_span::{DecayingSine, Sine, Stairs, Sweep, Triangle};
pub use identification::Identification;
pub use limits::Limits;
pub use multisine::{Multisine, Phases};
pub use scan::{Raster, Spiral};
pub use separate::{SeparateOptions, Separation, Tried, Verdict, separate, separations};
pub use shapes::Shape;
pub use waves::{AmSine, MinorLoops, Tone};
