//! Parameters of the cases, and what turns them into coefficients where that is more than one call.

use crate::{PERIOD, given};
use core::array::from_fn;
use hyst_core::*;

pub(crate) const DEAD_TIME: DelayParams = DelayParams { seconds: 2.3e-3 };
pub(crate) const LAG: LagParams = LagParams { seconds: 2e-3 };
pub(crate) const CREEP: CreepParams<[f64; 4]> =
    CreepParams { seconds: [0.02, 0.2, 2.0, 20.0], shares: [0.02, 0.015, 0.01, 0.02] };
pub(crate) const MODE: ResonanceParams = ResonanceParams { hz: 90.0, damping: 0.03, gain: 0.9 };
pub(crate) const WARMTH: TemperatureParams = TemperatureParams { per_kelvin: 0.005, reference_degc: 22.0 };
pub(crate) const DRIFT: DriftParams = DriftParams { per_second: 0.01 };
pub(crate) const MAINS: InterferenceParams = InterferenceParams { hz: 50.0, amplitude: 0.05, phase: 0.3 };
pub(crate) const OPTIONS: CompensatorOptions = CompensatorOptions { bandwidth_hz: None };

pub(crate) fn pi<T: Real, const N: usize>() -> Result<Pi<T, N>, Error> {
    let thresholds: [f64; N] = from_fn(|i| 50.0 * (i + 1) as f64 / N as f64);
    given(PiParams { gain: 0.1, thresholds, weights: [1.0 / (10 * N) as f64; N] }).build(&())
}

pub(crate) fn everett<T: Real, const N: usize>() -> Result<Everett<T, N>, Error> {
    let grid = given(Grid { low: 0.0, high: 120.0, cells: N - 1 });
    let density = |a: usize, b: usize| given(if a == b { 0.3 } else { 0.03 / (1 + a - b) as f64 });
    Everett::new(grid, 0.0, density, |_| given(0.05))
}

pub(crate) fn chain<T: Real>() -> Result<Chain<T, Pi<T, 10>, 16, 4>, Error> {
    Chain::new(pi()?)
        .with_zero(given(-1.5))
        .with_delay(&given(DEAD_TIME), &PERIOD)?
        .with_lag(&given(LAG), &PERIOD)?
        .with_temperature(&given(WARMTH))?
        .with_creep(&given(CREEP), &PERIOD)?
        .with_resonance(&given(MODE), &PERIOD)?
        .with_drift(&given(DRIFT))?
        .with_interference(&given(MAINS))
}

/// Limits as a stage: the drive that may follow the last one.
#[derive(Clone, Debug)]
pub struct Limiter<T>(Limits<T>);

pub(crate) fn limiter<T: Real>() -> Result<Limiter<T>, Error> {
    Ok(Limiter(Limits::new(given(0.0), given(120.0), given(9e3), &PERIOD)?))
}

impl<T: Real> Stage<T> for Limiter<T> {
    type State = T;
    fn state(&self) -> T {
        T::ZERO
    }
    fn reset(&self, last: &mut T, _: &Env<T>, u0: T) -> T {
        *last = self.0.apply(u0, u0).drive;
        *last
    }
    fn step(&self, last: &mut T, _: &Env<T>, u: T) -> T {
        *last = self.0.apply(*last, u).drive;
        *last
    }
}
