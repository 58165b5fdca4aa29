//! Load: an external force deflects the actuator, `y = v + c F`.

use crate::error::coefficient;
use crate::{Build, Env, Error, Meta, Params, Real, Stage};

/// Parameters of `y = v + c F`, F the measured load. With c = 0 there is no effect of the load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadParams {
    /// Compliance c \[y/N\]: the reciprocal of the output stiffness; negative if a positive load pushes back.
    pub per_newton: f64,
}

impl Params for LoadParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        let any = f64::INFINITY;
        f(&Meta { name: "per_newton", unit: "y/N", lower: -any, upper: any }, &mut self.per_newton);
    }
}

/// Coefficient of a load, `y = v + c F`. The inverse subtracts the deflection by the measured load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load<T> {
    per_newton: T,
}

impl<T: Real> Build<Load<T>> for LoadParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<Load<T>, Error> {
        Ok(Load { per_newton: coefficient("load.per_newton", self.per_newton)? })
    }
}

impl<T: Real> Load<T> {
    /// Returns the deflection by the load \[y\].
    #[inline]
    pub fn deflection(&self, env: &Env<T>) -> T {
        self.per_newton * env.load
    }
}

impl<T: Real> Stage<T> for Load<T> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), env: &Env<T>, u0: T) -> T {
        u0 + self.deflection(env)
    }
    #[inline]
    fn step(&self, (): &mut (), env: &Env<T>, u: T) -> T {
        u + self.deflection(env)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_shifts_the_output_by_its_compliance() {
        let load: Load<f64> = LoadParams { per_newton: -0.25 }.build(&()).unwrap();
        assert_eq!(load.step(&mut (), &Env { load: 8.0, ..Env::default() }, 10.0), 8.0);
    }
}
