//! Asymmetry: a memory-free curve after or before the hysteresis, as a sum of one-sided dead zones.
//!
//! `y = v + Σⱼ cⱼ dead_{sⱼ}(v)`, with `dead_s(v) = max(v − s, 0)` for s ≥ 0 and `min(v − s, 0)` for s < 0 (modified
//! Prandtl-Ishlinskii model, Kuhnen 2003). It bends the two ends of a symmetric loop differently. Its inverse is
//! closed-form and of the same shape. Before the hysteresis the curve bends the drive, as the envelope of a generalised
//! operator does: minor loops are then wider where the curve is steep.

use crate::error::{coefficient, within};
use crate::{Build, Env, Error, Invert, Meta, Params, Real, Stage};

/// Position of a curve relative to the hysteresis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum CurveSide {
    /// After it: the curve bends the output.
    #[default]
    Output,
    /// Before it: the curve bends the drive.
    Input,
}

/// Parameters of the curve. `L` is any list of numbers. With weights of zero there is no asymmetry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AsymmetryParams<L> {
    /// Ends of the dead zones, sⱼ \[y; before the hysteresis u\]. The negative ones fall and the others rise; the two
    /// may be mixed.
    pub thresholds: L,
    /// Change of slope cⱼ beyond each threshold \[ratio\].
    pub weights: L,
    /// Position relative to the hysteresis.
    #[cfg_attr(feature = "serde", serde(default))]
    pub side: CurveSide,
}

impl<L> AsymmetryParams<L> {
    /// Returns a curve after the hysteresis: thresholds \[y\] and changes of slope.
    pub const fn behind(thresholds: L, weights: L) -> Self {
        Self { thresholds, weights, side: CurveSide::Output }
    }

    /// Returns a curve before the hysteresis: thresholds \[u\] and changes of slope.
    pub const fn before(thresholds: L, weights: L) -> Self {
        Self { thresholds, weights, side: CurveSide::Input }
    }
}

impl<L: AsMut<[f64]>> Params for AsymmetryParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const INF: f64 = f64::INFINITY;
        let unit = if self.side == CurveSide::Input { "u" } else { "y" };
        for s in self.thresholds.as_mut() {
            f(&Meta { name: "thresholds", unit, lower: -INF, upper: INF }, s);
        }
        for c in self.weights.as_mut() {
            f(&Meta { name: "weights", unit: "", lower: -1.0, upper: INF }, c);
        }
    }
}

/// The curve with at most `N` dead zones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asymmetry<T, const N: usize> {
    thresholds: [T; N],
    weights: [T; N],
    len: usize,
}

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<Asymmetry<T, N>> for AsymmetryParams<L> {
    type Context = ();
    fn build(&self, (): &()) -> Result<Asymmetry<T, N>, Error> {
        let (thresholds, weights) = (self.thresholds.as_ref(), self.weights.as_ref());
        if thresholds.len() != weights.len() {
            return Err(Error::Lengths("asymmetry.thresholds and asymmetry.weights"));
        }
        if thresholds.len() > N {
            return Err(Error::Capacity { name: "asymmetry dead zones", needed: thresholds.len(), holds: N });
        }
        let mut curve = Asymmetry { thresholds: [T::ZERO; N], weights: [T::ZERO; N], len: thresholds.len() };
        let (mut above, mut below): (Option<f64>, Option<f64>) = (None, None);
        let slots = curve.thresholds.iter_mut().zip(&mut curve.weights);
        for ((slot_s, slot_c), (s, c)) in slots.zip(thresholds.iter().zip(weights)) {
            let last = if *s >= 0.0 { &mut above } else { &mut below };
            within(
                "asymmetry.thresholds",
                *s,
                last.is_none_or(|l| s.abs() > l.abs()),
                "in order of increasing distance from zero on each side",
            )?;
            *last = Some(*s);
            *slot_s = T::from_f64(*s);
            *slot_c = coefficient("asymmetry.weights", *c)?;
        }
        Ok(curve)
    }
}

impl<T: Real, const N: usize> Asymmetry<T, N> {
    /// Returns threshold and weight of each dead zone on the side of zero on which `side` is.
    fn zones(&self, side: T) -> impl Iterator<Item = (T, T)> + '_ {
        let rising = side >= T::ZERO;
        self.thresholds
            .iter()
            .copied()
            .zip(self.weights.iter().copied())
            .take(self.len)
            .filter(move |(s, _)| (*s >= T::ZERO) == rising)
    }

    #[inline]
    fn value(&self, v: T) -> T {
        let mut y = v;
        for (s, c) in self.zones(v) {
            let beyond = if s >= T::ZERO { (v - s).at_least(T::ZERO) } else { (v - s).at_most(T::ZERO) };
            y += c * beyond;
        }
        y
    }

    /// Returns the v with this output, in one pass over the corners of the rising piecewise linear curve.
    #[inline]
    fn solve(&self, y: T) -> T {
        let (mut v, mut slope, mut offset) = (y, T::ONE, y);
        for (s, c) in self.zones(y) {
            if if s >= T::ZERO { v <= s } else { v >= s } {
                break;
            }
            slope += c;
            offset += c * s;
            v = offset / slope;
        }
        v
    }
}

impl<T: Real, const N: usize> Stage<T> for Asymmetry<T, N> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), _: &Env<T>, u0: T) -> T {
        self.value(u0)
    }
    #[inline]
    fn step(&self, (): &mut (), _: &Env<T>, u: T) -> T {
        self.value(u)
    }
}

/// Exact inverse of the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetryInverse<T, const N: usize> {
    forward: Asymmetry<T, N>,
}

impl<T: Real, const N: usize> Invert<T> for Asymmetry<T, N> {
    type Inverse = AsymmetryInverse<T, N>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        for side in [T::ONE, -T::ONE] {
            let mut slope = T::ONE;
            for (_, c) in self.zones(side) {
                slope += c;
                if slope.to_f64().is_nan() || slope <= T::ZERO {
                    return Err(Error::NotInvertible("1 plus the asymmetry weights on one side must stay positive"));
                }
            }
        }
        Ok(AsymmetryInverse { forward: *self })
    }
}

impl<T: Real, const N: usize> Stage<T> for AsymmetryInverse<T, N> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), _: &Env<T>, u0: T) -> T {
        self.forward.solve(u0)
    }
    #[inline]
    fn step(&self, (): &mut (), _: &Env<T>, u: T) -> T {
        self.forward.solve(u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn curve(thresholds: &[f64], weights: &[f64]) -> Asymmetry<f64, 4> {
        AsymmetryParams::behind(thresholds, weights).build(&()).unwrap()
    }

    proptest! {
        #[test]
        fn inverse_is_exact(c in prop::collection::vec(-0.2..0.5f64, 4), y in prop::collection::vec(-40.0..40.0f64, 50)) {
            let curve = curve(&[0.0, 5.0, -3.0, -12.0], &c);
            let inverse = curve.invert().unwrap();
            for y in y {
                let v = inverse.step(&mut (), &Env::default(), y);
                prop_assert!((curve.step(&mut (), &Env::default(), v) - y).abs() < 1e-12 * 80.0);
            }
        }
    }

    #[test]
    fn each_side_has_its_own_slope() {
        let curve = curve(&[2.0, -1.0], &[0.5, -0.25]);
        let at = |v| curve.step(&mut (), &Env::default(), v);
        assert_eq!([at(1.0), at(4.0), at(-0.5), at(-5.0)], [1.0, 5.0, -0.5, -4.0]);
    }

    #[test]
    fn a_falling_curve_has_no_inverse() {
        assert!(curve(&[1.0, 2.0], &[-0.6, -0.5]).invert().is_err());
        let built: Result<Asymmetry<f64, 4>, _> = AsymmetryParams::before([2.0, 1.0], [0.1, 0.1]).build(&());
        assert!(matches!(built, Err(Error::OutOfRange { name: "asymmetry.thresholds", .. })));
    }
}
