//! Dead time: `y(t) = u(t − d)`.

use crate::error::within;
use crate::ring::Ring;
use crate::stage::finite_or;
use crate::{Build, Complex, Env, Error, Meta, Params, Real, Sampling, Stage};

/// Parameters of a dead time `y(t) = u(t − d)`. With d = 0 there is no delay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DelayParams {
    /// Dead time d \[s\].
    pub seconds: f64,
}

impl Params for DelayParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "seconds", unit: "s", lower: 0.0, upper: 0.5 }, &mut self.seconds);
    }
}

/// Coefficients of a dead time at one sample period, at most `N − 2` whole samples long.
///
/// A fraction of a sample is interpolated linearly, which is exact for a drive that is linear between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delay<T, const N: usize> {
    whole: usize,
    fraction: T,
}

impl<T: Real, const N: usize> Build<Delay<T, N>> for DelayParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Delay<T, N>, Error> {
        let h = cx.checked()?;
        let samples = within("delay.seconds", self.seconds, self.seconds >= 0.0, "zero or positive")? / h;
        // Round to whole samples within rounding error, because a fraction needs a preview filter in the inverse.
        let nearest = libm::round(samples);
        let samples = if (samples - nearest).abs() <= 1e-9 * nearest { nearest } else { samples };
        let whole = libm::floor(samples);
        // Compare as f64: a very large delay must not wrap in the conversion to an integer.
        if whole + 2.0 > N as f64 {
            return Err(Error::Capacity {
                name: "delay samples",
                needed: (whole as usize).saturating_add(2),
                holds: N,
            });
        }
        Ok(Delay { whole: whole as usize, fraction: T::from_f64(samples - whole) })
    }
}

/// History of a delay: the last `N` inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct DelayState<T, const N: usize> {
    inputs: Ring<T, N>,
}

impl<T: Real, const N: usize> DelayState<T, N> {
    pub(crate) fn new() -> Self {
        Self { inputs: Ring::filled(T::ZERO) }
    }
}

impl<T: Real, const N: usize> Stage<T> for Delay<T, N> {
    type State = DelayState<T, N>;

    fn state(&self) -> Self::State {
        DelayState::new()
    }

    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        let u0 = finite_or(u0, T::ZERO);
        s.inputs = Ring::filled(u0);
        u0
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let u = finite_or(u, s.inputs.back(0, T::ZERO));
        s.inputs.push(u);
        self.between(s.inputs.back(self.whole, u), s.inputs.back(self.whole + 1, u))
    }
}

impl<T: Real, const N: usize> Delay<T, N> {
    #[inline]
    fn between(&self, near: T, far: T) -> T {
        near + self.fraction * (far - near)
    }

    /// Returns what [`step`](Stage::step) would return for the input `u`, without changing the history.
    #[inline]
    pub(crate) fn ahead(&self, s: &DelayState<T, N>, u: T) -> T {
        let near = self.whole.checked_sub(1).map_or(u, |k| s.inputs.back(k, u));
        self.between(near, s.inputs.back(self.whole, u))
    }

    /// Returns the weight of the present input in the present output.
    pub(crate) fn at_once(&self) -> T {
        if self.whole == 0 { T::ONE - self.fraction } else { T::ZERO }
    }

    /// Returns the whole samples of the dead time.
    pub fn whole_samples(&self) -> usize {
        self.whole
    }

    /// Returns the response at `z⁻¹` of the fraction of a sample, without the whole samples.
    pub fn fraction_response(&self, z1: Complex) -> Complex {
        let f = self.fraction.to_f64();
        z1 * f + (1.0 - f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_delayed_by_exactly_the_dead_time() {
        let h = 1e-3;
        let delay: Delay<f64, 8> = DelayParams { seconds: 3.25e-3 }.build(&Sampling { period: h }).unwrap();
        let mut s = delay.state();
        let e = Env::default();
        delay.reset(&mut s, &e, 0.0);
        for k in 1..50 {
            let t = h * f64::from(k);
            let y = delay.step(&mut s, &e, t);
            if k > 4 {
                assert!((y - (t - 3.25e-3)).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn ahead_returns_the_next_step() {
        for seconds in [0.0, 0.4e-3, 1e-3, 3.25e-3] {
            let delay: Delay<f64, 8> = DelayParams { seconds }.build(&Sampling { period: 1e-3 }).unwrap();
            let (mut s, e) = (delay.state(), Env::default());
            delay.reset(&mut s, &e, 0.3);
            for k in 0..50 {
                let u = libm::sin(1.7 * f64::from(k));
                let (still, ahead) = (delay.ahead(&s, 0.0), delay.ahead(&s, u));
                assert!((still + delay.at_once() * u - ahead).abs() < 1e-15);
                assert_eq!(ahead, delay.step(&mut s, &e, u));
            }
        }
    }

    #[test]
    fn a_delay_longer_than_the_ring_is_rejected() {
        let built: Result<Delay<f64, 8>, _> = DelayParams { seconds: 1e300 }.build(&Sampling { period: 1e-3 });
        assert!(matches!(built, Err(Error::Capacity { holds: 8, .. })));
    }
}
