//! Saturation: the motion or its sensor ends at a stop, softly.

use crate::error::{coefficient, finite, within};
use crate::{Build, Env, Error, Invert, Meta, Params, Real, Stage};

/// Parameters of a soft stop: the output is the input up to a knee and approaches the limit beyond,
/// `y = k + (L − k) tanh((v − k)/(L − k))`, on both sides. Limits that nothing reaches are no saturation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SaturationParams {
    /// Lower limit \[y\].
    pub low: f64,
    /// Upper limit \[y\], above the lower one.
    pub high: f64,
    /// Width of each knee as a share of the range between the limits, 0 (a hard stop) to 0.5.
    pub knee: f64,
}

impl Params for SaturationParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        let any = f64::INFINITY;
        f(&Meta { name: "low", unit: "y", lower: -any, upper: any }, &mut self.low);
        f(&Meta { name: "high", unit: "y", lower: -any, upper: any }, &mut self.high);
        f(&Meta { name: "knee", unit: "", lower: 0.0, upper: 0.5 }, &mut self.knee);
    }
}

/// Coefficients of a soft stop. Continuous with a continuous slope, 1 between the knees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saturation<T> {
    low: T,
    high: T,
    width: T,
}

impl<T: Real> Build<Saturation<T>> for SaturationParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<Saturation<T>, Error> {
        finite("saturation.low", self.low)?;
        within("saturation.high", self.high, self.high > self.low, "above saturation.low")?;
        within("saturation.knee", self.knee, (0.0..=0.5).contains(&self.knee), "from 0 to 0.5")?;
        let width = self.knee * (self.high - self.low);
        Ok(Saturation {
            low: coefficient("saturation.low", self.low)?,
            high: coefficient("saturation.high", self.high)?,
            width: coefficient("saturation.knee", width)?,
        })
    }
}

impl<T: Real> Saturation<T> {
    /// How far into a knee of width w the output is when the input is `x ≥ 0` past its beginning.
    #[inline]
    fn bend(&self, x: T) -> T {
        if self.width > T::ZERO { self.width * (x / self.width).tanh() } else { T::ZERO }
    }

    /// The input for an output `x ≥ 0` past the beginning of a knee; at the limit, where only rounding is left.
    #[inline]
    fn unbend(&self, x: T) -> T {
        if self.width > T::ZERO {
            let z = (x / self.width).at_most(T::ONE - T::EPSILON);
            self.width * ((z + z) / (T::ONE - z)).ln_1p() * T::from_f64(0.5)
        } else {
            T::ZERO
        }
    }

    #[inline]
    fn through(&self, v: T, f: impl Fn(&Self, T) -> T) -> T {
        let (low, high) = (self.low + self.width, self.high - self.width);
        if v > high {
            high + f(self, v - high)
        } else if v < low {
            low - f(self, low - v)
        } else {
            v
        }
    }
}

impl<T: Real> Stage<T> for Saturation<T> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), _: &Env<T>, u0: T) -> T {
        self.through(u0, Self::bend)
    }
    #[inline]
    fn step(&self, (): &mut (), _: &Env<T>, u: T) -> T {
        self.through(u, Self::bend)
    }
}

/// The inverse of a soft stop. A reference at or beyond a limit cannot be reached; the nearest reachable one is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaturationInverse<T> {
    forward: Saturation<T>,
}

impl<T: Real> Invert<T> for Saturation<T> {
    type Inverse = SaturationInverse<T>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        Ok(SaturationInverse { forward: *self })
    }
}

impl<T: Real> Stage<T> for SaturationInverse<T> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), _: &Env<T>, u0: T) -> T {
        self.forward.through(u0, Saturation::unbend)
    }
    #[inline]
    fn step(&self, (): &mut (), _: &Env<T>, u: T) -> T {
        self.forward.through(u, Saturation::unbend)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stop(knee: f64) -> Saturation<f64> {
        SaturationParams { low: -2.0, high: 10.0, knee }.build(&()).unwrap()
    }

    #[test]
    fn the_middle_is_untouched_and_the_ends_are_kept() {
        for knee in [0.0, 0.1, 0.5] {
            let s = stop(knee);
            let e = Env::default();
            assert_eq!(s.step(&mut (), &e, 4.0), 4.0);
            assert!(s.step(&mut (), &e, 1e6) <= 10.0 && s.step(&mut (), &e, 1e6) > 9.999);
            assert!(s.step(&mut (), &e, -1e6) >= -2.0);
        }
    }

    #[test]
    fn inverse_reaches_what_can_be_reached() {
        for knee in [0.0, 0.1, 0.5] {
            let s = stop(knee);
            let inverse = s.invert().unwrap();
            let e = Env::default();
            for k in 0..=1000 {
                let reference = -2.0 + 12.0 * (1e-6 + f64::from(k) * 0.999_998e-3);
                let v = inverse.step(&mut (), &e, reference);
                assert!((s.step(&mut (), &e, v) - reference).abs() < 1e-9 * 12.0, "{knee} {reference} {v}");
            }
            let beyond = s.step(&mut (), &e, inverse.step(&mut (), &e, 50.0));
            assert!((beyond - 10.0).abs() < 1e-9);
        }
    }
}
