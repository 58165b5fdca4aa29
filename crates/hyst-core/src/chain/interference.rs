//! A tone with harmonics in the sensor signal, such as mains pick-up:
//! `y = v + A sin(2π f t + φ) + Σₖ (aₖ sin(2π k f t) + bₖ cos(2π k f t))`, k = 2 … 5, t the lab clock.

use crate::error::{coefficient, within};
use crate::{Build, Env, Error, Meta, Params, Real, Stage};

/// Number of harmonic amplitudes: a sine and a cosine for each of the orders 2 to 5, in which rectifiers and
/// transformers have most of their power.
pub const HARMONIC_PARTS: usize = 8;

/// Parameters of `y = v + A sin(2π f t + φ) + Σₖ (aₖ sin(2π k f t) + bₖ cos(2π k f t))`, t the lab clock, k = 2 … 5.
/// With all amplitudes zero there is no interference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InterferenceParams {
    /// Frequency f \[Hz\].
    pub hz: f64,
    /// Amplitude A \[output unit\].
    pub amplitude: f64,
    /// Phase φ at t = 0 \[rad\].
    pub phase: f64,
    /// Amplitudes a₂, b₂, a₃, b₃, … b₅ \[output unit\].
    #[cfg_attr(feature = "serde", serde(default))]
    pub harmonics: [f64; HARMONIC_PARTS],
}

impl InterferenceParams {
    /// Returns the interference at a time of the lab clock \[output unit\].
    pub fn at(&self, time_s: f64) -> f64 {
        let cycles = self.hz * time_s;
        self.at_angle(2.0 * core::f64::consts::PI * (cycles - libm::floor(cycles)))
    }

    /// Returns the interference \[output unit\] at an angle of the fundamental \[rad\], which is zero at t = 0.
    pub fn at_angle(&self, angle: f64) -> f64 {
        let fundamental = self.amplitude * libm::sin(angle + self.phase);
        let orders = self.harmonics.chunks_exact(2).zip(2u8..);
        orders.fold(fundamental, |y, (parts, order)| match parts {
            [sine, cosine] => {
                let angle = f64::from(order) * angle;
                y + sine * libm::sin(angle) + cosine * libm::cos(angle)
            }
            _ => y,
        })
    }
}

impl Params for InterferenceParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "hz", unit: "Hz", lower: 0.0, upper: f64::INFINITY }, &mut self.hz);
        f(&Meta { name: "amplitude", unit: "y", lower: 0.0, upper: f64::INFINITY }, &mut self.amplitude);
        f(
            &Meta { name: "phase", unit: "rad", lower: -core::f64::consts::PI, upper: core::f64::consts::PI },
            &mut self.phase,
        );
        for part in &mut self.harmonics {
            f(&Meta { name: "harmonics", unit: "y", lower: f64::NEG_INFINITY, upper: f64::INFINITY }, part);
        }
    }
}

/// Coefficients of the interference stage.
///
/// The phase is computed from `time`, so it is correct after gaps in the record. In `f32` the resolution of the clock
/// limits the phase: 60 µs at 1000 s, 0.02 rad at 50 Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interference<T> {
    hz: T,
    amplitude: T,
    phase: T,
    harmonics: [T; HARMONIC_PARTS],
    /// Whether all harmonics are zero: one sine per sample is then sufficient.
    is_pure: bool,
}

impl<T: Real> Build<Interference<T>> for InterferenceParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<Interference<T>, Error> {
        within("interference.hz", self.hz, self.hz >= 0.0, "zero or positive")?;
        let mut harmonics = [T::ZERO; HARMONIC_PARTS];
        for (built, part) in harmonics.iter_mut().zip(&self.harmonics) {
            *built = coefficient("interference.harmonics", *part)?;
        }
        Ok(Interference {
            hz: T::from_f64(self.hz),
            amplitude: coefficient("interference.amplitude", self.amplitude)?,
            phase: coefficient("interference.phase", self.phase)?,
            harmonics,
            is_pure: self.harmonics.iter().all(|part| *part == 0.0),
        })
    }
}

impl<T: Real> Interference<T> {
    #[inline]
    fn at(&self, env: &Env<T>) -> T {
        let cycles = self.hz * env.time;
        let angle = T::from_f64(2.0 * core::f64::consts::PI) * (cycles - cycles.floor());
        let mut y = self.amplitude * (angle + self.phase).sin();
        if !self.is_pure {
            let quarter = T::from_f64(core::f64::consts::FRAC_PI_2);
            let (s1, c1) = (angle.sin(), (angle + quarter).sin());
            let (mut s, mut c) = (s1, c1);
            for parts in self.harmonics.chunks_exact(2) {
                (s, c) = (s * c1 + c * s1, c * c1 - s * s1);
                if let [sine, cosine] = parts {
                    y += *sine * s + *cosine * c;
                }
            }
        }
        y
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonics_are_multiples_of_the_fundamental() {
        let p = InterferenceParams {
            hz: 50.0,
            amplitude: 0.3,
            phase: 0.4,
            harmonics: [0.0, 0.1, 0.2, 0.0, 0.0, 0.0, -0.05, 0.02],
        };
        let stage: Interference<f64> = p.build(&()).unwrap();
        for k in 0..100 {
            let time = 12.0 + 3.7e-4 * f64::from(k);
            let angle = |order: f64| 2.0 * core::f64::consts::PI * (order * 50.0 * time);
            let expected =
                0.3 * libm::sin(angle(1.0) + 0.4) + 0.1 * libm::cos(angle(2.0)) + 0.2 * libm::sin(angle(3.0))
                    - 0.05 * libm::sin(angle(5.0))
                    + 0.02 * libm::cos(angle(5.0));
            let y = stage.step(&mut (), &Env { time, ..Env::default() }, 1.0) - 1.0;
            assert!((y - expected).abs() < 1e-9 && (p.at(time) - expected).abs() < 1e-9, "{y} {expected}");
        }
    }
}
