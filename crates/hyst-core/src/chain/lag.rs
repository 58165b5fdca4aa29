//! First-order lag of the amplifier: `τ ẏ + y = u`.

use crate::chain::FirstOrder;
use crate::stage::finite_or;
use crate::{Build, Complex, Env, Error, Meta, Params, Real, Sampling, Stage};

/// Parameters of a first-order lag `τ ẏ + y = u`. With τ = 0 there is no lag.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LagParams {
    /// Time constant τ \[s\].
    pub seconds: f64,
}

impl Params for LagParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "seconds", unit: "s", lower: 0.0, upper: 1.0 }, &mut self.seconds);
    }
}

/// Coefficients of a lag at one sample period; exact for a drive that is linear between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag<T> {
    element: FirstOrder<T>,
}

impl<T: Real> Build<Lag<T>> for LagParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Lag<T>, Error> {
        Ok(Lag { element: FirstOrder::new("lag.seconds", cx.checked()?, self.seconds)? })
    }
}

/// History of a lag: last input and output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LagState<T> {
    u: T,
    y: T,
}

impl<T: Real> Stage<T> for Lag<T> {
    type State = LagState<T>;

    fn state(&self) -> LagState<T> {
        LagState::default()
    }

    #[inline]
    fn reset(&self, s: &mut LagState<T>, _: &Env<T>, u0: T) -> T {
        let u0 = finite_or(u0, T::ZERO);
        *s = LagState { u: u0, y: u0 };
        u0
    }

    #[inline]
    fn step(&self, s: &mut LagState<T>, _: &Env<T>, u: T) -> T {
        let u = finite_or(u, s.u);
        s.y = self.element.step(s.y, s.u, u);
        s.u = u;
        s.y
    }
}

impl<T: Real> Lag<T> {
    /// Returns the response of the sampled stage at `z⁻¹`.
    pub fn response(&self, z1: Complex) -> Complex {
        self.element.response(z1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_time_constant_gives_no_lag() {
        let lag: Lag<f64> = LagParams { seconds: 0.0 }.build(&Sampling { period: 1e-3 }).unwrap();
        let mut s = lag.state();
        lag.reset(&mut s, &Env::default(), 1.0);
        assert_eq!(lag.step(&mut s, &Env::default(), 5.0), 5.0);
    }

    #[test]
    fn the_static_gain_is_one() {
        let lag: Lag<f64> = LagParams { seconds: 0.004 }.build(&Sampling { period: 1e-3 }).unwrap();
        assert!((lag.response(Complex::polar(1.0, 0.0)) - Complex::from(1.0)).abs() < 1e-14);
    }

    #[test]
    fn a_negative_time_constant_is_rejected() {
        let built: Result<Lag<f64>, _> = LagParams { seconds: -1.0 }.build(&Sampling { period: 1e-3 });
        assert!(matches!(built, Err(Error::OutOfRange { name: "lag.seconds", .. })));
    }
}
