//! Gain that depends on temperature: `y = v (1 + α (T − T₀))`.

use crate::error::coefficient;
use crate::{Build, Env, Error, Meta, Params, Real, Stage};

/// Parameters of `y = v (1 + α (T − T₀))`. α = 0 is no dependence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TemperatureParams {
    /// Relative change of gain α \[1/K\].
    pub per_kelvin: f64,
    /// Temperature T₀ at which the gain is that of the hysteresis stage \[°C\]; a convention, not
    /// identified.
    pub reference_degc: f64,
}

impl Params for TemperatureParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "per_kelvin", unit: "1/K", lower: -0.05, upper: 0.05 }, &mut self.per_kelvin);
    }
}

/// Coefficients of the temperature stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Temperature<T> {
    per_kelvin: T,
    reference: T,
}

impl<T: Real> Build<Temperature<T>> for TemperatureParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<Temperature<T>, Error> {
        Ok(Temperature {
            per_kelvin: coefficient("temperature.per_kelvin", self.per_kelvin)?,
            reference: coefficient("temperature.reference_degc", self.reference_degc)?,
        })
    }
}

impl<T: Real> Temperature<T> {
    /// Temperature T₀ at which the factor is one \[°C\].
    pub fn reference(&self) -> T {
        self.reference
    }

    /// The factor `1 + α (T − T₀)`.
    #[inline]
    pub fn factor(&self, env: &Env<T>) -> T {
        T::ONE + self.per_kelvin * (env.temperature - self.reference)
    }
}

impl<T: Real> Stage<T> for Temperature<T> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), env: &Env<T>, u0: T) -> T {
        u0 * self.factor(env)
    }
    #[inline]
    fn step(&self, (): &mut (), env: &Env<T>, u: T) -> T {
        u * self.factor(env)
    }
}
