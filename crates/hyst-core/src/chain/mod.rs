//! The actuator as a chain: optional stages around a hysteresis operator, and the inverse of the chain.

mod asymmetry;
#[allow(clippy::module_inception, reason = "the chain itself, next to its stages")]
mod chain;
mod compensator;
mod creep;
mod delay;
mod drift;
mod first_order;
mod interference;
mod lag;
mod load;
mod preview;
mod rate;
mod resonance;
mod saturation;
mod temperature;
mod widening;

pub use asymmetry::{Asymmetry, AsymmetryInverse, AsymmetryParams, CurveSide};
pub use chain::{Chain, ChainState, MAX_DEAD_ZONES, MAX_RESONANCES};
pub use compensator::{Compensator, CompensatorOptions, CompensatorState, InverseHysteresis};
pub use creep::{Creep, CreepInverse, CreepInverseState, CreepParams, CreepSideBySide, CreepState};
pub use delay::{Delay, DelayParams, DelayState};
pub use drift::{Drift, DriftParams};
pub(crate) use first_order::FirstOrder;
pub use interference::{HARMONIC_PARTS, Interference, InterferenceParams};
pub use lag::{Lag, LagParams, LagState};
pub use load::{Load, LoadParams};
pub use preview::{Preview, PreviewState};
pub use rate::{Rate, RateInverse, RateLaw, RateParams, RateState};
pub use resonance::{Resonance, ResonanceParams, ResonanceState};
pub use saturation::{Saturation, SaturationInverse, SaturationParams};
pub use temperature::{Temperature, TemperatureParams, TemperatureState};
pub use widening::{MAX_WIDENING, Widening, WideningParams, WideningState};
