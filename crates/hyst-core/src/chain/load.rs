//! Load: an external force deflects the actuator and changes its gain, `y = v (1 + α F) + c F`.

use crate::error::coefficient;
use crate::{Build, Env, Error, Meta, Params, Real, Stage};

/// Parameters of `y = v (1 + α F) + c F`, F the measured load. With α = c = 0 there is no effect of the load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadParams {
    /// Compliance c \[y/N\]: the reciprocal of the output stiffness; negative if a positive load pushes back.
    pub per_newton: f64,
    /// Relative change of gain α \[1/N\]: the stiffness changes with the load.
    #[cfg_attr(feature = "serde", serde(default))]
    pub gain_per_newton: f64,
}

impl Params for LoadParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        let any = f64::INFINITY;
        f(&Meta { name: "per_newton", unit: "y/N", lower: -any, upper: any }, &mut self.per_newton);
        f(&Meta { name: "gain_per_newton", unit: "1/N", lower: -any, upper: any }, &mut self.gain_per_newton);
    }
}

/// Coefficients of a load, `y = v (1 + α F) + c F`. The inverse subtracts the deflection by the measured load and divides
/// by the change of the gain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load<T> {
    per_newton: T,
    gain_per_newton: T,
}

impl<T: Real> Build<Load<T>> for LoadParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<Load<T>, Error> {
        Ok(Load {
            per_newton: coefficient("load.per_newton", self.per_newton)?,
            gain_per_newton: coefficient("load.gain_per_newton", self.gain_per_newton)?,
        })
    }
}

impl<T: Real> Load<T> {
    /// Returns the deflection by the load \[y\].
    #[inline]
    pub fn deflection(&self, env: &Env<T>) -> T {
        self.per_newton * env.load
    }

    /// Returns the factor of the gain, `1 + α F`.
    #[inline]
    pub fn factor(&self, env: &Env<T>) -> T {
        T::ONE + self.gain_per_newton * env.load
    }
}

impl<T: Real> Stage<T> for Load<T> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), env: &Env<T>, u0: T) -> T {
        u0 * self.factor(env) + self.deflection(env)
    }
    #[inline]
    fn step(&self, (): &mut (), env: &Env<T>, u: T) -> T {
        u * self.factor(env) + self.deflection(env)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_shifts_the_output_by_its_compliance() {
        let load: Load<f64> = LoadParams { per_newton: -0.25, ..LoadParams::default() }.build(&()).unwrap();
        assert_eq!(load.step(&mut (), &Env { load: 8.0, ..Env::default() }, 10.0), 8.0);
    }

    #[test]
    fn a_load_changes_the_gain() {
        let load: Load<f64> = LoadParams { per_newton: 0.5, gain_per_newton: -0.125 }.build(&()).unwrap();
        assert_eq!(load.step(&mut (), &Env { load: 2.0, ..Env::default() }, 10.0), 8.5);
    }
}
