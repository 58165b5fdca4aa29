//! Drift of the sensor: `y = v + ρ t` on the lab's clock.

use crate::error::coefficient;
use crate::{Build, Env, Error, Meta, Params, Real, Stage};

/// Parameters of `y = v + ρ t`, t the lab's clock. Zero is no drift.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DriftParams {
    /// Rate ρ \[output unit per s\].
    pub per_second: f64,
}

impl Params for DriftParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(
            &Meta { name: "per_second", unit: "y/s", lower: f64::NEG_INFINITY, upper: f64::INFINITY },
            &mut self.per_second,
        );
    }
}

/// Coefficients of the drift stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift<T> {
    per_second: T,
}

impl<T: Real> Build<Drift<T>> for DriftParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<Drift<T>, Error> {
        Ok(Drift { per_second: coefficient("drift.per_second", self.per_second)? })
    }
}

impl<T: Real> Stage<T> for Drift<T> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), env: &Env<T>, u0: T) -> T {
        u0 + self.per_second * env.time
    }
    #[inline]
    fn step(&self, (): &mut (), env: &Env<T>, u: T) -> T {
        u + self.per_second * env.time
    }
}
