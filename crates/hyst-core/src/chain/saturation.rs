//! Saturation: a soft limit of the motion or of its sensor, or of the drive.

use crate::error::{coefficient, finite, within};
use crate::{Build, CurveSide, Env, Error, Invert, Meta, Params, Real, Stage};

/// Parameters of a soft stop. The output equals the input up to a knee k and approaches the limit L beyond it:
/// `y = k + (L − k) tanh((v − k)/(L − k))`, on both sides. With limits outside the motion there is no saturation.
/// On the input side the limits are those of the drive, such as the rails of an amplifier.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SaturationParams {
    /// Lower limit \[y; on the input side u\].
    pub low: f64,
    /// Upper limit \[y; on the input side u\], above the lower one.
    pub high: f64,
    /// Width of each knee as a share of the range between the limits, 0 (a hard stop) to 0.5.
    pub knee: f64,
    /// Position relative to the hysteresis.
    #[cfg_attr(feature = "serde", serde(default))]
    pub side: CurveSide,
}

impl SaturationParams {
    /// Returns limits of the motion, or of its sensor \[y\].
    pub const fn behind(low: f64, high: f64, knee: f64) -> Self {
        Self { low, high, knee, side: CurveSide::Output }
    }

    /// Returns limits of the drive \[u\].
    pub const fn before(low: f64, high: f64, knee: f64) -> Self {
        Self { low, high, knee, side: CurveSide::Input }
    }
}

impl Params for SaturationParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        let any = f64::INFINITY;
        let unit = if self.side == CurveSide::Input { "u" } else { "y" };
        f(&Meta { name: "low", unit, lower: -any, upper: any }, &mut self.low);
        f(&Meta { name: "high", unit, lower: -any, upper: any }, &mut self.high);
        f(&Meta { name: "knee", unit: "", lower: 0.0, upper: 0.5 }, &mut self.knee);
    }
}

/// Coefficients of a soft stop. Output and slope are continuous; the slope between the knees is 1.
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
    /// Returns the output beyond the start of a knee of width w, for an input `x ≥ 0` beyond it.
    #[inline]
    fn bend(&self, x: T) -> T {
        if self.width > T::ZERO { self.width * (x / self.width).tanh() } else { T::ZERO }
    }

    /// Returns the input for an output `x ≥ 0` beyond the start of a knee. For the limit or more it returns the input
    /// of the largest output below the limit.
    #[inline]
    fn unbend(&self, x: T) -> T {
        if self.width > T::ZERO {
            let z = (x / self.width).at_most(T::ONE - T::EPSILON);
            self.width * ((z + z) / (T::ONE - z)).ln_1p() * T::from_f64(0.5)
        } else {
            T::ZERO
        }
    }

    /// Applies `f` to the part of `v` beyond a knee.
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

/// Inverse of a soft stop. A reference at or beyond a limit is replaced by the nearest reachable one.
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
        SaturationParams::behind(-2.0, 10.0, knee).build(&()).unwrap()
    }

    #[test]
    fn the_output_is_the_input_between_the_knees_and_inside_the_limits() {
        for knee in [0.0, 0.1, 0.5] {
            let s = stop(knee);
            let e = Env::default();
            assert_eq!(s.step(&mut (), &e, 4.0), 4.0);
            assert!(s.step(&mut (), &e, 1e6) <= 10.0 && s.step(&mut (), &e, 1e6) > 9.999);
            assert!(s.step(&mut (), &e, -1e6) >= -2.0);
        }
    }

    #[test]
    fn the_inverse_is_exact_inside_the_limits() {
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
