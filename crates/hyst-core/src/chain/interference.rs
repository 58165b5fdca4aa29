//! A tone in the sensor, such as mains pick-up: `y = v + A sin(2π f t + φ)` on the lab's clock.

use crate::error::{coefficient, within};
use crate::{Build, Env, Error, Meta, Params, Real, Stage};

/// Parameters of `y = v + A sin(2π f t + φ)`, t the lab's clock. A = 0 is no interference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InterferenceParams {
    /// Frequency f \[Hz\].
    pub hz: f64,
    /// Amplitude A \[output unit\].
    pub amplitude: f64,
    /// Phase φ at t = 0 \[rad\].
    pub phase: f64,
}

impl Params for InterferenceParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "hz", unit: "Hz", lower: 0.0, upper: f64::INFINITY }, &mut self.hz);
        f(&Meta { name: "amplitude", unit: "y", lower: 0.0, upper: f64::INFINITY }, &mut self.amplitude);
        f(
            &Meta { name: "phase", unit: "rad", lower: -core::f64::consts::PI, upper: core::f64::consts::PI },
            &mut self.phase,
        );
    }
}

/// Coefficients of the interference stage.
///
/// The phase is taken from `time` itself, so it stays right over gaps in the record. In `f32` the
/// clock's own resolution limits it: 60 µs at 1000 s, 0.02 rad at 50 Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interference<T> {
    hz: T,
    amplitude: T,
    phase: T,
}

impl<T: Real> Build<Interference<T>> for InterferenceParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<Interference<T>, Error> {
        within("interference.hz", self.hz, self.hz >= 0.0, "zero or positive")?;
        Ok(Interference {
            hz: T::from_f64(self.hz),
            amplitude: coefficient("interference.amplitude", self.amplitude)?,
            phase: coefficient("interference.phase", self.phase)?,
        })
    }
}

impl<T: Real> Interference<T> {
    #[inline]
    fn at(&self, env: &Env<T>) -> T {
        let cycles = self.hz * env.time;
        let angle = T::from_f64(2.0 * core::f64::consts::PI) * (cycles - cycles.floor());
        self.amplitude * (angle + self.phase).sin()
    }
}

impl<T: Real> Stage<T> for Interference<T> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), env: &Env<T>, u0: T) -> T {
        u0 + self.at(env)
    }
    #[inline]
    fn step(&self, (): &mut (), env: &Env<T>, u: T) -> T {
        u + self.at(env)
    }
}
